"""The contract of a numerical flux, seen from a sweep."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import (
    KERNEL_OPTIONS,
    inline_kernel,
    view_kernel,
)

Floats = NDArray[np.float64]


# Component 0 of every system is the density.
DENSITY = 0
# Up to this part of the mean density a cell counts as vacuum, and is set to 0: a rim so thin is
# 1e-17 of the mass in a thousand steps, and without it every step would widen by a cell what is
# computed.
VACUUM = 1e-20
_OPTIONS: Any = KERNEL_OPTIONS


class Flux(Protocol):
    """A NamedTuple of a flux's parameters: numbers, or arrays that belong to the cells."""

    @property
    def vacuum(self) -> float:
        """The density up to which a cell counts as empty."""
        ...


class Span(NamedTuple):
    """A run of neighbouring cells in the flat fields, and the direction that is swept.

    Cells ``start .. start + width - 1``; the neighbours of cell p in the swept direction are
    ``p - stride`` and ``p + stride``; `normal` is the component that holds the momentum along it.
    """

    start: int
    width: int
    stride: int
    normal: int


@inline_kernel
def run_of(fields: Floats, component: int, first: int, width: int) -> Floats:
    """One component of `width` cells from `first` on, a view.

    Loops over a run's own index vectorise. With ``fields[component, first + i]`` they gather, four
    times slower: the sum might be negative, and would then count from the end.
    """
    return fields[component, first : first + width]


@inline_kernel
def around(fields: Floats, component: int, span: Span) -> tuple[Floats, Floats, Floats]:
    """One component of the cells of a span, of their upper and of their lower neighbours, views."""
    start, width, stride = span.start, span.width, span.stride
    return (
        run_of(fields, component, start, width),
        run_of(fields, component, start + stride, width),
        run_of(fields, component, start - stride, width),
    )


class Inverse(NamedTuple):
    """1/rho, 0 in vacuum, of the cells of a span, of their upper and of their lower neighbours.

    Each (width or more,). Whatever is carried is its field times this; divided once a cell only.
    """

    here: Floats
    above: Floats
    below: Floats


@view_kernel
def invert(fields: Floats, first: int, vacuum: float, inverse: Floats) -> None:
    """1/rho of the cells from `first` on, as many as `inverse` has room for; 0 in vacuum."""
    density = run_of(fields, DENSITY, first, inverse.size)
    for i in range(inverse.size):
        inverse[i] = 1.0 / density[i] if density[i] > vacuum else 0.0


def outflow(
    flux: Flux,
    fields: Floats,
    span: Span,
    inverse: Inverse,
    ratio: float,
    up: Floats,
    down: Floats,
    work: Floats,
) -> None:
    """What leaves each cell of a span during one step, in units of the cell's content.

    Every flux overloads this for its own type, without allocating anything. A sweep then updates cell p to
    ``U[p] - up[p] - down[p] + up[p - stride] + down[p + stride]``, which conserves by construction.

    Parameters
    ----------
    flux : NamedTuple
        Chooses the flux and holds its parameters, `vacuum` among them.
    fields : (K, cells) float64
        Conserved fields, flat; component 0 is the density.
    span : Span
    inverse : Inverse
    ratio : float
        dt / h.
    up, down : (K, width or more)
        Overwritten: through the upper face into p + stride, through the lower into p - stride. A
        flux given at faces puts all of it into `up` and has `down` as scratch.
    work : (5, width or more)
        Scratch rows.
    """
    del fields, span, inverse, ratio, up, down, work
    raise TypeError(f"{type(flux).__name__} has no overload of outflow")


def at_faces(flux: Flux) -> bool:
    """Whether the flux is given at faces: all of it is in `up`, none in `down`."""
    raise TypeError(f"{type(flux).__name__} has no overload of at_faces")


def register_flux(
    flux_type: type[Any], implementation: Callable[..., None], *, faces: bool = False
) -> None:
    """Make `implementation` what compiled sweeps call for a flux of this type.

    faces : what `at_faces` says of it.
    """
    compiled = view_kernel(implementation)

    def is_meant(flux: Any) -> bool:
        return getattr(flux, "instance_class", None) is flux_type

    def choose(
        flux: Any,
        fields: Any,
        span: Any,
        inverse: Any,
        ratio: Any,
        up: Any,
        down: Any,
        work: Any,
    ) -> Callable[..., None] | None:
        del fields, span, inverse, ratio, up, down, work
        if not is_meant(flux):
            return None
        return lambda flux, fields, span, inverse, ratio, up, down, work: compiled(
            flux, fields, span, inverse, ratio, up, down, work
        )

    def choose_faces(flux: Any) -> Callable[[Any], bool] | None:
        return (lambda _: faces) if is_meant(flux) else None

    overload(outflow, strict=False, jit_options=_OPTIONS)(choose)
    overload(at_faces, strict=False, jit_options=_OPTIONS)(choose_faces)
