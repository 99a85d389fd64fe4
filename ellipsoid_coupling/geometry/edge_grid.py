"""The edges that bound the fluid, sorted into square cells: which of them a short way can meet.

    +-----+-----+-----+        An edge is in the list of every cell that it touches, so that a way looks at
    |     |   / |     |        the edges of the cells that it goes through, and at no others.
    +-----+--/--+-----+
    |    _|_/   |     |        `supports` bounds the edges about each cell by one line. Nearly all ways
    |  _/ |     |     |        stay above it, which is all that is computed for them.
    +-----+-----+-----+

The fluid lies on the left of the way along an edge. A thin plate is two edges in one place, and
only a way that comes from an edge's own side meets it.

Rounding: a way ends `gap` before an edge that it meets, some tens of the last digits of a place, and edges
count as longer by `margin` at both ends. So a place on a wall is on the right side of it by more
than rounding, and no way slips through between two edges.

`edge_sorting` makes such a grid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Vector = tuple[float, float]

# What happens to a particle that meets an edge.
REFLECTS, SHIFTS, ENDS = range(3)
# Columns of `lines`: where the edge starts, its direction (of length 1), its length, and where ways end.
X, Y, ALONG_X, ALONG_Y, LENGTH, GAP = range(6)
# Columns of `supports`.
NORMAL_X, NORMAL_Y, LEVEL, REACH = range(4)
# Cells whose edges `may_meet_edge` looks at; a way that may touch more of them is followed.
_MOST_CELLS = 64


class EdgeGrid(NamedTuple):
    """See the module.

    Attributes
    ----------
    lines : (E, 6) float64
        Columns X .. GAP.
    shifts : (E, 2) float64
        The way to the opposite side, of edges that shift.
    acts, patches : (E,) int64
        REFLECTS, SHIFTS or ENDS; and an index of the boundaries' names.
    first, members : (cells + 1,), (n,) int64
        The edges of cell c are ``members[first[c] : first[c + 1]]``.
    clearance : (cells,) float64
        A length: no edge is as near as that to a place in the cell; -1 for cells in a solid, where nothing
        may be.
    supports : (cells, 4) float64
        Columns NORMAL_X .. REACH: what lies within REACH of a place in the cell has no edge above the
        line n . r = LEVEL, and n is of length 1, or 0 where LEVEL is -inf.
    x_low, y_low, per_length : float
        The lower left corner, and cells in a unit of length.
    columns, rows : int
    margin : float
    """

    lines: Floats
    shifts: Floats
    acts: Indices
    patches: Indices
    first: Indices
    members: Indices
    clearance: Floats
    supports: Floats
    x_low: float
    y_low: float
    per_length: float
    columns: int
    rows: int
    margin: float


class Way(NamedTuple):
    """Bounds a way that bends: r(t) - r(0) is the sum of these vectors, each times a part.

    The parts grow from 0 to 1 on the way, each as it likes.
    """

    velocity: Vector
    force: Vector
    change: Vector
    noise: Vector


@inline_kernel
def _index(place: float, most: int) -> int:
    # Comparisons, not min and max: they keep NaN from becoming an index.
    index = 0
    if place >= most:
        index = most - 1
    elif place > 0.0:
        index = int(place)
    return index


@inline_kernel
def column_of(edges: EdgeGrid, x: float) -> int:
    """The column of cells at x, the nearest one from outside; 0 for NaN."""
    return _index((x - edges.x_low) * edges.per_length, edges.columns)


@inline_kernel
def row_of(edges: EdgeGrid, y: float) -> int:
    """The row of cells at y, as `column_of`."""
    return _index((y - edges.y_low) * edges.per_length, edges.rows)


@inline_kernel
def clearance_at(edges: EdgeGrid, x: float, y: float) -> float:
    """The length up to which no way from a place meets an edge."""
    cell = row_of(edges, y) * edges.columns + column_of(edges, x)
    return float(edges.clearance[cell])


@inline_kernel
def _length(vector: Vector) -> float:
    return abs(vector[0]) + abs(vector[1])


@inline_kernel
def _along(vector: Vector, nx: float, ny: float) -> float:
    return max(0.0, nx * vector[0] + ny * vector[1])


@inline_kernel
def advance_along(way: Way, nx: float, ny: float) -> float:
    """A bound of how far a way leads in a direction (nx, ny) of length 1; no number counts as 0."""
    return (
        _along(way.velocity, nx, ny)
        + _along(way.force, nx, ny)
        + _along(way.change, nx, ny)
        + _along(way.noise, nx, ny)
    )


@inline_kernel
def leaves_support(edges: EdgeGrid, x: float, y: float, way: Way) -> bool:
    """Whether a way from a place can come to an edge, as far as its cell tells: one look-up.

    Not one that is not a number.
    """
    cell = row_of(edges, y) * edges.columns + column_of(edges, x)
    nx, ny = edges.supports[cell, NORMAL_X], edges.supports[cell, NORMAL_Y]
    above = nx * x + ny * y - edges.supports[cell, LEVEL]
    length = _length(way.velocity) + _length(way.force) + _length(way.change) + _length(way.noise)
    # Both sides of | are computed, so that the loop over particles has no branch.
    leaves: bool = (length > edges.supports[cell, REACH]) | (advance_along(way, -nx, -ny) > above)
    return leaves


@kernel
def may_meet_edge(edges: EdgeGrid, x: float, y: float, way: Way) -> bool:
    """Whether a way from a place can come to an edge, by all edges about it: a better bound, for few."""
    rim = 4.0 * edges.margin
    left, right = advance_along(way, -1.0, 0.0) + rim, advance_along(way, 1.0, 0.0) + rim
    down, up = advance_along(way, 0.0, -1.0) + rim, advance_along(way, 0.0, 1.0) + rim
    columns = column_of(edges, x - left), column_of(edges, x + right)
    rows = row_of(edges, y - down), row_of(edges, y + up)
    if (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1) > _MOST_CELLS:
        return True
    for row in range(rows[0], rows[1] + 1):
        for column in range(columns[0], columns[1] + 1):
            cell = row * edges.columns + column
            for member in range(edges.first[cell], edges.first[cell + 1]):
                if _may_meet(edges.lines[edges.members[member]], x, y, way, rim):
                    return True
    return False


@kernel
def _may_meet(line: Floats, x: float, y: float, way: Way, rim: float) -> bool:
    """Whether a way can come to an edge from above, by its line and by its ends."""
    ax, ay = line[ALONG_X], line[ALONG_Y]
    dx, dy = x - line[X], y - line[Y]
    above, along = ax * dy - ay * dx, ax * dx + ay * dy
    # Who is below the edge meets it on the way back only, if the way leads above it.
    if not -rim - advance_along(way, -ay, ax) <= above <= rim + advance_along(way, ay, -ax):
        return False
    before = along + advance_along(way, ax, ay) < -rim
    behind = along - advance_along(way, -ax, -ay) > line[LENGTH] + rim
    return not (before or behind)


def edge_ends(grid: EdgeGrid) -> Floats:
    """(E, 2, 2), where each edge starts and where it stops, (x, y)."""
    start, along = grid.lines[:, [X, Y]], grid.lines[:, [ALONG_X, ALONG_Y]]
    return np.stack((start, start + grid.lines[:, LENGTH, None] * along), axis=1)


def cell_middles(grid: EdgeGrid) -> tuple[Floats, Floats]:
    """X (columns,) and y (rows,) of the cells' middles."""
    columns, rows = (
        np.arange(grid.columns, dtype=np.float64),
        np.arange(grid.rows, dtype=np.float64),
    )
    size = 1.0 / grid.per_length
    return grid.x_low + (columns + 0.5) * size, grid.y_low + (rows + 0.5) * size


def without_cells(grid: EdgeGrid, solid: NDArray[np.bool_]) -> EdgeGrid:
    """The grid, in which cells that no edge touches and that are `solid` (rows, columns) hold nothing."""
    empty = solid.ravel() & (np.diff(grid.first) == 0)
    supports = grid.supports.copy()
    supports[empty, REACH] = -1.0
    return grid._replace(clearance=np.where(empty, -1.0, grid.clearance), supports=supports)


@kernel
def off_edges(edges: EdgeGrid, x: Floats, y: Floats) -> None:
    """Put places (n,) in the fluid that lie on an edge before it, by its gap, in place."""
    for i in range(x.size):
        cell = row_of(edges, y[i]) * edges.columns + column_of(edges, x[i])
        for member in range(edges.first[cell], edges.first[cell + 1]):
            line = edges.lines[edges.members[member]]
            dx, dy = x[i] - line[X], y[i] - line[Y]
            along = line[ALONG_X] * dx + line[ALONG_Y] * dy
            before = line[ALONG_X] * dy - line[ALONG_Y] * dx
            if abs(before) < line[GAP] and abs(along - 0.5 * line[LENGTH]) <= 0.5 * line[LENGTH]:
                x[i] -= (line[GAP] - before) * line[ALONG_Y]
                y[i] += (line[GAP] - before) * line[ALONG_X]


@kernel
def count_in_solid(edges: EdgeGrid, x: Floats, y: Floats) -> int:
    """How many places (R, N) lie in a cell that is all solid."""
    count = 0
    for k in range(x.shape[0]):
        for i in range(x.shape[1]):
            count += clearance_at(edges, x[k, i], y[k, i]) < 0.0
    return count
