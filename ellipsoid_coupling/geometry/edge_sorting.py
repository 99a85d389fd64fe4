"""Edges sorted into the cells of an `EdgeGrid`, and the line that bounds those about each cell.

          o                  middle of a cell
          |
    ------x-------- LEVEL    the supporting line: it touches the edges at the nearest point, x, across the
      _--^ ^--_              way from there
     /         |

It bounds the edges within some rings of cells. Where some come higher than x, as at a corner of the fluid
or on an opposite wall, half as many rings are taken, until the line is a good one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.edge_grid import (
    ALONG_X,
    ALONG_Y,
    LENGTH,
    LEVEL,
    NORMAL_X,
    NORMAL_Y,
    REACH,
    SHIFTS,
    EdgeGrid,
    Vector,
    X,
    Y,
    column_of,
    row_of,
)

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# Last digits of the largest coordinate that ways end before an edge.
_GAP_DIGITS = 64.0
# Cells on the longer side of the domain: more for many edges, so that each cell holds few, and more for a
# long domain, so that there are some across it.
_FEWEST_CELLS, _MOST_CELLS, _EDGES_PER_CELL, _CELLS_ACROSS = 128, 1024, 4, 16
# Rings of cells that a supporting line may bound the edges of, and how far, in cells, they may come above
# the nearest one. Eight cells are the longest steps that are any use; a quarter of one loses few particles.
_MOST_RINGS, _SLACK = 8, 0.25


class Edges(NamedTuple):
    """Edges as they are handed to `edge_grid`; see `EdgeGrid` for the attributes."""

    ends: Floats
    shifts: Floats
    acts: Indices
    patches: Indices


def edge_grid(edges: Edges, x_range: tuple[float, float], y_range: tuple[float, float]) -> EdgeGrid:
    """Sort edges into the cells of a rectangle in which all particles are.

    Parameters
    ----------
    edges : Edges
        At least one of them in or at the rectangle.
    x_range, y_range : (low, high)
    """
    width, height = x_range[1] - x_range[0], y_range[1] - y_range[0]
    size = max(width, height) / _cells_wanted(len(edges.ends), width, height)
    largest = max(map(abs, (*x_range, *y_range)))
    gap = _GAP_DIGITS * float(np.finfo(np.float64).eps) * max(largest, width, height)
    columns, rows = (math.ceil(side / size) + 2 for side in (width, height))
    nobody = np.empty(0, np.int64)
    grid = EdgeGrid(
        lines=_lines(edges.ends, edges.acts, gap),
        shifts=edges.shifts,
        acts=edges.acts,
        patches=edges.patches,
        first=nobody,
        members=nobody,
        clearance=np.empty(0),
        supports=np.empty((0, 4)),
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
    return _with_bounds(grid._replace(first=first, members=members))


def _cells_wanted(edges: int, width: float, height: float) -> float:
    """Cells on the longer side."""
    longer, shorter = max(width, height), min(width, height)
    wanted = max(_FEWEST_CELLS, edges // _EDGES_PER_CELL, _CELLS_ACROSS * longer / shorter)
    return math.ceil(min(wanted, _MOST_CELLS))


def _lines(ends: Floats, acts: Indices, gap: float) -> Floats:
    way = ends[:, 1] - ends[:, 0]
    length = np.hypot(way[:, 0], way[:, 1])
    along = way / length[:, None]
    # Periodic sides meet exactly: a place there is one of the other side to the bit.
    gaps = np.where(acts == SHIFTS, 0.0, gap)
    return np.ascontiguousarray(np.column_stack((ends[:, 0], along, length, gaps)))


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


def _with_bounds(grid: EdgeGrid) -> EdgeGrid:
    """The grid with each cell's clearance and support."""
    untouched = np.diff(grid.first).reshape(grid.rows, grid.columns) == 0
    apart, (row, column) = ndimage.distance_transform_edt(untouched, return_indices=True)
    size, rim = 1.0 / grid.per_length, 4.0 * grid.margin
    # From rim to rim of the cells.
    clear = np.maximum(size * np.maximum(apart - math.sqrt(2.0), 0.0) - rim, 0.0).ravel()
    supports = np.zeros((clear.size, 4))
    supports[:, LEVEL], supports[:, REACH] = -np.inf, clear
    near = np.flatnonzero(apart <= _MOST_RINGS)
    nearest = (row.astype(np.int64) * grid.columns + column).ravel()
    _fill_supports(grid, near, nearest, supports)
    return grid._replace(clearance=clear, supports=supports)


@kernel
def _fill_supports(grid: EdgeGrid, near: Indices, nearest: Indices, supports: Floats) -> None:
    """Set the supports of the cells `near` (n,).

    nearest : (cells,), the nearest cell that an edge touches
    """
    size, rim = 1.0 / grid.per_length, 4.0 * grid.margin
    for cell in near:
        row, column = cell // grid.columns, cell % grid.columns
        middle = grid.x_low + (column + 0.5) * size, grid.y_low + (row + 0.5) * size
        normal, touched = _nearest_point(grid, nearest[cell], middle)
        level, rings = np.inf, 2 * _MOST_RINGS
        while level > touched + _SLACK * size and rings > 1:
            rings //= 2
            level = _highest(grid, row, column, rings, normal)
        reach = rings * size - rim
        if level <= touched + _SLACK * size and reach > supports[cell, REACH]:
            supports[cell, NORMAL_X], supports[cell, NORMAL_Y] = normal
            supports[cell, LEVEL], supports[cell, REACH] = level + rim, reach


@kernel
def _nearest_point(grid: EdgeGrid, cell: int, middle: Vector) -> tuple[Vector, float]:
    """The direction from the nearest point of a cell's edges to a place, and the point's height in it.

    An edge's own normal where the point is within the edge or hardly away; edges that face the place first.
    """
    size, least = 1.0 / grid.per_length, np.inf
    normal, height = (0.0, 0.0), 0.0
    for member in range(grid.first[cell], grid.first[cell + 1]):
        line = grid.lines[grid.members[member]]
        dx, dy = middle[0] - line[X], middle[1] - line[Y]
        along = line[ALONG_X] * dx + line[ALONG_Y] * dy
        faces = line[ALONG_X] * dy - line[ALONG_Y] * dx >= 0.0
        part = min(max(along, 0.0), line[LENGTH])
        point = line[X] + part * line[ALONG_X], line[Y] + part * line[ALONG_Y]
        to_x, to_y = middle[0] - point[0], middle[1] - point[1]
        away = math.hypot(to_x, to_y)
        if (away if faces else away + size) < least:
            least = away if faces else away + size
            normal = -line[ALONG_Y], line[ALONG_X]
            if part != along and faces and away > 0.5 * size:
                normal = to_x / away, to_y / away
            height = normal[0] * point[0] + normal[1] * point[1]
    return normal, height


@kernel
def _highest(grid: EdgeGrid, row: int, column: int, rings: int, normal: Vector) -> float:
    """The largest n . r on the edges within so many rings of cells around a cell; -inf without any."""
    size, level = 1.0 / grid.per_length, -np.inf
    # What of a long edge is farther than this from the cell's middle is out of reach.
    wide = (rings + 1.0) * math.sqrt(2.0) * size
    x, y = grid.x_low + (column + 0.5) * size, grid.y_low + (row + 0.5) * size
    for r in range(max(row - rings, 0), min(row + rings + 1, grid.rows)):
        for c in range(max(column - rings, 0), min(column + rings + 1, grid.columns)):
            cell = r * grid.columns + c
            for member in range(grid.first[cell], grid.first[cell + 1]):
                line = grid.lines[grid.members[member]]
                along = line[ALONG_X] * (x - line[X]) + line[ALONG_Y] * (y - line[Y])
                first, last = max(along - wide, 0.0), min(along + wide, line[LENGTH])
                if first <= last:
                    start = normal[0] * line[X] + normal[1] * line[Y]
                    climb = normal[0] * line[ALONG_X] + normal[1] * line[ALONG_Y]
                    level = max(level, start + max(first * climb, last * climb))
    return level
