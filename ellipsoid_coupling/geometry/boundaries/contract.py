"""The contract of a boundary: what happens at one side of the domain.

A kind is a NamedTuple (its parameters) with two properties, registered together:

    ghost       the formula of what a ghost cell holds, for grids
    particles   "reflect", "leave" or "wrap": what a particle does that reaches the side

A ghost follows from two cells of the domain, the one at the edge and its image:

      particles "reflect", "leave"             particles "wrap"

         ghosts | domain                          ghosts | domain            | other side
          1   0 | 0   1   2                        1   0 | e   .   .   .  1  0
                  e                                images: the cells at the other side
         images: mirrored at the edge e

Mass passes a side only where particles may leave.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.dispatch import chosen_by_type, compile_choice, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.scenes.sides import AtSide, KindKeys, declare_kind

# Where things stand in a cell, seen from a side. What follows is the same whichever side it is: the
# other momentum, and from OTHERS on whatever else is transported.
DENSITY, ALONG, ACROSS, OTHERS = range(4)


class Place(NamedTuple):
    """The middle of a ghost's face on the side, and the angle of its plane (0 on an r-grid).

    carried : (K,) what the fluid carries of a density 1 through this face, in the order of a cell: 1 (of
    the plane's angle its part), its velocity along and across, and whatever else is transported; ()
    where the grid does not ask for it, see `finite_volume.fluid_lines`.
    """

    x: float
    y: float
    angle: float
    carried: Values = ()


@chosen_by_type
def ghost(
    kind: object, edge: Values, image: Values, normal: float, t: float, place: Place
) -> Values:
    """What a ghost cell holds.

    Parameters
    ----------
    kind : NamedTuple
        Chooses the formula and holds its parameters.
    edge, image : (K,)
        Cells of the domain, see the module: density, momentum along the normal's axis, momentum
        across it, and whatever else is transported. On a q-grid these are of one angle.
    normal : float
        The inner normal's component along its axis: 1 on the left and at the bottom, -1 on the right
        and at the top. ``edge[ALONG] * normal > 0`` moves into the domain.
    t : float
        The time at the start of the step.
    place : Place
    """
    raise NotImplementedError


class Seen(NamedTuple):
    """The arguments of `ghost` but the kind."""

    edge: Values
    image: Values
    normal: float
    t: float
    place: Place


@inline_kernel
def _ghost_seen(kind: object, seen: Seen) -> Values:
    return ghost(kind, seen.edge, seen.image, seen.normal, seen.t, seen.place)


def ghost_of(kinds: tuple[object, ...], number: int, seen: Seen) -> Values:
    """What a ghost cell of kind number `number` holds; see `ghost`."""
    return _ghost_seen(kinds[number], seen)


compile_choice(ghost_of, _ghost_seen)


# The type of each kind, by name; what particles do there and how fast mass comes in, by type.
_TYPES: dict[str, Callable[..., object]] = {}
_PARTICLES: dict[type, AtSide] = {}
_INFLOWS: dict[type, Callable[..., float]] = {}


def register_boundary(
    name: str,
    kind: type[NamedTuple],
    formula: Callable[..., Values],
    particles: AtSide,
    inflow: Callable[..., float] | None = None,
) -> None:
    """Make a kind of boundary known, to scene files by its name and to kernels by its type.

    Parameters
    ----------
    name : str
        ``kind = "name"`` in [boundaries.SIDE].
    kind : a NamedTuple
        Its fields are numbers, the further keys of that section; those with a default may be left out.
    formula : an inline kernel, or a Python function that numba can compile
        See `ghost`.
    particles : "reflect", "leave" or "wrap"
    inflow : (kind) -> float, optional
        The largest speed of what comes in, which steps follow: cells know it only afterwards. None
        where nothing comes in.

    Raises
    ------
    ValueError
        If the name or the type is registered already.
    TypeError
        If the formula takes another number of arguments.
    """
    optional = tuple(kind._field_defaults)
    required = tuple(field for field in kind._fields if field not in optional)
    if name in _TYPES:
        raise ValueError(f"there is another kind of boundary named {name!r}")
    # The kind last: where the formula is refused, scenes do not know it.
    register_formula(ghost, kind, formula)
    declare_kind(name, KindKeys(particles, inflow is not None, required, optional))
    _TYPES[name], _PARTICLES[kind] = kind, particles
    if inflow is not None:
        _INFLOWS[kind] = inflow


def at_side(kind: object) -> AtSide:
    """What a particle does that reaches a side of this kind."""
    return _PARTICLES[type(kind)]


def make_kind(name: str, parameters: dict[str, float]) -> object:
    """The kind of that name with these parameters, numbers by field."""
    return _TYPES[name](**parameters)


def inflow_speed(kind: object) -> float:
    """The largest speed of what comes in at a side of this kind; 0 where nothing does."""
    return _INFLOWS[type(kind)](kind) if type(kind) in _INFLOWS else 0.0
