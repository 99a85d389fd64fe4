"""Square cells for the search of neighbours, and particles sorted by them.

A cell is half the reach wide, so that whatever can reach a particle lies in the 25 cells about its
own. Particles sorted by cell, row by row, make those of neighbouring columns one contiguous run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# A cell of reach/2 needs two cells to each side.
CELLS_PER_REACH = 2

# Columns of `Sources.records`, one record half a cache line; sums over pairs have the same width.
X, Y, C2, S2 = range(4)
RECORD = 4


class CellGrid(NamedTuple):
    """The cells of the neighbour search; positions beyond the rim count to the rim's cells."""

    x_low: float
    y_low: float
    inverse_size: float
    columns: int
    rows: int


class Sources(NamedTuple):
    """Particles sorted by cell: the ones of cell c are ``first[c] : first[c + 1]``.

    records : (n, 4) float64, x, y and cos, sin of 2 theta; first : (cells + 1,) int64.
    """

    records: Floats
    first: Integers


def cell_grid(x_range: tuple[float, float], y_range: tuple[float, float], reach: float) -> CellGrid:
    """The cells of size reach/2 that cover a rectangle."""
    size = reach / CELLS_PER_REACH
    columns = max(1, int(np.ceil((x_range[1] - x_range[0]) / size)))
    rows = max(1, int(np.ceil((y_range[1] - y_range[0]) / size)))
    return CellGrid(x_range[0], y_range[0], 1.0 / size, columns, rows)


@inline_kernel
def _clamped(place: float, most: int) -> int:
    """The cell of `place`, in cells, within [0, most]; 0 for NaN."""
    # Comparisons, not min and max: they keep NaN from becoming an index.
    index = 0
    if place >= most:
        index = most
    elif place > 0.0:
        index = int(place)
    return index


@kernel
def cell_index(x: float, y: float, grid: CellGrid) -> int:
    """The cell of a position; clamping keeps neighbours neighbours, since it never stretches."""
    column = _clamped((x - grid.x_low) * grid.inverse_size, grid.columns - 1)
    row = _clamped((y - grid.y_low) * grid.inverse_size, grid.rows - 1)
    return row * grid.columns + column


@kernel
def sort_into(
    x: Floats, y: Floats, c2: Floats, s2: Floats, grid: CellGrid, sources: Sources, rank: Integers
) -> None:
    """Counting sort by cell, stable; overwrites `sources` and where each particle went (n,)."""
    records, first = sources
    first[:] = 0
    # Count, running sum, place: two passes over the particles, and no comparison of them.
    for i in range(x.size):
        rank[i] = cell_index(x[i], y[i], grid)
        first[rank[i] + 1] += 1
    # first[c + 1] is the count of cell c; summed up it is where cell c + 1 begins.
    for c in range(first.size - 1):
        first[c + 1] += first[c]
    free = first[:-1].copy()
    for i in range(x.size):
        cell = rank[i]
        r = free[cell]
        free[cell] += 1
        rank[i] = r
        records[r, X], records[r, Y], records[r, C2], records[r, S2] = x[i], y[i], c2[i], s2[i]


@kernel
def sort_by_cell(
    x: Floats, y: Floats, c2: Floats, s2: Floats, grid: CellGrid
) -> tuple[Sources, Integers]:
    """`sort_into` new arrays; returns the sorted particles and where each went (n,)."""
    first = np.empty(grid.columns * grid.rows + 1, np.int64)
    sources = Sources(np.empty((x.size, RECORD)), first)
    rank = np.empty(x.size, np.int64)
    sort_into(x, y, c2, s2, grid, sources, rank)
    return sources, rank


@kernel
def copy_run(records: Floats, begin: int, end: int, buffer: Floats, count: int) -> int:
    """Append the records begin .. end - 1 to buffer (4, n); returns how many it then holds."""
    for j in range(begin, end):
        for k in range(RECORD):
            buffer[k, count + j - begin] = records[j, k]
    return count + end - begin


@kernel
def gather(sources: Sources, column: int, row: int, grid: CellGrid, buffer: Floats) -> int:
    """Copy all sources that can reach a cell to buffer (4, n); returns how many."""
    low = max(column - CELLS_PER_REACH, 0)
    high = min(column + CELLS_PER_REACH, grid.columns - 1)
    count = 0
    for r in range(max(row - CELLS_PER_REACH, 0), min(row + CELLS_PER_REACH, grid.rows - 1) + 1):
        # Neighbouring columns of a row are one contiguous run of the sorted particles.
        begin = sources.first[r * grid.columns + low]
        end = sources.first[r * grid.columns + high + 1]
        count = copy_run(sources.records, begin, end, buffer, count)
    return count
