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
from ellipsoid_coupling.kernels import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.physics.elementary import cos_sin

NodeNumbers = tuple[float, float, float, int, int]

# Nodes about a point in each direction.
STENCIL = 4
# Samples are dealt out in this many parts of equal size, whatever the number of threads.
PARTS = 32


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
def sort_by_row(place: Array, nodes: Nodes) -> tuple[Indices, Indices]:
    """The samples within the nodes in the order of their first row of nodes, and that row.

    A stable counting sort; sample j of block k is number k B + j. Returns (n,) int64 each.
    """
    blocks, _, size = place.shape
    row_of = np.empty(blocks * size, np.int32)
    begin = np.zeros(nodes.rows + 1, np.int64)
    for k in range(blocks):
        for j in range(size):
            row = _first_node(place[k, 1, j], nodes.y_low, nodes.inverse_h, nodes.rows)
            column = _first_node(place[k, 0, j], nodes.x_low, nodes.inverse_h, nodes.columns)
            row = row if column >= 0 else -1
            row_of[k * size + j] = row
            if row >= 0:
                begin[row + 1] += 1
    for row in range(nodes.rows):
        begin[row + 1] += begin[row]
    order = np.empty(begin[nodes.rows], np.int64)
    rows = np.empty(begin[nodes.rows], np.int64)
    for i in range(row_of.size):
        row = row_of[i]
        if row >= 0:
            order[begin[row]] = i
            rows[begin[row]] = row
            begin[row] += 1
    return order, rows


@kernel
def _set_basis(place: Array, k: int, j: int, basis: Array) -> None:
    """Write b_p of one sample's angle, (2M + 1,); without an angle, any does."""
    double = 2.0 * place[k, 2, j] if place.shape[1] == 3 else 0.0
    c2, s2 = cos_sin(double)
    cosine, sine = c2, s2
    basis[0] = 1.0
    for m in range(1, basis.size // 2 + 1):
        basis[2 * m - 1] = cosine
        basis[2 * m] = sine
        cosine, sine = cosine * c2 - sine * s2, sine * c2 + cosine * s2


@kernel
def _stencil(
    place: Array, k: int, j: int, nodes: Nodes
) -> tuple[int, int, tuple[float, float, float, float], tuple[float, float, float, float]]:
    """First row and column of a sample's nodes, and B along y and along x."""
    across = (place[k, 0, j] - nodes.x_low) * nodes.inverse_h
    up = (place[k, 1, j] - nodes.y_low) * nodes.inverse_h
    column, row = math.floor(across), math.floor(up)
    weights_y, weights_x = _spline_weights(up - row), _spline_weights(across - column)
    return int(row) - 1, int(column) - 1, weights_y, weights_x


@parallel_kernel
def deposit_parts(
    place: Array,
    order: Indices,
    parts: Indices,
    windows: tuple[Indices, Indices],
    nodes: NodeNumbers,
    partial: Array,
) -> None:
    """Every part of the samples deposits into rows of its own.

    windows : first row of each part's window (parts,), and where it begins in `partial`
        (parts + 1,).
    partial : (all windows' rows, columns, functions), zero.
    """
    first, offsets = windows
    x_low, y_low, inverse_h, rows, columns = nodes
    for part in numba.prange(parts.size - 1):
        window = partial[offsets[part] : offsets[part + 1]]
        some = order[parts[part] : parts[part + 1]]
        _deposit(place, some, first[part], Nodes(x_low, y_low, inverse_h, rows, columns), window)


@kernel
def _deposit(place: Array, order: Indices, first: int, nodes: Nodes, window: Array) -> None:
    size = place.shape[2]
    basis = np.empty(window.shape[2])
    for i in order:
        k, j = i // size, i % size
        row, column, weights_y, weights_x = _stencil(place, k, j, nodes)
        _set_basis(place, k, j, basis)
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
def interpolate(
    place: Array,
    order: Indices,
    nodes: NodeNumbers,
    fields: Real,
    weights: tuple[float, float],
    force: Array,
) -> None:
    """Add the fields (rows, columns, components, functions) at the samples to their drift."""
    x_low, y_low, inverse_h, rows, columns = nodes
    for part in numba.prange(PARTS):
        begin, end = part * order.size // PARTS, (part + 1) * order.size // PARTS
        corner = Nodes(x_low, y_low, inverse_h, rows, columns)
        _interpolate_some(place, order[begin:end], corner, fields, weights, force)


@kernel
def _interpolate_some(
    place: Array,
    order: Indices,
    nodes: Nodes,
    fields: Real,
    weights: tuple[float, float],
    force: Array,
) -> None:
    size = place.shape[2]
    components, functions = fields.shape[2:]
    together = components * functions
    lines = fields.reshape(fields.shape[0], fields.shape[1] * together)
    basis, sums = np.empty(functions), np.empty(together)
    for i in order:
        k, j = i // size, i % size
        row, column, weights_y, weights_x = _stencil(place, k, j, nodes)
        _set_basis(place, k, j, basis)
        sums[:] = 0.0
        here = slice(column * together, (column + STENCIL) * together)
        for a in range(STENCIL):
            _add_four_nodes(sums, weights_y[a], weights_x, lines[row + a, here])
        for c in range(min(components, force.shape[1])):
            total = 0.0
            for p in range(functions):
                total += sums[c * functions + p] * basis[p]
            force[k, c, j] += total * (weights[1] if c == 2 else weights[0])


@kernel
def _add_four_nodes(
    sums: Array, weight: float, weights_x: tuple[float, float, float, float], line: Real
) -> None:
    """Add four neighbouring nodes, which follow one another in `line`: sums is read once for all."""
    a, b, c, d = weights_x
    a, b, c, d = weight * a, weight * b, weight * c, weight * d
    n = sums.size
    for p in range(n):
        sums[p] += a * line[p] + b * line[n + p] + c * line[2 * n + p] + d * line[3 * n + p]
