"""The pair sum over particles with a cell list: every pair within reach is computed once.

A cell's particles meet each other and those of the cells after it in the sorted order, which are
three contiguous runs; the cells before it have already met it:

        +---+---+---+---+---+
        | 2 | 2 | 2 | 2 | 2 |     for all targets t of one cell the runs 0, 1, 2 are copied to one
        +---+---+---+---+---+     buffer, t first, and a second buffer collects what they feel;
        | 1 | 1 | 1 | 1 | 1 |     target k then meets all that stands behind it: a straight loop
        +---+---+---+---+---+     over contiguous arrays, which vectorises
        |   |   | t | 0 | 0 |
        +---+---+---+---+---+

Beyond a periodic side the runs go on at the other one (`cells`): a pair across it is met once as well.

A block of rows writes its sums for the two rows above it to memory of its own (`RowSums.above`), so that
blocks can run side by side. The order of summation follows from the cells and the blocks alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.compiled.simd_vectors import DOUBLES
from ellipsoid_coupling.interaction.pairs.cells import (
    C2,
    CELLS_PER_REACH,
    RECORD,
    S2,
    CellGrid,
    Runs,
    Sources,
    X,
    Y,
    add_runs,
    copy_run,
    gather,
    new_runs,
    sort_by_cell,
)
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, pair_terms

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Pairs(NamedTuple):
    """Parameters of the pair sum: force per mass and torque per inertia are `*_weight` times U's.

    `torque_weight` is None for circles, `ghosts` is None without walls: neither is then compiled.
    """

    grid: CellGrid
    shape: PotentialShape
    force_weight: float
    torque_weight: float | None
    ghosts: Sources | None
    ghost_factor: float


class RowSums(NamedTuple):
    """Sums of dU/dx, dU/dy, dU/dtheta (over eps0) in the order of the sorted particles.

    own : (n, 4) float64, of all particles, the last column unused; a block writes its own rows'.
    above : (m, 4), of the m particles from `start` on, in the two rows above a block: the first
        two of all, where the block ends at a periodic side.
    start : int
    """

    own: Floats
    above: Floats
    start: int


@kernel
def sum_in_lanes(values: Floats) -> float:
    """The sum of whole vectors in eight interleaved parts, in a fixed order.

    One running sum would wait for each addition, and a compiler that may reorder it may round
    differently each time.
    """
    # Eight sums, as wide as the widest vector.
    s0, s1, s2, s3, s4, s5, s6, s7 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(0, values.size - values.size % 8, 8):
        s0 += values[j]
        s1 += values[j + 1]
        s2 += values[j + 2]
        s3 += values[j + 3]
        s4 += values[j + 4]
        s5 += values[j + 5]
        s6 += values[j + 6]
        s7 += values[j + 7]
    # By halves, as a vector is folded: always in this order.
    return ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))


@kernel
def scratch(sources: Sources, grid: CellGrid) -> tuple[Floats, Floats, Runs]:
    """For `gather` and `sum_over_sources`: a buffer (4, m) of sources, their gradients (3, m), and runs."""
    # Of four cells in a period one is met from both sides: 5/4 of all particles, or 25/16.
    copies = 1 if grid.period_x == 0.0 and grid.period_y == 0.0 else 2
    # Loops go on to the end of a vector.
    size = copies * sources.records.shape[0] + DOUBLES
    return np.zeros((RECORD, size)), np.empty((3, size)), new_runs(2 * CELLS_PER_REACH + 1)


@kernel(noalias=True)
def _feel(
    target: tuple[float, float, float, float],
    others: Rows,
    given: Rows,
    count: int,
    shape: PotentialShape,
) -> None:
    """Gradients of U between the target and `count` others: `given`, then 0 to the end of a vector."""
    x, y, c2, s2 = target
    for j in range(round_up_to_vectors(count)):
        other = load(others, j)
        # delta of `eq:interaction` leads from the target to the other one.
        _, by_x, by_y, by_theta = pair_potential(
            other[X] - x, other[Y] - y, c2, s2, other[C2], other[S2], shape
        )
        # Masked instead of a remainder loop; beyond `count` the buffer holds old numbers.
        met = j < count
        store(given, j, (by_x if met else 0.0, by_y if met else 0.0, by_theta if met else 0.0))


@kernel
def sum_over_sources(
    target: tuple[float, float, float, float],
    buffer: Floats,
    count: int,
    given: Floats,
    shape: PotentialShape,
) -> tuple[float, float, float]:
    """Sum of dU/dx, dU/dy, dU/dtheta (over eps0) of one target (x, y, c2, s2) with the buffer.

    buffer, given : see `scratch`.
    """
    end = round_up_to_vectors(count)
    _feel(target, rows_at(buffer, (X, Y, C2, S2), 0), rows_at(given, (0, 1, 2), 0), count, shape)
    return sum_in_lanes(given[0, :end]), sum_in_lanes(given[1, :end]), sum_in_lanes(given[2, :end])


@kernel(noalias=True)
def _meet(
    target: tuple[float, float, float, float],
    others: Rows,
    felt: Rows,
    given: Rows,
    count: int,
    shape: PotentialShape,
) -> None:
    """Gradients of U between the target and `count` others, and, added to `felt`, of the others in turn.

    given : (dU/dx, dU/dy, dU/dtheta), 0 from `count` to the end of a vector.
    """
    x, y, c2, s2 = target
    for j in range(round_up_to_vectors(count)):
        other, before = load(others, j), load(felt, j)
        _, by_x, by_y, by_theta, slope_bar = pair_terms(
            other[X] - x, other[Y] - y, c2, s2, other[C2], other[S2], shape
        )
        met = j < count
        by_x, by_y = by_x if met else 0.0, by_y if met else 0.0
        by_theta, slope_bar = by_theta if met else 0.0, slope_bar if met else 0.0
        store(given, j, (by_x, by_y, by_theta))
        # Forces are opposite, torques are not: each angle has a slope of its own.
        store(felt, j, (before[0] - by_x, before[1] - by_y, before[2] + slope_bar))


@kernel
def _meet_the_rest(
    t: int, count: int, buffer: Floats, felt: Floats, given: Floats, shape: PotentialShape
) -> None:
    """Pairs of the buffer's particle t with those behind it, up to `count`."""
    # Each pair once: a target meets those behind it.
    rest = t + 1
    end = round_up_to_vectors(count - rest)
    _meet(
        (buffer[X, t], buffer[Y, t], buffer[C2, t], buffer[S2, t]),
        rows_at(buffer, (X, Y, C2, S2), rest),
        rows_at(felt, (0, 1, 2), rest),
        rows_at(given, (0, 1, 2), 0),
        count - rest,
        shape,
    )
    # To the gradients that pairs with particles before the target have added already.
    for k in range(3):
        felt[k, t] += sum_in_lanes(given[k, :end])


@kernel
def _set_runs(
    cell: int, row: int, above: int, sources: Sources, grid: CellGrid, runs: Runs
) -> tuple[int, int]:
    """Set the runs of a cell's picture above; how many lie in the rows before `above`, and in all."""
    column = cell - row * grid.columns
    low, high = column - CELLS_PER_REACH, column + CELLS_PER_REACH
    count, below = 0, 0
    for r in range(row, row + CELLS_PER_REACH + 1):
        # In its own row a cell meets itself and what is behind it; the others have met it already.
        columns = column if r == row else low, high
        count = add_runs(sources, r, columns, grid, runs, count)
        # Runs of the block's own rows come first, so that one number parts them from those above.
        below = count if r < above else below
    return below, count


@kernel
def _longest_buffer(rows: tuple[int, int], sources: Sources, grid: CellGrid) -> int:
    """As many particles as the runs of any cell in a block hold at most."""
    first, width = sources.first, grid.columns
    most = 0
    # Three whole rows: a bound that takes no look at each cell, and memory that is not used costs nothing.
    for row in range(rows[0], rows[1]):
        end = row + CELLS_PER_REACH + 1
        count = first[min(end, grid.rows) * width] - first[row * width]
        if grid.period_y > 0.0 and end > grid.rows:
            count += first[(end - grid.rows) * width]
        most = max(most, count)
    # Of four cells in a period one is met from both sides.
    return most if grid.period_x == 0.0 else 2 * most


@kernel
def _add_felt(
    felt: Floats, runs: Runs, which: tuple[int, int], count: int, out: Floats, start: int
) -> int:
    """Add felt (3, n) from `count` on to the particles of some runs in out, which is from `start`."""
    for r in range(which[0], which[1]):
        begin, end = runs.ends[r, 0], runs.ends[r, 1]
        for j in range(begin, end):
            for k in range(3):
                out[j - start, k] += felt[k, count + j - begin]
        count += end - begin
    return count


@kernel
def _add_cell(
    cell: int,
    row: int,
    above: int,
    sources: Sources,
    pairs: Pairs,
    work: tuple[Floats, Floats, Floats, Runs],
    sums: RowSums,
) -> None:
    """All pairs of a cell's particles with each other and those behind them.

    above : the row that follows the block
    """
    buffer, felt, given, runs = work
    # The cell's own particles come first in the first run.
    below, here = _set_runs(cell, row, above, sources, pairs.grid, runs)
    count = 0
    for r in range(here):
        count = copy_run(sources.records, runs, r, buffer, count)
    for k in range(3):
        for j in range(count):
            # No more than the runs hold: memory is as long as the longest of all cells.
            felt[k, j] = 0.0
    # In the buffer the cell's own particles are the first ones.
    for t in range(sources.first[cell + 1] - sources.first[cell]):
        _meet_the_rest(t, count, buffer, felt, given, pairs.shape)
    # Runs in the rows above the block go to memory of their own: another block owns those particles.
    count = _add_felt(felt, runs, (0, below), 0, sums.own, 0)
    _add_felt(felt, runs, (below, here), count, sums.above, sums.start)


@kernel
def _add_ghosts(
    ghosts: Sources | None,
    cell: int,
    row: int,
    sources: Sources,
    pairs: Pairs,
    work: tuple[Floats, Floats, Runs] | None,
    sums: RowSums,
) -> None:
    """Add the sums over the walls' ghosts to those of a cell's particles."""
    if ghosts is not None and work is not None:
        buffer, given, runs = work
        count = gather(ghosts, cell - row * pairs.grid.columns, row, pairs.grid, runs, buffer)
        # Away from the walls there is no ghost to feel.
        for t in range(sources.first[cell], sources.first[cell + 1] if count > 0 else 0):
            x, y, c2, s2 = sources.records[t]
            found = sum_over_sources((x, y, c2, s2), buffer, count, given, pairs.shape)
            for k in range(3):
                sums.own[t, k] += pairs.ghost_factor * found[k]


@kernel
def _ghost_work(ghosts: Sources | None, grid: CellGrid) -> tuple[Floats, Floats, Runs] | None:
    # What is returned has the type of None then, so that the compiler leaves all of it out.
    if ghosts is None:
        return None
    return scratch(ghosts, grid)


@kernel
def _sums_above(above: int, sources: Sources, grid: CellGrid, own: Floats) -> RowSums:
    """The sums, still 0, of a block that the row `above` follows."""
    first = sources.first
    # Above the last row stand the first ones again, or nothing.
    if above == grid.rows and grid.period_y > 0.0:
        above = 0
    start = first[above * grid.columns]
    end = first[min(above + CELLS_PER_REACH, grid.rows) * grid.columns]
    return RowSums(own, np.zeros((end - start, RECORD)), start)


@kernel
def sum_rows(rows: tuple[int, int], sources: Sources, pairs: Pairs, own: Floats) -> RowSums:
    """The sums over all pairs whose first particle lies in rows[0] .. rows[1] - 1, and over ghosts.

    Parameters
    ----------
    rows : (int, int)
        At least two rows of cells, or the last one, where y is not periodic.
    sources : Sources
    pairs : Pairs
    own : (n, 4) float64
        The rows' part is overwritten.
    """
    grid, first, above = pairs.grid, sources.first, rows[1]
    own[first[rows[0] * grid.columns] : first[above * grid.columns]] = 0.0
    sums = _sums_above(above, sources, grid, own)
    # Three rows: the cell's own, and two above it.
    runs = new_runs(CELLS_PER_REACH + 1)
    # Loops go on to the end of a vector.
    most = _longest_buffer(rows, sources, grid) + DOUBLES
    work = np.zeros((RECORD, most)), np.zeros((3, most)), np.empty((3, most)), runs
    ghost_work = _ghost_work(pairs.ghosts, grid)
    for row in range(rows[0], rows[1]):
        for cell in range(row * grid.columns, (row + 1) * grid.columns):
            # Empty cells have nobody who meets or feels.
            if first[cell] < first[cell + 1]:
                _add_cell(cell, row, above, sources, pairs, work, sums)
                _add_ghosts(pairs.ghosts, cell, row, sources, pairs, ghost_work, sums)
    return sums


@kernel
def add_above(sums: RowSums) -> None:
    """Add a block's sums for the rows above it to those of their particles."""
    for j in range(sums.above.shape[0]):
        for k in range(3):
            sums.own[sums.start + j, k] += sums.above[j, k]


@kernel
def _add_torques(own: Floats, rank: Integers, weight: float | None, force: Floats) -> None:
    # A function of its own: numba leaves out what stands behind `is not None` for arguments only.
    if weight is not None:
        for i in range(rank.size):
            force[2, i] -= weight * own[rank[i], 2]


@kernel
def add_sums(own: Floats, rank: Integers, pairs: Pairs, force: Floats) -> None:
    """Add -grad U and -dU/dtheta from the sorted sums (n, 4) to the drift (D, N) of the particles."""
    for i in range(rank.size):
        # The force is minus the gradient; sums stand in the order of the cells.
        force[0, i] -= pairs.force_weight * own[rank[i], 0]
        force[1, i] -= pairs.force_weight * own[rank[i], 1]
    _add_torques(own, rank, pairs.torque_weight, force)


@kernel
def add_pair_forces(position: Floats, axis: Floats, pairs: Pairs, force: Floats) -> None:
    """Add the sums over -grad U of `eq:micro` to the drift of all particles of one realisation.

    Parameters
    ----------
    position : (D, N) float64
        x, y (and angle, not read here).
    axis : (2, N)
        cos and sin of 2 theta.
    pairs : Pairs
    force : (D, N)
        Per mass and per inertia; added to in place.
    """
    sources, rank = sort_by_cell(position[0], position[1], axis[0], axis[1], pairs.grid)
    own = np.empty((rank.size, RECORD))
    # All pairs are met; above the last row there is something where y is periodic.
    add_above(sum_rows((0, pairs.grid.rows), sources, pairs, own))
    add_sums(own, rank, pairs, force)
