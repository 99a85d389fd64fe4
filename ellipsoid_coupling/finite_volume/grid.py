"""Uniform cell-centred grids with ghost layers.

padded array (ny + 4, nx + 4), axis order (y, x); two ghost layers g on each side

    g g g g g g g g        cell (j, i) of the interior sits at [j + 2, i + 2]
    g g g g g g g g        and is centred on (x_low + (i + 1/2) h, y_low + (j + 1/2) h)
    g g . . . . g g
    g g . . . . g g        sweeps march through the flat array with stride 1 (x) or
    g g g g g g g g        nx + 4 (y), so that one kernel serves every direction
    g g g g g g g g
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]

GHOSTS = 2


@dataclass(frozen=True)
class Grid:
    """A uniform grid of square cells of width `cell` over a rectangle."""

    x_low: float
    y_low: float
    cell: float
    nx: int
    ny: int

    @property
    def shape(self) -> tuple[int, int]:
        """Interior cells, (ny, nx)."""
        return self.ny, self.nx

    @property
    def padded(self) -> tuple[int, int]:
        """Cells with ghosts, (ny + 4, nx + 4)."""
        return self.ny + 2 * GHOSTS, self.nx + 2 * GHOSTS

    @property
    def x(self) -> Floats:
        """Cell centres in x, (nx,)."""
        # By products: the roundings of a running sum would add up.
        return np.asarray(self.x_low + self.cell * (np.arange(self.nx) + 0.5), np.float64)

    @property
    def y(self) -> Floats:
        """Cell centres in y, (ny,)."""
        return np.asarray(self.y_low + self.cell * (np.arange(self.ny) + 0.5), np.float64)

    @property
    def x_edges(self) -> Floats:
        """Cell edges in x, (nx + 1,)."""
        return np.asarray(self.x_low + self.cell * np.arange(self.nx + 1), np.float64)

    @property
    def y_edges(self) -> Floats:
        """Cell edges in y, (ny + 1,)."""
        return np.asarray(self.y_low + self.cell * np.arange(self.ny + 1), np.float64)


def scene_grid(scene: Scene) -> Grid:
    """The grid of cell width ``scene.numerics.cell`` over the scene's domain.

    Raises
    ------
    InputError
        If the domain is not a whole number of cells in each direction.
    """
    domain, cell = scene.domain, scene.numerics.cell
    counts = (domain.width / cell, domain.height / cell)
    for count in counts:
        # A width such as 0.1 divides a domain to rounding only.
        if abs(count - round(count)) > 1e-6 * count or round(count) < 1:
            raise InputError(
                f"scene {scene.name}, key numerics.cell",
                "a width that divides the domain into whole cells",
                f"{cell} ({counts[0]:g} x {counts[1]:g} cells)",
                "Choose domain width / whole number.",
            )
    return Grid(domain.x[0], domain.y[0], cell, round(counts[0]), round(counts[1]))


def interior(padded: Floats) -> Floats:
    """The view of the last two axes without ghosts."""
    return padded[..., GHOSTS:-GHOSTS, GHOSTS:-GHOSTS]


def overlap(edges: Floats, box: tuple[float, float]) -> Floats:
    """The part of each cell, (n,) between 0 and 1, that an interval covers."""
    covered = np.minimum(edges[1:], box[1]) - np.maximum(edges[:-1], box[0])
    return np.asarray(np.clip(covered / np.diff(edges), 0.0, 1.0))


def cell_of(grid: Grid, x: float, y: float) -> tuple[int, int]:
    """The cell (j, i) that holds a point; one on the upper rim belongs to the last cell."""
    column, row = (x - grid.x_low) / grid.cell, (y - grid.y_low) / grid.cell
    return min(max(int(row), 0), grid.ny - 1), min(max(int(column), 0), grid.nx - 1)


def first_centre(grid: Grid, cells: NDArray[np.bool_]) -> tuple[float, float]:
    """The centre of the first of some cells (ny, nx)."""
    j, i = np.argwhere(cells)[0]
    return float(grid.x[i]), float(grid.y[j])


def start_angle(grid: Grid, scene: Scene) -> Floats:
    """The mean start angle in every cell less the scene's whole turns, (ny, nx).

    Ellipses look alike half a turn further: those of one cell are turned next to its first one before
    the mean is taken, by half turns, or by whole ones where V2 tells 0 from pi.
    """
    angles = np.full(grid.shape, scene.start.own_angle)
    period = math.pi if scene.angular_potential is None else 2.0 * math.pi
    held: dict[tuple[int, int], list[float]] = {}
    for x, y, angle in scene.start.places():
        # The mean of 0 and pi, of two ellipses that look alike, would be an ellipse across both.
        others = held.setdefault(cell_of(grid, x, y), [])
        first = others[0] if others else angle
        others.append(angle - period * round((angle - first) / period))
    for cell, those in held.items():
        angles[cell] = sum(those) / len(those)
    return angles


def _at_least_a_cell(edges: Floats, box: tuple[float, float]) -> tuple[float, float]:
    """An interval, widened to a cell about its middle, within the grid."""
    cell = edges[1] - edges[0]
    if box[1] - box[0] >= cell:
        return box
    # About the box's middle, unless that would lead beyond the grid.
    low = min(max(0.5 * (box[0] + box[1] - cell), edges[0]), edges[-1] - cell)
    return float(low), float(low + cell)


def start_density(grid: Grid, scene: Scene) -> Floats:
    """Mass 1 over the start box, evenly, (ny, nx); cells cut by its rim hold their part.

    A box narrower than a cell is taken one cell wide, so that its middle stays where it is. With
    start.points, each one's share lies in the cell that holds it.
    """
    places = scene.start.places()
    if places:
        counts = np.zeros(grid.shape)
        for place in places:
            # A sum, since several may lie in one cell.
            counts[cell_of(grid, place[0], place[1])] += 1.0
        return np.asarray(counts / (len(places) * grid.cell**2))
    # A rim that misses an edge by rounding leaves no sliver in the next cell.
    y, x = (
        np.round(overlap(edges, _at_least_a_cell(edges, box)), 12)
        for edges, box in ((grid.y_edges, scene.start.y), (grid.x_edges, scene.start.x))
    )
    part = np.outer(y, x)
    # By the sum of the parts: mass is 1, whatever rounding and the domain's rim have cut off.
    return np.asarray(part / (part.sum() * grid.cell**2))
