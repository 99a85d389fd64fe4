"""Sums over 4 x 4 nodes of many functions at once, and their transpose, in vector registers.

Each has a plain twin of the same name for Python.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from ellipsoid_coupling.compiled.kernel_forms import in_kernels
from ellipsoid_coupling.compiled.simd_vectors import (
    DOUBLES,
    VECTOR,
    broadcast,
    counted_loop,
    fma,
    index_at,
    load_doubles,
    sum_lanes,
    unpack,
    variable,
    vector_at,
)

_uni_tuple: Any = types.UniTuple
_THREE = _uni_tuple(types.float64, 3)

Four = tuple[float, float, float, float]


def sum_stencil(
    nodes: Any,
    at: tuple[int, int],
    along_y: tuple[Four, Four],
    along_x: tuple[Four, Four],
    factors: Any,
) -> tuple[float, float, float]:
    """Three sums over 4 x 4 nodes of n functions each, n a multiple of `DOUBLES`.

    With (V, V') = along_y, (W, W') = along_x and N[a, b, p] the nodes from `at` on:

        sum_abp factors[0, p] V_a W'_b N
        sum_abp factors[0, p] V'_a W_b N
        sum_abp factors[1, p] V_a W_b N

    Parameters
    ----------
    nodes : (rows, columns, n) float32 or float64
        Contiguous, like the factors.
    at : (row, column)
    factors : (2, n) float64
    """
    here = nodes[at[0] : at[0] + 4, at[1] : at[1] + 4].astype(np.float64)
    (v, rise), (w, slope) = along_y, along_x
    found = [
        float(np.einsum("p,a,b,abp->", factors[k], y, x, here))
        for k, y, x in ((0, v, slope), (0, rise, w), (1, v, w))
    ]
    return found[0], found[1], found[2]


def _sum_stencil(
    context: Any, nodes: Any, at: Any, along_y: Any, along_x: Any, factors: Any
) -> Any:
    """The type of `sum_stencil`, and LLVM's instructions for `DOUBLES` functions at a time."""
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        node, factor = (
            context.make_array(kind)(context, builder, value)
            for kind, value in ((nodes, arguments[0]), (factors, arguments[4]))
        )
        first, next_row, n = _strides(builder, node, arguments[1])
        # Weights are the same for all functions: each is copied to all lanes of a vector.
        (v, rise), (w, slope) = (
            [
                [broadcast(builder, weight) for weight in unpack(builder, four, 4)]
                for four in unpack(builder, pair, 2)
            ]
            for pair in arguments[2:4]
        )
        nothing = ir.Constant(VECTOR, [0.0] * DOUBLES)
        totals = [variable(builder, VECTOR) for _ in range(3)]
        for total in totals:
            builder.store(nothing, total)
        with counted_loop(builder, builder.sdiv(n, n.type(DOUBLES))) as over_blocks:
            begin = builder.mul(over_blocks.index, n.type(DOUBLES))
            # The nodes' sums for one vector of functions: first along x, then along y.
            value = along_x = along_y = nothing
            for a in range(4):
                straight = sloped = nothing
                for b in range(4):
                    index = index_at(builder, (first, begin), (a, next_row), (b, n))
                    number = load_doubles(builder, node.data, index)
                    straight = fma(builder, w[b], number, straight)
                    sloped = fma(builder, slope[b], number, sloped)
                value = fma(builder, v[a], straight, value)
                along_x = fma(builder, v[a], sloped, along_x)
                along_y = fma(builder, rise[a], straight, along_y)
            # Multiplied by the basis functions only now: once a vector, not once a node.
            once = load_doubles(builder, factor.data, begin)
            turned = load_doubles(builder, factor.data, builder.add(n, begin))
            parts = (once, along_x), (once, along_y), (turned, value)
            for total, (by, part) in zip(totals, parts, strict=True):
                builder.store(fma(builder, by, part, builder.load(total)), total)
        # Lanes are added at the very end, always in the same order.
        sums = [sum_lanes(builder, builder.load(total)) for total in totals]
        return context.make_tuple(builder, signature.return_type, sums)

    return _THREE(nodes, at, along_y, along_x, factors), generate


_compiled_sum_stencil: Any = intrinsic(_sum_stencil)


@in_kernels(sum_stencil)
def _choose_sum_stencil(nodes: Any, at: Any, along_y: Any, along_x: Any, factors: Any) -> Any:
    del at, along_y, along_x
    if any(array.layout != "C" for array in (nodes, factors)):
        return None
    return lambda nodes, at, along_y, along_x, factors: _compiled_sum_stencil(
        nodes, at, along_y, along_x, factors
    )


def add_stencil(nodes: Any, at: tuple[int, int], along_y: Four, along_x: Four, basis: Any) -> None:
    """N[a, b, p] += V_a W_b basis[p] at 4 x 4 nodes, the transpose of `sum_stencil`.

    Parameters
    ----------
    nodes : (rows, columns, n) float64
        Contiguous, like the basis.
    at : (row, column)
    along_y, along_x : V and W
    basis : (n,) float64
    """
    weights = np.outer(along_y, along_x)
    nodes[at[0] : at[0] + 4, at[1] : at[1] + 4] += weights[..., None] * basis


def _add_stencil(context: Any, nodes: Any, at: Any, along_y: Any, along_x: Any, basis: Any) -> Any:
    """The type of `add_stencil`, and LLVM's instructions for `DOUBLES` functions at a time."""
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature
        node, factor = (
            context.make_array(kind)(context, builder, value)
            for kind, value in ((nodes, arguments[0]), (basis, arguments[4]))
        )
        first, next_row, n = _strides(builder, node, arguments[1])
        rows, columns = (unpack(builder, four, 4) for four in arguments[2:4])
        # All 16 products V_a W_b are made before the loop and stay in registers.
        weights = [[broadcast(builder, builder.fmul(v, w)) for w in columns] for v in rows]
        with counted_loop(builder, builder.sdiv(n, n.type(DOUBLES))) as over_blocks:
            begin = builder.mul(over_blocks.index, n.type(DOUBLES))
            value = load_doubles(builder, factor.data, begin)
            for a in range(4):
                for b in range(4):
                    index = index_at(builder, (first, begin), (a, next_row), (b, n))
                    before = load_doubles(builder, node.data, index)
                    after = fma(builder, weights[a][b], value, before)
                    stored = builder.store(after, vector_at(builder, node.data, index))
                    stored.align = 8
        return context.get_dummy_value()

    return types.none(nodes, at, along_y, along_x, basis), generate


_compiled_add_stencil: Any = intrinsic(_add_stencil)


@in_kernels(add_stencil)
def _choose_add_stencil(nodes: Any, at: Any, along_y: Any, along_x: Any, basis: Any) -> Any:
    del at, along_y, along_x
    if any(array.layout != "C" for array in (nodes, basis)) or nodes.dtype != types.float64:
        return None
    return lambda nodes, at, along_y, along_x, basis: _compiled_add_stencil(
        nodes, at, along_y, along_x, basis
    )


def _strides(builder: Any, nodes: Any, at: Any) -> tuple[Any, Any, Any]:
    """Where node `at` begins, and how far the next row and the next column are."""
    _, columns, n = unpack(builder, nodes.shape, 3)
    row, column = unpack(builder, at, 2)
    next_row = builder.mul(columns, n)
    return builder.add(builder.mul(row, next_row), builder.mul(column, n)), next_row, n
