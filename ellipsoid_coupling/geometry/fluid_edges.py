"""Everything that bounds the fluid within the domain: the outline's edges, and sides that cut the fluid.

    edges of the outline      within the domain or on its sides: as the kind of their patch says
    sides of the domain       where no edge of the outline lies on them: as the kind of the side says
    periodic sides            shift what reaches them to the opposite side

The outline goes on beyond a domain that is smaller than the case; nothing gets there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.inside import grid_in_fluid, in_fluid
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.geometry.edge_grid import (
    ENDS,
    REFLECTS,
    SHIFTS,
    EdgeGrid,
    cell_middles,
    edge_ends,
    without_cells,
)
from ellipsoid_coupling.geometry.edge_sorting import Edges, edge_grid
from ellipsoid_coupling.geometry.patches import patch_parts, same_place
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.boundary import BoundaryPart
from ellipsoid_coupling.scenes.scene import Domain
from ellipsoid_coupling.scenes.sides import SIDES, SideName

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_ACTS = {"reflect": REFLECTS, "wrap": SHIFTS, "leave": ENDS}
# Sides are longer than the domain by this many `same_place`, so that they meet walls beside its corners.
_LONGER = 4.0


@dataclass(frozen=True)
class FluidEdges:
    """What bounds the fluid.

    Attributes
    ----------
    grid : EdgeGrid
        The edges; its `patches` are indices of names.
    names : tuple of str
        The patches of the case, and behind them the sides of the domain.
    parts : tuple of BoundaryPart
        The kind of each.
    outline : Outline
        Of the whole case.
    domain : Domain
    """

    grid: EdgeGrid
    names: tuple[str, ...]
    parts: tuple[BoundaryPart, ...]
    outline: Outline
    domain: Domain

    def inside(self, x: Floats, y: Floats) -> NDArray[np.bool_]:
        """Whether places, arrays of one shape, lie in the fluid and in the domain."""
        return places_inside(self.outline, self.domain, x, y)

    def walls(self, names: tuple[str, ...] | None) -> Floats:
        """(n, 2, 2), the ends of the edges that reflect: on these patches and sides, or all of them.

        Raises
        ------
        InputError
            If there is none.
        """
        ends, grid = edge_ends(self.grid), self.grid
        chosen = grid.acts == REFLECTS
        if names is not None:
            on = np.isin(grid.patches, [p for p, name in enumerate(self.names) if name in names])
            for side in SIDES:
                if side in names:
                    on |= lying_on(ends, self.domain, side)
            chosen &= on
        if not chosen.any():
            raise InputError(
                "walls.sides",
                "walls that reflect, on sides of the domain or patches of the case",
                ", ".join(names or ("none",)),
                "Name others, or leave out [walls].",
            )
        return np.asarray(ends[chosen])

    @property
    def ends_any(self) -> bool:
        """Whether a particle can end at some edge."""
        return bool((self.grid.acts == ENDS).any())


def places_inside(outline: Outline, domain: Domain, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether places, arrays of one shape, lie in the fluid and in the domain."""
    within = _between(x, domain.x) & _between(y, domain.y)
    return within & in_fluid(outline.ends, x.ravel(), y.ravel()).reshape(x.shape)


def _cells_inside(outline: Outline, domain: Domain, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """(ny, nx), as `places_inside`, of the nodes x (nx,), y (ny,) of a grid."""
    within = _between(y, domain.y)[:, None] & _between(x, domain.x)
    return within & grid_in_fluid(outline.ends, x, y)


def _between(values: Floats, interval: tuple[float, float]) -> NDArray[np.bool_]:
    return np.asarray((interval[0] <= values) & (values <= interval[1]))


def fluid_edges(scene: Scene, outline: Outline) -> FluidEdges:
    """What bounds the fluid of a scene in a case with this outline, of no edge where nothing is known.

    Raises
    ------
    InputError
        For a periodic patch that does not lie on periodic sides.
    """
    parts = patch_parts(scene, outline)
    kept = _edges_of_outline(scene, outline, parts)
    sides = [_edges_of_side(scene, outline, name, len(parts) + k) for k, name in enumerate(SIDES)]
    edges = Edges(*(np.concatenate(columns) for columns in zip(kept, *sides, strict=True)))
    domain = scene.domain
    grid = edge_grid(edges, domain.x, domain.y)
    solid = ~_cells_inside(outline, domain, *cell_middles(grid))
    return FluidEdges(
        without_cells(grid, solid),
        (*parts, *SIDES),
        (*parts.values(), *scene.sides.values()),
        outline,
        domain,
    )


def lying_on(ends: Floats, domain: Domain, side: SideName) -> NDArray[np.bool_]:
    """(E,), which edges (E, 2, 2) lie on that side of the domain, as wide as that or not."""
    axis, at = _axis_and_place(domain, side)
    off = np.abs(ends[:, :, axis] - at).max(axis=1)
    return np.asarray(off <= same_place(domain))


def _axis_and_place(domain: Domain, side: SideName) -> tuple[int, float]:
    """The coordinate that a side holds fixed, and its value."""
    places = {"left": (0, domain.x[0]), "right": (0, domain.x[1])}
    return (places | {"bottom": (1, domain.y[0]), "top": (1, domain.y[1])})[side]


def _in_or_on(outline: Outline, domain: Domain) -> NDArray[np.bool_]:
    """(E,), which edges may have a part within the domain or on its sides."""
    more, held = same_place(domain), np.ones(len(outline.ends), np.bool_)
    for axis, (low, high) in enumerate((domain.x, domain.y)):
        along = outline.ends[:, :, axis]
        held &= (along.max(axis=1) >= low - more) & (along.min(axis=1) <= high + more)
    return held


def _edges_of_outline(
    scene: Scene, outline: Outline, parts: dict[str, BoundaryPart]
) -> tuple[Floats, Floats, Indices, Indices]:
    """(ends, shifts, acts, patches) of the outline's edges, but for those that periodic sides stand for."""
    held = _in_or_on(outline, scene.domain)
    for side_name, side in scene.sides.items():
        if side.particles == "wrap":
            held &= ~lying_on(outline.ends, scene.domain, side_name)
    patches = outline.patch[held]
    acts = np.array([_ACTS[part.particles] for part in parts.values()], np.int64)[patches]
    if (acts == SHIFTS).any():
        name = outline.names[int(patches[acts == SHIFTS][0])]
        raise InputError(
            f"scene {scene.name}, key boundaries",
            f"periodic sides of the domain where the case's patch {name} is periodic",
            "sides of another kind, or elsewhere",
            'Set boundaries.SIDE.kind = "periodic" for both of them, or name another kind for the '
            f"patch: boundaries.{name}.kind.",
        )
    return outline.ends[held], np.zeros((len(patches), 2)), acts, patches


def _edges_of_side(
    scene: Scene, outline: Outline, name: SideName, number: int
) -> tuple[Floats, Floats, Indices, Indices]:
    """(ends, shifts, acts, patches) of what of a side the outline leaves, with the domain on the left."""
    domain, act = scene.domain, _ACTS[scene.sides[name].particles]
    axis, at = _axis_and_place(domain, name)
    along = (domain.x, domain.y)[1 - axis]
    covered = np.empty((0, 2))
    if act != SHIFTS:
        covered = np.sort(
            outline.ends[lying_on(outline.ends, domain, name)][:, :, 1 - axis], axis=1
        )
    pieces = _uncovered(along, covered, same_place(domain))
    # Up on the right, to the left on the top, and so on: counter-clockwise.
    if name in ("left", "top"):
        pieces = pieces[:, ::-1]
    ends = np.empty((len(pieces), 2, 2))
    ends[:, :, axis], ends[:, :, 1 - axis] = at, pieces
    shift = np.zeros((len(pieces), 2))
    if act == SHIFTS:
        low, high = (domain.x, domain.y)[axis]
        shift[:, axis] = high - low if at == low else low - high
    count = np.ones(len(pieces), np.int64)
    return ends, shift, act * count, number * count


def _uncovered(along: tuple[float, float], covered: Floats, same: float) -> NDArray[np.float64]:
    """The parts (n, 2) of an interval that intervals (m, 2) leave, a little longer than they are."""
    low, high = along
    pieces, reached = [], low
    for start, stop in covered[np.argsort(covered[:, 0], kind="stable")]:
        if start > reached + same:
            pieces.append((reached, min(start, high)))
        reached = max(reached, stop)
        if reached >= high:
            break
    if reached < high - same:
        pieces.append((reached, high))
    longer = _LONGER * same * np.array([-1.0, 1.0])
    return np.reshape(pieces, (-1, 2)) + longer
