"""The drift of one large cloud of particles, shared among threads.

    parts of particles    axes, fluid, outer potentials
    all                   sorted by cell
    blocks of rows        pair sums; those for the rows above a block are added afterwards
    parts of particles    the sums, brought back to the particles

Parts and blocks follow from the particles, not from the number of threads, and so do all bits.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.threads import chunk_ranges, for_each
from ellipsoid_coupling.compiled.tuning import CLOUD_TASKS, PARTICLES_PER_TASK
from ellipsoid_coupling.interaction.pairs.cells import RECORD, CellGrid, Sources, sort_into
from ellipsoid_coupling.interaction.pairs.pair_sum import (
    Pairs,
    RowSums,
    add_above,
    add_sums,
    sum_rows,
)
from ellipsoid_coupling.interaction.particle_forces import (
    Drift,
    own_forces,
    set_axes,
    still_frozen,
)

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.uint8]


class LargeCloud:
    """Sets the drift of a cloud of `number` particles; owns the memory that this needs.

    Parameters
    ----------
    drift : Drift
    number : int
    """

    def __init__(self, drift: Drift, number: int) -> None:
        # Everything but the pairs: it needs no neighbours, so that particles are cut into parts
        # freely.
        self._alone = drift._replace(pairs=None)
        self._axis = np.empty((2, number))
        self._parts = chunk_ranges(number, _tasks(number))
        self._sum = PairSum(drift.pairs, number) if drift.pairs is not None else None

    def set_forces(
        self, t: float, position: Floats, force: Floats, frozen: Flags | None = None
    ) -> None:
        """Overwrite the drift (1, D, N) at time t and `position`; see `particle_forces` for `frozen`."""

        def own(part: int) -> None:
            _part_forces(self._alone, t, position[0], self._axis, force[0], self._parts[part])

        for_each(len(self._parts), own)
        if self._sum is not None:
            self._add_pairs(self._sum, position[0], force[0], frozen)
        # Last, for fluid and potentials have pushed frozen ones as well.
        still_frozen(frozen, force[0])

    def _add_pairs(
        self, pair_sum: PairSum, position: Floats, force: Floats, frozen: Flags | None
    ) -> None:
        moving = None if frozen is None or not frozen.any() else np.flatnonzero(frozen == 0)
        if moving is None:
            pair_sum.add(position, self._axis, force)
        elif moving.size:
            # Frozen particles neither act nor are acted on: the sum runs over a copy of the others.
            some = np.zeros((len(force), moving.size))
            axis = np.ascontiguousarray(self._axis[:, moving])
            fewer = PairSum(pair_sum.pairs, moving.size)
            fewer.add(np.ascontiguousarray(position[:, moving]), axis, some)
            force[:, moving] += some


class PairSum:
    """The pair sums of `number` particles on all threads; `add_pair_forces` is its twin on one."""

    def __init__(self, pairs: Pairs, number: int) -> None:
        self.pairs = pairs
        cells = pairs.grid.columns * pairs.grid.rows
        self._sources = Sources(np.empty((number, RECORD)), np.empty(cells + 1, np.int64))
        self._rank = np.empty(number, np.int64)
        self._own = np.empty((number, RECORD))
        self._parts = chunk_ranges(number, _tasks(number))

    def add(self, position: Floats, axis: Floats, force: Floats) -> None:
        """Add the sums at positions (D, N) with axes (2, N) to the drift (D, N)."""
        pairs, sources, own, rank = self.pairs, self._sources, self._own, self._rank
        sort_into(position[0], position[1], axis[0], axis[1], pairs.grid, sources, rank)
        blocks = list(pairwise(row_blocks(sources, pairs.grid)))
        above: list[RowSums | None] = [None] * len(blocks)

        def block(k: int) -> None:
            above[k] = sum_rows(blocks[k], sources, pairs, own)

        for_each(len(blocks), block)
        # In the order of the blocks, whichever thread was first.
        for sums in above:
            if sums is not None:
                add_above(sums)
        for_each(len(self._parts), lambda k: _add_part(own, rank, pairs, force, self._parts[k]))


def _tasks(number: int) -> int:
    # By the number of particles alone, and not of threads: the order of sums follows from it.
    return min(CLOUD_TASKS, max(number // PARTICLES_PER_TASK, 1))


def row_blocks(sources: Sources, grid: CellGrid) -> list[int]:
    """Rows of cells at which blocks of about as many particles begin; the end is the last one.

    A block has two rows at least, so that what it adds to the rows above it belongs to the next one. The
    last block may have one, unless rows above it are the first ones.
    """
    # How many particles lie in the rows before each row.
    until = sources.first[:: grid.columns]
    # With a last block of one row, the two rows above the block before it would be the last and the first.
    last = grid.rows - (2 if grid.period_y > 0.0 else 1)
    number = int(until[-1])
    # Row numbers at which the running count of particles passes even parts of all.
    wanted = np.arange(1, _tasks(number)) * (number / _tasks(number))
    cuts = [0]
    for row in np.searchsorted(until, wanted):
        if row >= cuts[-1] + 2 and row <= last:
            cuts.append(int(row))
    return [*cuts, grid.rows]


@kernel
def _part_forces(
    drift: Drift, t: float, position: Floats, axis: Floats, force: Floats, part: tuple[int, int]
) -> None:
    """Axes and drift without pairs of the particles part[0] .. part[1] - 1."""
    set_axes(position, axis, part)
    own_forces(drift, t, position, axis, force, part)


@kernel
def _add_part(
    own: Floats, rank: Integers, pairs: Pairs, force: Floats, part: tuple[int, int]
) -> None:
    add_sums(own, rank[part[0] : part[1]], pairs, force[:, part[0] : part[1]])
