"""The contract of a numerical flux, seen from a sweep.

A flux is a NamedTuple of parameters and a formula of a cell and its two neighbours. It never sees an
array: the sweep calls it for every cell. It comes in one of two kinds:

    register_flux        what leaves a cell through either face, (flux, stencil, ratio) -> (up, down)
    register_face_flux   what goes through the face between two cells, (flux, stencil, ratio) -> face

    cells     below        here        above
            |         | F         |           |      F = up(below) - down(here), or the face flux
                      ^ through_face

A sweep goes upwards. A flux of cells keeps `up` of a cell for the next face; a flux of faces keeps
nothing, an empty tuple, for which no code is made.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeVar

from ellipsoid_coupling.compiled.algebra import Values, sub
from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula, require_arguments

# Component 0 of every system is the density; to a flux, component 1 is the momentum along the sweep.
DENSITY, ALONG = 0, 1
# Up to this part of the mean density a cell counts as vacuum, and is set to 0. So thin a rim is 1e-17
# of the mass in a thousand steps; without the bound every step would widen the computed part by a cell.
VACUUM = 1e-20


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

    below, here, above : (K,) their contents: the density, the momentum along the direction, and
    whatever else is transported.
    inverse : 1/rho of the three, 0 in vacuum. A transported quantity is its content times this.
    cell, stride : the cell's index in the flat fields, and the distance to its upper neighbour.
    """

    below: Values
    here: Values
    above: Values
    inverse: tuple[float, float, float]
    cell: int
    stride: int


# Of a flux's formula.
_ARGUMENTS = "flux", "stencil", "ratio"
Kept = TypeVar("Kept")
CellFlux = Callable[..., tuple[Values, Values]]
FaceFlux = Callable[..., Values]


@chosen_by_type
def through_face(flux: Flux, stencil: Stencil, up: Values, ratio: float) -> tuple[Values, Values]:
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

    Raises
    ------
    TypeError
        For a flux that is not registered.
    """
    raise NotImplementedError


@chosen_by_type
def kept_for(flux: Flux, up: tuple[Kept, ...]) -> tuple[Kept, ...]:
    """`up`, (K,) rows or numbers, for a flux that keeps something from cell to cell; else ()."""
    raise NotImplementedError


def register_flux(flux_type: type[Flux], outflow: CellFlux) -> None:
    """Make `outflow` what sweeps call for a flux of this type, for every cell.

    outflow : an inline kernel, (flux, stencil, ratio) -> (up, down), what leaves `here` through its
    upper and its lower face, (K,) each.

    Raises ValueError for a type that has a flux already, TypeError for other arguments.
    """
    require_arguments(outflow, _ARGUMENTS)

    def through(flux: Flux, stencil: Stencil, up: Values, ratio: float) -> tuple[Values, Values]:
        leaving, down = outflow(flux, stencil, ratio)
        return sub(up, down), leaving

    register_formula(through_face, flux_type, through)
    register_formula(kept_for, flux_type, lambda flux, up: up)  # noqa: ARG005


def register_face_flux(flux_type: type[Flux], face_flux: FaceFlux) -> None:
    """Make `face_flux` what sweeps call for a flux of this type, for every face.

    face_flux : an inline kernel, (flux, stencil, ratio) -> (K,), of the face between `below` and
    `here`; it does not look at `above`.

    Raises ValueError for a type that has a flux already, TypeError for other arguments.
    """
    require_arguments(face_flux, _ARGUMENTS)

    def through(flux: Flux, stencil: Stencil, up: Values, ratio: float) -> tuple[Values, Values]:
        return face_flux(flux, stencil, ratio), up

    register_formula(through_face, flux_type, through)
    register_formula(kept_for, flux_type, lambda flux, up: ())  # noqa: ARG005
