"""Samples to nodes and back by cubic B-splines: the compiled part of `sample_forces`.

Samples are sorted by row and dealt out in equal parts, each of which deposits into a window of its
own; the windows are added up in a fixed order, so that any number of threads gives the same bits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.interaction.spectra import Indices, Real
from ellipsoid_coupling.kernels import for_each, inline_kernel, kernel, shares, view_kernel
from ellipsoid_coupling.physics.elementary import cos_sin

# Nodes about a point in each direction.
STENCIL = 4
# Samples are dealt out in this many parts at most, whatever the number of threads, ...
PARTS = 32
# ... of so many at least: to wake a thread takes as long as to sort or to spread those.
_LEAST_SORTED, _LEAST_SPREAD = 20_000, 2_500
# Numbers in a vector of the processor.
_LANES = 8


def padded(functions: int) -> int:
    """So many numbers a node: loops over them have no odd ends."""
    return -(-functions // _LANES) * _LANES


class Nodes(NamedTuple):
    """Where the nodes are: node (row, column) at (x_low + column h, y_low + row h)."""

    x_low: float
    y_low: float
    inverse_h: float
    rows: int
    columns: int


@inline_kernel
def _spline_weights(t: float) -> tuple[float, float, float, float]:
    """B at the four nodes about a point, t in [0, 1) after the second."""
    s = 1.0 - t
    return (
        s * s * s / 6.0,
        2.0 / 3.0 - t * t * (1.0 - 0.5 * t),
        2.0 / 3.0 - s * s * (1.0 - 0.5 * s),
        t * t * t / 6.0,
    )


@kernel
def _first_node(coordinate: float, low: float, inverse_h: float, count: int) -> int:
    """The first of the four nodes about a coordinate; -1 if they are not all there."""
    node = math.floor((coordinate - low) * inverse_h) - 1.0
    if not 0.0 <= node <= count - STENCIL:
        return -1
    return int(node)


@kernel
def _count_rows(
    place: Array, blocks: tuple[int, int], nodes: Nodes, slots: Indices, counts: Indices
) -> None:
    """Write each sample's first row of nodes to `slots`, -1 beyond the nodes, and count them."""
    size = place.shape[2]
    for k in range(blocks[0], blocks[1]):
        for j in range(size):
            row = _first_node(place[k, 1, j], nodes.y_low, nodes.inverse_h, nodes.rows)
            column = _first_node(place[k, 0, j], nodes.x_low, nodes.inverse_h, nodes.columns)
            row = row if column >= 0 else -1
            slots[k * size + j] = row
            if row >= 0:
                counts[row] += 1


@kernel
def _fill_slots(
    place: Array, blocks: tuple[int, int], slots: Indices, counts: Indices, samples: Array
) -> None:
    """Put every sample where its row's next one belongs; `slots` tells where that is."""
    size = place.shape[2]
    for k in range(blocks[0], blocks[1]):
        for j in range(size):
            row = slots[k * size + j]
            if row >= 0:
                slot = counts[row]
                counts[row] += 1
                slots[k * size + j] = slot
                for d in range(place.shape[1]):
                    samples[slot, d] = place[k, d, j]


@kernel
def _set_starts(counts: Indices) -> Indices:
    """Turn counts (parts, rows) into where each part's share of each row begins; (rows + 1,)."""
    parts, rows = counts.shape
    begin = np.zeros(rows + 1, np.int64)
    for row in range(rows):
        begin[row + 1] = begin[row]
        for part in range(parts):
            count = counts[part, row]
            counts[part, row] = begin[row + 1]
            begin[row + 1] += count
    return begin


def sort_by_row(place: Array, nodes: Nodes, slots: Indices) -> tuple[Array, Indices]:
    """Copies of the samples within the nodes, sorted by the first row of their nodes.

    A stable counting sort, so that whatever is done in this order, and what follows in the former
    one, goes through memory row by row.

    Parameters
    ----------
    place : (K, D, B) float64
    nodes : Nodes
    slots : (K B,) int64
        Overwritten: where sample j of block k, number k B + j, stands; -1 beyond the nodes.

    Returns
    -------
    samples : (n, D) float64
    begin : (rows + 1,) int64
        Where the samples of each row begin.
    """
    blocks = shares(len(place), min(PARTS, slots.size // _LEAST_SORTED))
    counts = np.zeros((len(blocks), nodes.rows), np.int64)
    for_each(len(blocks), lambda k: _count_rows(place, blocks[k], nodes, slots, counts[k]))
    begin: Indices = _set_starts(counts)
    samples = np.empty((begin[-1], place.shape[1]))
    for_each(len(blocks), lambda k: _fill_slots(place, blocks[k], slots, counts[k], samples))
    return samples, begin


def add_to(force: Array, found: Array, weights: tuple[float, float], slots: Indices) -> None:
    """Add what was found, (n, components) in sorted order, to the samples' drift (K, D, B)."""
    blocks = shares(len(force), min(PARTS, slots.size // _LEAST_SORTED))
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
            weight = weights[1] if c == 2 else weights[0]
            for j in range(size):
                slot = slots[k * size + j]
                if slot >= 0:
                    force[k, c, j] += weight * found[slot, c]


@view_kernel
def _set_basis(sample: Array, basis: Array, functions: int) -> None:
    """Write b_p of one sample's angle, (2M + 1,) and more; without an angle, any does."""
    c2, s2 = cos_sin(2.0 * sample[2]) if sample.size == 3 else (1.0, 0.0)
    cosine, sine = c2, s2
    basis[0] = 1.0
    for m in range(1, functions // 2 + 1):
        basis[2 * m - 1] = cosine
        basis[2 * m] = sine
        cosine, sine = cosine * c2 - sine * s2, sine * c2 + cosine * s2


@inline_kernel
def _stencil(
    x: float, y: float, nodes: Nodes
) -> tuple[int, int, tuple[float, float, float, float], tuple[float, float, float, float]]:
    """First row and column of a sample's nodes, and B along y and along x."""
    across = (x - nodes.x_low) * nodes.inverse_h
    up = (y - nodes.y_low) * nodes.inverse_h
    column, row = math.floor(across), math.floor(up)
    weights_y, weights_x = _spline_weights(up - row), _spline_weights(across - column)
    return int(row) - 1, int(column) - 1, weights_y, weights_x


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
    """For samples whose rows begin there, dealt out in equal parts."""
    count = max(1, min(PARTS, int(begin[-1]) // _LEAST_SPREAD))
    parts = np.linspace(0, begin[-1], count + 1).astype(np.int64)
    first, last = (
        np.searchsorted(begin, ends, "right") - 1 for ends in (parts[:-1], parts[1:] - 1)
    )
    used = np.where(parts[1:] > parts[:-1], last - first + STENCIL, 0)
    return Windows(parts, first, np.concatenate([[0], np.cumsum(used)]))


def deposit(samples: Array, begin: Indices, nodes: Nodes, functions: int, mass: float) -> Array:
    """s_q at the nodes, (functions, rows, columns), of samples sorted by row.

    Every part of the samples deposits into rows of its own; these are added up in the parts' order.
    """
    windows = windows_of(begin)
    parts, first, offsets = windows
    partial = np.zeros((offsets[-1], nodes.columns, padded(functions)))

    def put(k: int) -> None:
        window = partial[offsets[k] : offsets[k + 1]]
        some = samples[parts[k] : parts[k + 1]]
        _deposit(some, int(first[k]), nodes, functions, np.zeros(partial.shape[2]), window)

    for_each(first.size, put)
    sources = np.zeros((functions, nodes.rows, nodes.columns))
    rows = shares(nodes.rows, first.size)
    for_each(len(rows), lambda k: _add_windows(partial, windows, mass, rows[k], sources))
    return sources


@view_kernel
def _deposit(
    samples: Array, first: int, nodes: Nodes, functions: int, basis: Array, window: Array
) -> None:
    for i in range(samples.shape[0]):
        row, column, weights_y, weights_x = _stencil(samples[i, 0], samples[i, 1], nodes)
        _set_basis(samples[i], basis, functions)
        for a in range(STENCIL):
            for b in range(STENCIL):
                weight = weights_y[a] * weights_x[b]
                node = window[row - first + a, column + b]
                for p in range(basis.size):
                    node[p] += weight * basis[p]


@kernel
def _add_windows(
    partial: Array, windows: Windows, scale: float, rows: tuple[int, int], sources: Array
) -> None:
    """Add up the windows' rows; functions come to the front."""
    _, first, offsets = windows
    for row in range(rows[0], rows[1]):
        total = np.zeros(partial.shape[1:])
        for part in range(first.size):
            at = row - first[part]
            if 0 <= at < offsets[part + 1] - offsets[part]:
                total += partial[offsets[part] + at]
        for p in range(sources.shape[0]):
            for column in range(sources.shape[2]):
                sources[p, row, column] = scale * total[column, p]


def interpolate(
    samples: Array, nodes: Nodes, corner: tuple[int, int], fields: Real, functions: int
) -> Array:
    """The fields at the samples, (n, components).

    fields : (rows, columns, components, `padded` functions)
        At a part of the nodes, from row and column `corner` on.
    """
    components, width = fields.shape[2:]
    found = np.empty((len(samples), components))
    lines = fields.reshape(len(fields), -1)
    parts = shares(len(samples), min(PARTS, len(samples) // _LEAST_SPREAD))

    def read(k: int) -> None:
        some = slice(*parts[k])
        work = np.zeros(width), np.empty(components * width)
        _interpolate_some(samples[some], nodes, corner, lines, functions, work, found[some])

    for_each(len(parts), read)
    return found


@view_kernel
def _interpolate_some(
    samples: Array,
    nodes: Nodes,
    corner: tuple[int, int],
    lines: Real,
    functions: int,
    work: tuple[Array, Array],
    found: Array,
) -> None:
    basis, sums = work
    together, width = sums.size, basis.size
    for i in range(samples.shape[0]):
        row, column, weights_y, weights_x = _stencil(samples[i, 0], samples[i, 1], nodes)
        _set_basis(samples[i], basis, functions)
        sums[:] = 0.0
        # Counted from the corner in whole numbers: rounding in x and y could lead beyond it.
        first = (column - corner[1]) * together
        here = slice(first, first + STENCIL * together)
        for a in range(STENCIL):
            line = lines[row - corner[0] + a, here]
            _add_four_nodes(sums, weights_y[a], weights_x, line)
        for c in range(found.shape[1]):
            total = 0.0
            for p in range(functions):
                total += sums[c * width + p] * basis[p]
            found[i, c] = total


@view_kernel
def _add_four_nodes(
    sums: Array, weight: float, weights_x: tuple[float, float, float, float], line: Real
) -> None:
    """Add four neighbouring nodes, which follow one another in `line`: sums is read once for all."""
    a, b, c, d = weights_x
    a, b, c, d = weight * a, weight * b, weight * c, weight * d
    n = sums.size
    for p in range(n):
        sums[p] += a * line[p] + b * line[n + p] + c * line[2 * n + p] + d * line[3 * n + p]
