"""Samples to nodes and back by cubic B-splines: the compiled part of `sample_forces`.

Samples are sorted by row and dealt out in equal parts, each of which deposits into a window of its
own; the windows are added up in a fixed order, so that any number of threads gives the same bits.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np

from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.interaction.spectra import Indices, Real
from ellipsoid_coupling.kernels import inline_kernel, kernel, parallel_kernel, view_kernel
from ellipsoid_coupling.physics.elementary import cos_sin

NodeNumbers = tuple[float, float, float, int, int]

# Nodes about a point in each direction.
STENCIL = 4
# Samples are dealt out in this many parts of equal size, whatever the number of threads.
PARTS = 32
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


def node_numbers(nodes: Nodes) -> NodeNumbers:
    """What parallel loops take in place of named tuples."""
    return nodes.x_low, nodes.y_low, nodes.inverse_h, nodes.rows, nodes.columns


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


@parallel_kernel
def sort_by_row(place: Array, nodes: NodeNumbers, slots: Indices) -> tuple[Array, Indices]:
    """Copies of the samples within the nodes, sorted by the first row of their nodes.

    A stable counting sort, so that whatever is done in this order, and what follows in the former
    one, goes through memory row by row.

    Parameters
    ----------
    place : (K, D, B) float64
    nodes : of `node_numbers`
    slots : (K B,) int64
        Overwritten: where sample j of block k, number k B + j, stands; -1 beyond the nodes.

    Returns
    -------
    samples : (n, D) float64
    begin : (rows + 1,) int64
        Where the samples of each row begin.
    """
    x_low, y_low, inverse_h, rows, columns = nodes
    blocks = place.shape[0]
    parts = min(PARTS, blocks)
    counts = np.zeros((parts, rows), np.int64)
    for part in numba.prange(parts):
        some = part * blocks // parts, (part + 1) * blocks // parts
        here = Nodes(x_low, y_low, inverse_h, rows, columns)
        _count_rows(place, some, here, slots, counts[part])
    begin = np.zeros(rows + 1, np.int64)
    for row in range(rows):
        begin[row + 1] = begin[row]
        for part in range(parts):
            count = counts[part, row]
            counts[part, row] = begin[row + 1]
            begin[row + 1] += count
    samples = np.empty((begin[rows], place.shape[1]))
    for part in numba.prange(parts):
        some = part * blocks // parts, (part + 1) * blocks // parts
        _fill_slots(place, some, slots, counts[part], samples)
    return samples, begin


@parallel_kernel
def add_to(force: Array, found: Array, weights: tuple[float, float], slots: Indices) -> None:
    """Add what was found, (n, components) in sorted order, to the samples' drift (K, D, B)."""
    size = force.shape[2]
    for k in numba.prange(force.shape[0]):
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


@parallel_kernel
def deposit_parts(
    samples: Array,
    parts: Indices,
    windows: tuple[Indices, Indices],
    nodes: NodeNumbers,
    functions: int,
    partial: Array,
) -> None:
    """Every part of the samples deposits into rows of its own.

    windows : first row of each part's window (parts,), and where it begins in `partial`
        (parts + 1,).
    partial : (all windows' rows, columns, `padded` functions), zero.
    """
    first, offsets = windows
    x_low, y_low, inverse_h, rows, columns = nodes
    for part in numba.prange(parts.size - 1):
        window = partial[offsets[part] : offsets[part + 1]]
        some = samples[parts[part] : parts[part + 1]]
        basis = np.zeros(partial.shape[2])
        here = Nodes(x_low, y_low, inverse_h, rows, columns)
        _deposit(some, first[part], here, functions, basis, window)


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


@parallel_kernel
def add_parts(
    partial: Array, first: Indices, offsets: Indices, scale: float, sources: Array
) -> None:
    """Add up the parts' windows row by row, in the parts' order; functions come to the front."""
    for row in numba.prange(sources.shape[1]):
        total = np.zeros(partial.shape[1:])
        for part in range(first.size):
            at = row - first[part]
            if 0 <= at < offsets[part + 1] - offsets[part]:
                total += partial[offsets[part] + at]
        for p in range(sources.shape[0]):
            for column in range(sources.shape[2]):
                sources[p, row, column] = scale * total[column, p]


@parallel_kernel
def interpolate(samples: Array, nodes: NodeNumbers, fields: Real, functions: int) -> Array:
    """The fields (rows, columns, components, `padded` functions) at the samples: (n, components)."""
    x_low, y_low, inverse_h, rows, columns = nodes
    found = np.empty((samples.shape[0], fields.shape[2]))
    for part in numba.prange(PARTS):
        begin, end = part * found.shape[0] // PARTS, (part + 1) * found.shape[0] // PARTS
        corner = Nodes(x_low, y_low, inverse_h, rows, columns)
        basis, sums = np.zeros(fields.shape[3]), np.empty(fields.shape[2] * fields.shape[3])
        lines = fields.reshape(fields.shape[0], fields.shape[1] * sums.size)
        _interpolate_some(
            samples[begin:end], corner, lines, functions, (basis, sums), found[begin:end]
        )
    return found


@view_kernel
def _interpolate_some(
    samples: Array,
    nodes: Nodes,
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
        here = slice(column * together, (column + STENCIL) * together)
        for a in range(STENCIL):
            _add_four_nodes(sums, weights_y[a], weights_x, lines[row + a, here])
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
