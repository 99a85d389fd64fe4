"""The contract of a numerical flux, seen from a sweep.

A flux is a formula of a cell and its two neighbours, and never sees an array: the sweep calls it for
every cell. It comes in one of two kinds:

    register_flux        what leaves a cell through either face, (flux, stencil, ratio) -> (up, down)
    register_face_flux   what goes through the face between two cells, (flux, stencil, ratio) -> face
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.jit import KERNEL_OPTIONS, inline_kernel
from ellipsoid_coupling.compiled.rows import map_fields

Floats = NDArray[np.float64]


# Component 0 of every system is the density; to a flux, component 1 is the momentum along the sweep.
DENSITY, ALONG = 0, 1
# Up to this part of the mean density a cell counts as vacuum, and is set to 0: a rim so thin is
# 1e-17 of the mass in a thousand steps, and without it every step would widen by a cell what is
# computed.
VACUUM = 1e-20
_OPTIONS: Any = KERNEL_OPTIONS


def in_order(count: int, normal: int) -> tuple[int, ...]:
    """Of `count` components the density, the momentum along the sweep, and then the others."""
    others = (k for k in range(count) if k not in (DENSITY, normal))
    return DENSITY, normal, *others


class Flux(Protocol):
    """A NamedTuple of a flux's parameters: numbers, or arrays that belong to the cells, ghosts included."""

    @property
    def vacuum(self) -> float:
        """The density up to which a cell counts as empty."""
        ...


class Stencil(NamedTuple):
    """A cell and its neighbours along the direction that is swept.

    below, here, above : (K,) what they hold: the density, the momentum along the direction, and
    whatever else is carried.
    inverse : 1/rho of the three, 0 in vacuum. Whatever is carried is its content times this.
    cell, stride : the cell's index in the flat fields, and the distance to its upper neighbour.
    """

    below: Values
    here: Values
    above: Values
    inverse: tuple[float, float, float]
    cell: int
    stride: int


@inline_kernel
def less(a: float, b: float) -> float:
    """A - b."""
    return a - b


def through_face(flux: Flux, stencil: Stencil, up: Any, ratio: float) -> tuple[Values, Any]:
    """What goes up through the face between `below` and `here` in one step, and what is kept for the next.

    In units of a cell's content; a sweep then updates a cell by the difference of its two faces, which
    conserves by construction.

    Parameters
    ----------
    flux : NamedTuple
        Chooses the flux and holds its parameters, `vacuum` among them.
    stencil : Stencil
    up : (K,) or ()
        What leaves `below` through this face, kept of the cell before (see `kept_for`).
    ratio : float
        dt / h.
    """
    del stencil, up, ratio
    raise TypeError(f"{type(flux).__name__} is no registered flux")


def kept_for(flux: Flux, up: Any) -> Any:
    """`up`, of what is kept from cell to cell; () where the flux is given at faces and keeps nothing."""
    del up
    raise TypeError(f"{type(flux).__name__} is no registered flux")


def register_flux(flux_type: type[Any], outflow: Callable[..., Any]) -> None:
    """Make `outflow` what compiled sweeps call for a flux of this type, for every cell.

    outflow : an inline kernel, (flux, stencil, ratio) -> (up, down), what leaves `here` through its
    upper and its lower face, map_fields (K,).
    """

    def through(flux: Any, stencil: Any, up: Any, ratio: Any) -> Any:
        leaving, down = outflow(flux, stencil, ratio)
        return map_fields(less, (), (up, down)), leaving

    _register(flux_type, through, lambda _, up: up)


def register_face_flux(flux_type: type[Any], face_flux: Callable[..., Any]) -> None:
    """Make `face_flux` what compiled sweeps call for a flux of this type, for every face.

    face_flux : an inline kernel, (flux, stencil, ratio) -> (K,), of the face between `below` and
    `here`; it does not look at `above`.
    """

    def through(flux: Any, stencil: Any, up: Any, ratio: Any) -> Any:
        return face_flux(flux, stencil, ratio), up

    _register(flux_type, through, lambda _, __: ())


def _register(
    flux_type: type[Any], through: Callable[..., Any], kept: Callable[[Any, Any], Any]
) -> None:
    def is_meant(flux: Any) -> bool:
        return getattr(flux, "instance_class", None) is flux_type

    def choose(flux: Any, stencil: Any, up: Any, ratio: Any) -> Callable[..., Any] | None:
        del stencil, up, ratio
        return through if is_meant(flux) else None

    def choose_kept(flux: Any, up: Any) -> Callable[[Any, Any], Any] | None:
        del up
        return kept if is_meant(flux) else None

    overload(through_face, inline="always", strict=False, jit_options=_OPTIONS)(choose)
    overload(kept_for, inline="always", strict=False, jit_options=_OPTIONS)(choose_kept)
