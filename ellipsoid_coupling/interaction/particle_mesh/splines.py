"""Samples to nodes and back by cubic B-splines: the compiled part of `forces`.

Samples are sorted by row and cut into equal parts, each of which deposits into its own window of rows;
the windows are added up in a fixed order, so that any number of threads gives the same bits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.simd_stencils import add_stencil, sum_stencil
from ellipsoid_coupling.compiled.threads import chunk_ranges, for_each
from ellipsoid_coupling.compiled.tuning import (
    DEPOSIT_WINDOWS,
    LEAST_DEPOSITED,
    LEAST_INTERPOLATED,
    LEAST_SORTED,
    SAMPLE_PARTS,
    SAMPLES_AT_ONCE,
)
from ellipsoid_coupling.interaction.convolution.spectra import Indices, Real
from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.physics.bspline import spline_slopes, spline_weights
from ellipsoid_coupling.physics.elementary import cos_sin

# Nodes about a point in each direction.
STENCIL = 4


class Nodes(NamedTuple):
    """Where the nodes are: node (row, column) at (x_low + column h, y_low + row h)."""

    x_low: float
    y_low: float
    inverse_h: float
    rows: int
    columns: int


@kernel
def _first_node(coordinate: float, low: float, inverse_h: float, count: int) -> int:
    """The first of the four nodes about a coordinate; -1 if they are not all there."""
    node = math.floor((coordinate - low) * inverse_h) - 1.0
    # Compared before it becomes an integer: NaN, and what no integer holds, lie nowhere.
    if not 0.0 <= node <= count - STENCIL:
        return -1
    return int(node)


@kernel
def _count_rows(
    position: Array,
    blocks: tuple[int, int],
    nodes: Nodes,
    slots: Indices,
    counts: Indices,
    columns: Indices,
) -> None:
    """Write each sample's first row of nodes to `slots`, -1 beyond the nodes, and count them.

    columns : (2,), overwritten by the least and the largest first column.
    """
    size = position.shape[2]
    least, largest = nodes.columns, -1
    for k in range(blocks[0], blocks[1]):
        for j in range(size):
            row = _first_node(position[k, 1, j], nodes.y_low, nodes.inverse_h, nodes.rows)
            column = _first_node(position[k, 0, j], nodes.x_low, nodes.inverse_h, nodes.columns)
            row = row if column >= 0 else -1
            slots[k * size + j] = row
            if row >= 0:
                counts[row] += 1
                least, largest = min(least, column), max(largest, column)
    columns[0], columns[1] = least, largest


@kernel
def _fill_slots(
    position: Array, blocks: tuple[int, int], slots: Indices, counts: Indices, samples: Array
) -> None:
    """Copy each sample to the next free place of its row, which is also written to `slots`."""
    size = position.shape[2]
    for k in range(blocks[0], blocks[1]):
        for j in range(size):
            row = slots[k * size + j]
            if row >= 0:
                # Here `counts` holds where the part's share of each row begins, see `_set_starts`.
                slot = counts[row]
                counts[row] += 1
                slots[k * size + j] = slot
                for d in range(position.shape[1]):
                    samples[slot, d] = position[k, d, j]


@kernel
def _set_starts(counts: Indices) -> Indices:
    """Turn counts (parts, rows) into where each part's share of each row begins; (rows + 1,)."""
    parts, rows = counts.shape
    begin = np.zeros(rows + 1, np.int64)
    for row in range(rows):
        begin[row + 1] = begin[row]
        for part in range(parts):
            # The parts in their order within each row: where a sample goes does not depend on threads.
            count = counts[part, row]
            counts[part, row] = begin[row + 1]
            begin[row + 1] += count
    return begin


class Sorted(NamedTuple):
    """Copies of the samples within the nodes, sorted by the first row of their nodes.

    samples : (n, D) float64
    begin : (rows + 1,) int64, where the samples of each row begin
    corner : the first row and the first column of nodes that any sample's stencil has
    extent : how many rows and columns all stencils have; (0, 0) without samples
    """

    samples: Array
    begin: Indices
    corner: tuple[int, int]
    extent: tuple[int, int]


def sort_by_row(position: Array, nodes: Nodes, slots: Indices, pool: BufferPool) -> Sorted:
    """Sort the samples by row, without those beyond the nodes.

    A stable counting sort: work in either order goes through memory row by row.

    Parameters
    ----------
    position : (K, D, B) float64
    slots : (K B,) int64
        Overwritten: where sample j of block k, number k B + j, stands; -1 beyond the nodes.
    pool : holds the sorted samples until the next call
    """
    blocks = chunk_ranges(len(position), min(SAMPLE_PARTS, slots.size // LEAST_SORTED))
    # Each part counts and then fills for itself: no two threads write to one place.
    counts = np.zeros((len(blocks), nodes.rows), np.int64)
    columns = np.empty((len(blocks), 2), np.int64)
    for_each(
        len(blocks), lambda k: _count_rows(position, blocks[k], nodes, slots, counts[k], columns[k])
    )
    begin: Indices = _set_starts(counts)
    samples = pool.array("samples", (begin[-1], position.shape[1]), np.float64)
    for_each(len(blocks), lambda k: _fill_slots(position, blocks[k], slots, counts[k], samples))
    rows = np.flatnonzero(np.diff(begin))
    if rows.size == 0:
        return Sorted(samples, begin, (0, 0), (0, 0))
    corner = int(rows[0]), int(columns[:, 0].min())
    last = int(rows[-1]), int(columns[:, 1].max())
    return Sorted(
        samples, begin, corner, (last[0] - corner[0] + STENCIL, last[1] - corner[1] + STENCIL)
    )


def add_to(force: Array, found: Array, weights: tuple[float, float], slots: Indices) -> None:
    """Add forces `found`, (n, components) in sorted order, to the samples' drift (K, D, B)."""
    blocks = chunk_ranges(len(force), min(SAMPLE_PARTS, slots.size // LEAST_SORTED))
    for_each(len(blocks), lambda k: _add_some(force, found, weights, slots, blocks[k]))


@kernel
def _add_some(
    force: Array,
    found: Array,
    weights: tuple[float, float],
    slots: Indices,
    blocks: tuple[int, int],
) -> None:
    size = force.shape[2]
    for k in range(blocks[0], blocks[1]):
        for c in range(min(found.shape[1], force.shape[1])):
            # 1/I_c for the torque, 1/m for both forces.
            weight = weights[1] if c == 2 else weights[0]
            for j in range(size):
                slot = slots[k * size + j]
                if slot >= 0:
                    force[k, c, j] += weight * found[slot, c]


@kernel(noalias=True)
def _set_bases(samples: Array, functions: int, waves: Array, bases: Array) -> None:
    """Write b_p of every sample's angle, and db_p/dtheta unless `bases` has one row only.

    Samples without an angle have the angle 0.

    waves : (2, n or more), scratch
    bases : (n or more, 1 or 2, 2M + 1 or more)
    """
    # Its slope is 0, which the second row holds from the beginning.
    bases[: samples.shape[0], 0, 0] = 1.0
    if functions == 1:
        return
    cosines, sines = waves[0], waves[1]
    # For all samples first, in a loop that vectorises; the recurrences below do not.
    for i in range(samples.shape[0]):
        cosines[i], sines[i] = cos_sin(2.0 * samples[i, 2]) if samples.shape[1] == 3 else (1.0, 0.0)
    last = functions // 2
    for i in range(samples.shape[0]):
        c2, s2 = cosines[i], sines[i]
        # Two recurrences side by side, of odd and of even multiples: each product waits for the one
        # before it.
        c4, s4 = c2 * c2 - s2 * s2, 2.0 * s2 * c2
        cosine, sine, even_cosine, even_sine = c2, s2, c4, s4
        # Of a single row `slopes` is the basis itself, and is not written.
        basis, slopes = bases[i, 0], bases[i, bases.shape[1] - 1]
        for m in range(1, last, 2):
            basis[2 * m - 1], basis[2 * m] = cosine, sine
            basis[2 * m + 1], basis[2 * m + 2] = even_cosine, even_sine
            if bases.shape[1] == 2:
                low, high = 2.0 * m, 2.0 * m + 2.0
                slopes[2 * m - 1], slopes[2 * m] = -low * sine, low * cosine
                slopes[2 * m + 1], slopes[2 * m + 2] = -high * even_sine, high * even_cosine
            cosine, sine = cosine * c4 - sine * s4, sine * c4 + cosine * s4
            even_cosine, even_sine = (
                even_cosine * c4 - even_sine * s4,
                even_sine * c4 + even_cosine * s4,
            )
        # The loop takes harmonics by twos.
        if last % 2 == 1:
            basis[2 * last - 1], basis[2 * last] = cosine, sine
            if bases.shape[1] == 2:
                slopes[2 * last - 1], slopes[2 * last] = -2.0 * last * sine, 2.0 * last * cosine


@inline_kernel
def _position(x: float, y: float, nodes: Nodes) -> tuple[int, int, float, float]:
    """First row and column of a sample's four by four nodes, and how far it is beyond the second."""
    across = (x - nodes.x_low) * nodes.inverse_h
    up = (y - nodes.y_low) * nodes.inverse_h
    column, row = math.floor(across), math.floor(up)
    return int(row) - 1, int(column) - 1, up - row, across - column


class Windows(NamedTuple):
    """The rows of nodes that each part of the samples writes to, one part's after the other's.

    parts : (parts + 1,) int64, where each part of the samples begins
    first : (parts,), the first row of its window
    offsets : (parts + 1,), where its window begins among all windows' rows
    """

    parts: Indices
    first: Indices
    offsets: Indices


def windows_of(begin: Indices) -> Windows:
    """Equal parts of the samples whose rows begin there, and the windows they deposit into."""
    # Equal numbers of samples, not of rows: clouds are denser in the middle.
    count = max(1, min(DEPOSIT_WINDOWS, int(begin[-1]) // LEAST_DEPOSITED))
    parts = np.linspace(0, begin[-1], count + 1).astype(np.int64)
    # Of rows that begin at one sample only the last one holds it: the others are empty.
    first, last = (
        np.searchsorted(begin, ends, "right") - 1 for ends in (parts[:-1], parts[1:] - 1)
    )
    # A window has the rows that its samples' stencils reach.
    used = np.where(parts[1:] > parts[:-1], last - first + STENCIL, 0)
    return Windows(parts, first, np.concatenate([[0], np.cumsum(used)]))


def deposit(here: Sorted, nodes: Nodes, functions: int, mass: float, pool: BufferPool) -> Array:
    """s_q at the nodes of all stencils, (functions, *here.extent); in `pool`.

    Each part of the samples deposits into its own rows; these are added up in the order of the parts.
    """
    samples, begin, corner, extent = here
    windows = windows_of(begin)
    parts, first, offsets = windows
    shape = int(offsets[-1]), extent[1], round_up_to_vectors(functions)
    partial = pool.array("windows", shape, np.float64)

    def put(k: int) -> None:
        window = partial[offsets[k] : offsets[k + 1]]
        # Rows count from the window's first, columns from the first of all stencils.
        some, at = samples[parts[k] : parts[k + 1]], (int(first[k]), corner[1])
        # Zeros, and they stay: functions that only fill the last vector.
        work = np.empty((2, SAMPLES_AT_ONCE)), np.zeros((SAMPLES_AT_ONCE, 1, window.shape[2]))
        _deposit(some, at, nodes, functions, work, window)

    for_each(first.size, put)
    sources = pool.array("sources", (functions, *extent), np.float64)
    rows = chunk_ranges(extent[0], first.size)
    for_each(len(rows), lambda k: _add_windows(partial, windows, mass, corner[0], rows[k], sources))
    return sources


@kernel(noalias=True)
def _deposit(
    samples: Array,
    corner: tuple[int, int],
    nodes: Nodes,
    functions: int,
    work: tuple[Array, Array],
    window: Array,
) -> None:
    waves, bases = work
    window[:] = 0.0
    for begin in range(0, samples.shape[0], SAMPLES_AT_ONCE):
        some = samples[begin : begin + SAMPLES_AT_ONCE]
        _set_bases(some, functions, waves, bases)
        for i in range(some.shape[0]):
            row, column, up, across = _position(some[i, 0], some[i, 1], nodes)
            along_y, along_x = spline_weights(up), spline_weights(across)
            at = row - corner[0], column - corner[1]
            add_stencil(window, at, along_y, along_x, bases[i, 0])


@kernel
def _add_windows(
    partial: Array,
    windows: Windows,
    scale: float,
    first_row: int,
    rows: tuple[int, int],
    sources: Array,
) -> None:
    """Add up the windows' rows, counted from the first one of all; functions come to the front."""
    _, first, offsets = windows
    # Nodes are interleaved by function in the windows; transforms want one field a function.
    total = np.empty(partial.shape[1:])
    for row in range(rows[0], rows[1]):
        total[:] = 0.0
        for part in range(first.size):
            # Sums count from the first of all stencils, a window from its own first row.
            at = first_row + row - first[part]
            if 0 <= at < offsets[part + 1] - offsets[part]:
                # In the order of the parts, whichever was there first.
                total += partial[offsets[part] + at]
        for p in range(sources.shape[0]):
            for column in range(sources.shape[2]):
                sources[p, row, column] = scale * total[column, p]


def interpolate(
    samples: Array,
    nodes: Nodes,
    corner: tuple[int, int],
    potential: Real,
    functions: int,
    pool: BufferPool,
) -> Array:
    """Minus the slopes of sum_p b_p(theta) U_p(r) along x, y and theta at the samples: (n, D).

    potential : (rows, columns, `whole_vectors` of functions)
        U_p at a part of the nodes, from row and column `corner` on.
    pool : holds the result until the next call
    """
    found = pool.array("found", samples.shape, np.float64)
    parts = chunk_ranges(len(samples), min(SAMPLE_PARTS, len(samples) // LEAST_INTERPOLATED))

    def read(k: int) -> None:
        some = slice(*parts[k])
        # As in `deposit`; the second row is for the slopes in the angle.
        bases = np.zeros((SAMPLES_AT_ONCE, 2, potential.shape[2]))
        work = np.empty((2, SAMPLES_AT_ONCE)), bases
        _interpolate_some(samples[some], nodes, corner, potential, functions, work, found[some])

    for_each(len(parts), read)
    return found


@kernel(noalias=True)
def _interpolate_some(
    samples: Array,
    nodes: Nodes,
    corner: tuple[int, int],
    potential: Real,
    functions: int,
    work: tuple[Array, Array],
    found: Array,
) -> None:
    waves, bases = work
    for begin in range(0, samples.shape[0], SAMPLES_AT_ONCE):
        some, slopes = (
            samples[begin : begin + SAMPLES_AT_ONCE],
            found[begin : begin + SAMPLES_AT_ONCE],
        )
        _set_bases(some, functions, waves, bases)
        for i in range(some.shape[0]):
            row, column, up, across = _position(some[i, 0], some[i, 1], nodes)
            along_y = spline_weights(up), spline_slopes(up)
            along_x = spline_weights(across), spline_slopes(across)
            # Whole numbers are counted from the corner: rounding in x and y could lead beyond it.
            at = row - corner[0], column - corner[1]
            x, y, turn = sum_stencil(potential, at, along_y, along_x, bases[i])
            # The spline's slopes are per node.
            slopes[i, 0], slopes[i, 1] = -nodes.inverse_h * x, -nodes.inverse_h * y
            if slopes.shape[1] == 3:
                slopes[i, 2] = -turn
