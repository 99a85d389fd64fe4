"""The edges that bound the fluid, sorted into square cells: which of them a short way can meet.

    +-----+-----+-----+        An edge is in the list of every cell that it touches, so that a way looks at
    |     |   / |     |        the edges of the cells that it goes through, and at no others.
    +-----+--/--+-----+
    |    _|_/   |     |        `clearance` is a length by cell: a way that starts in the cell and is shorter
    |  _/ |     |     |        meets no edge. Far from all edges that is all that is computed.
    +-----+-----+-----+

The fluid lies on the left of the way along an edge. A thin plate is two edges in one place, and
only a way that comes from an edge's own side meets it.

Rounding: a way ends `gap` before an edge that it meets, some tens of the last digits of a place, and edges
count as longer by `margin` at both ends. So a place on a wall is on the right side of it by more
than rounding, and no way slips through between two edges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# What happens to a particle that meets an edge.
REFLECTS, SHIFTS, ENDS = range(3)
# Columns of `lines`: where the edge starts, its direction (of length 1), its length, and where ways end.
X, Y, ALONG_X, ALONG_Y, LENGTH, GAP = range(6)
# Last digits of the largest coordinate that ways end before an edge.
_GAP_DIGITS = 64.0
# Cells on the longer side of the domain: more for many edges, so that each cell holds few.
_FEWEST_CELLS, _MOST_CELLS, _EDGES_PER_CELL = 128, 1024, 4


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
        See the module; -1 for cells in a solid, where nothing may be.
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
    x_low: float
    y_low: float
    per_length: float
    columns: int
    rows: int
    margin: float


class Edges(NamedTuple):
    """Edges as they are handed to `edge_grid`; see `EdgeGrid` for the attributes."""

    ends: Floats
    shifts: Floats
    acts: Indices
    patches: Indices


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


@kernel
def has_edge_within(edges: EdgeGrid, x: float, y: float, way: float) -> bool:
    """Whether a way of this length from a place can meet an edge; a bound, by the edges' lines and ends."""
    reach = way + 4.0 * edges.margin
    columns = column_of(edges, x - reach), column_of(edges, x + reach)
    for row in range(row_of(edges, y - reach), row_of(edges, y + reach) + 1):
        for column in range(columns[0], columns[1] + 1):
            cell = row * edges.columns + column
            for member in range(edges.first[cell], edges.first[cell + 1]):
                e = edges.members[member]
                dx, dy = x - edges.lines[e, X], y - edges.lines[e, Y]
                ax, ay = edges.lines[e, ALONG_X], edges.lines[e, ALONG_Y]
                along = ax * dx + ay * dy
                near = -reach <= along <= edges.lines[e, LENGTH] + reach
                if near and abs(ax * dy - ay * dx) <= reach:
                    return True
    return False


@kernel
def _touches(line: Floats, x: float, y: float, half: float) -> bool:
    """Whether an edge touches the square about (x, y), in whose bounding box it is."""
    across = abs(line[ALONG_X] * (y - line[Y]) - line[ALONG_Y] * (x - line[X]))
    return bool(across <= half * (abs(line[ALONG_X]) + abs(line[ALONG_Y])))


@kernel
def _sort(edges: EdgeGrid, counts: Indices, members: Indices, fill: bool) -> None:
    """Count the edges of each cell, or put them where `counts` says that the cell's next one goes."""
    size = 1.0 / edges.per_length
    # Wider than a cell by more than rounding, so that a way need not ask which side of a seam it is on.
    half = 0.5 * size + 2.0 * edges.margin
    for e in range(len(edges.lines)):
        line = edges.lines[e]
        x, y = line[X], line[Y]
        end_x, end_y = x + line[LENGTH] * line[ALONG_X], y + line[LENGTH] * line[ALONG_Y]
        more = 4.0 * edges.margin
        columns = column_of(edges, min(x, end_x) - more), column_of(edges, max(x, end_x) + more)
        rows = row_of(edges, min(y, end_y) - more), row_of(edges, max(y, end_y) + more)
        for row in range(rows[0], rows[1] + 1):
            for column in range(columns[0], columns[1] + 1):
                middle_x = edges.x_low + (column + 0.5) * size
                middle_y = edges.y_low + (row + 0.5) * size
                if _touches(line, middle_x, middle_y, half):
                    cell = row * edges.columns + column
                    if fill:
                        members[counts[cell]] = e
                    counts[cell] += 1


def _lines(ends: Floats, acts: Indices, gap: float) -> Floats:
    way = ends[:, 1] - ends[:, 0]
    length = np.hypot(way[:, 0], way[:, 1])
    along = way / length[:, None]
    # Periodic sides meet exactly: a place there is one of the other side to the bit.
    gaps = np.where(acts == SHIFTS, 0.0, gap)
    return np.ascontiguousarray(np.column_stack((ends[:, 0], along, length, gaps)))


def edge_grid(edges: Edges, x_range: tuple[float, float], y_range: tuple[float, float]) -> EdgeGrid:
    """Sort edges into the cells of a rectangle in which all particles are.

    Parameters
    ----------
    edges : Edges
        At least one of them in or at the rectangle.
    x_range, y_range : (low, high)
    """
    width, height = x_range[1] - x_range[0], y_range[1] - y_range[0]
    longer = max(width, height)
    wanted = min(max(len(edges.ends) // _EDGES_PER_CELL, _FEWEST_CELLS), _MOST_CELLS)
    size = longer / wanted
    largest = max(map(abs, (*x_range, *y_range)))
    gap = _GAP_DIGITS * float(np.finfo(np.float64).eps) * max(largest, longer)
    columns, rows = (math.ceil(side / size) + 2 for side in (width, height))
    nobody = np.empty(0, np.int64)
    grid = EdgeGrid(
        lines=_lines(edges.ends, edges.acts, gap),
        shifts=edges.shifts,
        acts=edges.acts,
        patches=edges.patches,
        first=nobody,
        members=nobody,
        clearance=np.zeros(columns * rows),
        x_low=x_range[0] - size,
        y_low=y_range[0] - size,
        per_length=1.0 / size,
        columns=columns,
        rows=rows,
        margin=2.0 * gap,
    )
    counts = np.zeros(columns * rows, np.int64)
    _sort(grid, counts, nobody, False)
    first = np.concatenate(([0], np.cumsum(counts)))
    members = np.empty(first[-1], np.int64)
    _sort(grid, first[:-1].copy(), members, True)
    return grid._replace(first=first, members=members, clearance=_clearance(counts > 0, size, grid))


def _clearance(touched: NDArray[np.bool_], size: float, grid: EdgeGrid) -> Floats:
    """The distance of each cell to the nearest one that an edge touches, from rim to rim: a bound."""
    apart = ndimage.distance_transform_edt(~touched.reshape(grid.rows, grid.columns))
    clear = size * np.maximum(apart - math.sqrt(2.0), 0.0) - 4.0 * grid.margin
    return np.ascontiguousarray(np.maximum(clear, 0.0).ravel())


def edge_ends(grid: EdgeGrid) -> Floats:
    """(E, 2, 2), where each edge starts and where it stops, (x, y)."""
    start, along = grid.lines[:, [X, Y]], grid.lines[:, [ALONG_X, ALONG_Y]]
    return np.stack((start, start + grid.lines[:, LENGTH, None] * along), axis=1)


def cell_middles(grid: EdgeGrid) -> tuple[Floats, Floats]:
    """X and y (cells,) of the cells' middles."""
    x = grid.x_low + (np.arange(grid.columns) + 0.5) / grid.per_length
    y = grid.y_low + (np.arange(grid.rows) + 0.5) / grid.per_length
    columns, rows = np.meshgrid(x, y)
    return columns.ravel(), rows.ravel()


def without_cells(grid: EdgeGrid, solid: NDArray[np.bool_]) -> EdgeGrid:
    """The grid, in which cells that no edge touches and that are `solid` (cells,) may hold nothing."""
    untouched = np.diff(grid.first) == 0
    return grid._replace(clearance=np.where(untouched & solid, -1.0, grid.clearance))


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
