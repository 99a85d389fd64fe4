"""Square cells for the search of neighbours, and particles sorted by them.

A cell is half the reach wide, so that whatever can reach a particle lies in the 25 cells about its
own. Particles sorted by cell, row by row, make those of neighbouring columns one contiguous run.

Where a side is periodic, cells divide the period, and a run that goes on beyond the side is cut in two:

        | . . . . t .|. .          the columns 2 .. 6 about t are the run 2 .. 5 and, shifted by a
          0 1 2 3 4 5 0 1          period to the right, the run 0 .. 0

Runs are copied with their shift, so that distances are those of the nearest images.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Interval = tuple[float, float]

# A cell of reach/2 needs two cells to each side.
CELLS_PER_REACH = 2

# Runs of a row: before the lower side, inside, beyond the upper side.
RUNS_OF_A_ROW = 3

# Columns of `Sources.records`, one record half a cache line; sums over pairs have the same width.
X, Y, C2, S2 = range(4)
RECORD = 4


class CellGrid(NamedTuple):
    """The cells of the neighbour search; positions beyond the rim count to the rim's cells.

    Attributes
    ----------
    x_low, y_low : float
    per_x, per_y : float
        Cells in a unit of length.
    columns, rows : int
        At least four of them in a period.
    period_x, period_y : float
        0 along an axis that is not periodic.
    """

    x_low: float
    y_low: float
    per_x: float
    per_y: float
    columns: int
    rows: int
    period_x: float
    period_y: float


class Sources(NamedTuple):
    """Particles sorted by cell: the ones of cell c are ``first[c] : first[c + 1]``.

    records : (n, 4) float64, x, y and cos, sin of 2 theta; first : (cells + 1,) int64.
    """

    records: Floats
    first: Integers


class Runs(NamedTuple):
    """Runs of the sorted particles: begin and end (n, 2) int64, shift along x and y (n, 2) float64."""

    ends: Integers
    shifts: Floats


def cell_grid(
    x_range: Interval,
    y_range: Interval,
    reach: float,
    periods: tuple[bool, bool] = (False, False),
) -> CellGrid:
    """The cells of size reach/2 that cover a rectangle; larger ones along axes that are periodic.

    periods : whether y and x are periodic, with periods of at least twice the reach.
    """
    per_x, columns, period_x = _cells_along(x_range, reach / CELLS_PER_REACH, periods[1])
    per_y, rows, period_y = _cells_along(y_range, reach / CELLS_PER_REACH, periods[0])
    return CellGrid(x_range[0], y_range[0], per_x, per_y, columns, rows, period_x, period_y)


def _cells_along(interval: Interval, size: float, wraps: bool) -> tuple[float, int, float]:
    """Cells in a unit of length, how many there are, and the period; each at least `size` wide."""
    width = interval[1] - interval[0]
    # Cells need not fit: the last one may go beyond the side.
    if not wraps:
        return 1.0 / size, max(1, int(np.ceil(width / size))), 0.0
    # Rounded down: a cell may be wider than half the reach, never narrower, or two of
    # them would not reach. Four at least, for a period is twice the reach.
    # The reach may be half the period to the last bit.
    count = int(np.floor(width / size * (1.0 + 1e-12)))
    return count / width, count, width


@inline_kernel
def _clamped(position: float, most: int) -> int:
    """The cell of `position`, in cells, within [0, most]; 0 for NaN."""
    # Comparisons, not min and max: they keep NaN from becoming an index.
    index = 0
    if position >= most:
        index = most
    elif position > 0.0:
        index = int(position)
    return index


@kernel
def cell_index(x: float, y: float, grid: CellGrid) -> int:
    """The cell of a position; clamping keeps neighbours neighbours, since it never stretches."""
    column = _clamped((x - grid.x_low) * grid.per_x, grid.columns - 1)
    row = _clamped((y - grid.y_low) * grid.per_y, grid.rows - 1)
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
    # `first` stays; where the next particle of each cell goes is counted in a copy.
    free = first[:-1].copy()
    for i in range(x.size):
        # Until here `rank` holds the cell, from here on where the particle went. In the order of
        # the particles, which makes it stable: sums over a cell have one order.
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
def new_runs(rows: int) -> Runs:
    """For `add_runs` of so many rows."""
    size = RUNS_OF_A_ROW * rows
    return Runs(np.empty((size, 2), np.int64), np.zeros((size, 2)))


@inline_kernel
def _put_run(runs: Runs, count: int, ends: tuple[int, int], shift: tuple[float, float]) -> int:
    """Append a run; returns how many there are then."""
    runs.ends[count, 0], runs.ends[count, 1] = ends
    runs.shifts[count, 0], runs.shifts[count, 1] = shift
    return count + 1


@inline_kernel
def add_runs(
    sources: Sources, row: int, columns: tuple[int, int], grid: CellGrid, runs: Runs, count: int
) -> int:
    """Append the runs of the columns from the first to the last one of a row; returns how many there are.

    row, columns : up to two of them beyond a side, where there are images or nothing.
    """
    low, high = columns
    up = 0.0
    if not 0 <= row < grid.rows:
        if grid.period_y == 0.0:
            return count
        # The row on the other side, a period further on.
        beyond = 1 if row >= grid.rows else -1
        row, up = row - beyond * grid.rows, beyond * grid.period_y
    first, width = sources.first, grid.columns
    start = row * width
    if grid.period_x > 0.0 and low < 0:
        # The last columns of the row, seen a period further left.
        ends = first[start + width + low], first[start + width]
        count = _put_run(runs, count, ends, (-grid.period_x, up))
    ends = first[start + max(low, 0)], first[start + min(high + 1, width)]
    count = _put_run(runs, count, ends, (0.0, up))
    if grid.period_x > 0.0 and high >= width:
        # Its first columns, seen a period further right.
        ends = first[start], first[start + high + 1 - width]
        count = _put_run(runs, count, ends, (grid.period_x, up))
    return count


@kernel
def copy_run(records: Floats, runs: Runs, r: int, buffer: Floats, count: int) -> int:
    """Append the records of run r, shifted, to buffer (4, n); returns how many it then holds."""
    begin, end = runs.ends[r, 0], runs.ends[r, 1]
    right, up = runs.shifts[r, 0], runs.shifts[r, 1]
    for j in range(begin, end):
        to = count + j - begin
        # From records, which are fetched by the half line, to components, which are read in vectors.
        buffer[X, to], buffer[Y, to] = records[j, X] + right, records[j, Y] + up
        buffer[C2, to], buffer[S2, to] = records[j, C2], records[j, S2]
    copied: int = count + end - begin
    return copied


@kernel
def gather(
    sources: Sources, column: int, row: int, grid: CellGrid, runs: Runs, buffer: Floats
) -> int:
    """Copy all sources that can reach a cell to buffer (4, n); returns how many.

    runs : those of five rows, overwritten
    """
    columns = column - CELLS_PER_REACH, column + CELLS_PER_REACH
    here = 0
    for r in range(row - CELLS_PER_REACH, row + CELLS_PER_REACH + 1):
        # Neighbouring columns of a row are one contiguous run of the sorted particles.
        here = add_runs(sources, r, columns, grid, runs, here)
    count = 0
    for r in range(here):
        count = copy_run(sources.records, runs, r, buffer, count)
    return count
