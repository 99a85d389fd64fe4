"""Sums that stay in the processor's vector registers, written as LLVM's instructions.

Loops over arrays keep sums in memory: what one loop adds, the next one reads back. These do not. Each
has a plain twin of the same name for Python.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, overload

from ellipsoid_coupling.compiled.intrinsics import emit_prefetch

# Numba ships half of its types: these functions have none.
_get_function: Any = cgutils.get_or_insert_function
_counted_loop: Any = cgutils.for_range
_variable: Any = cgutils.alloca_once
_unpack: Any = cgutils.unpack_tuple
_uni_tuple: Any = types.UniTuple

# Bytes of a cache line, and of the widest vector of today's processors.
LINE = 64
# How many lines ahead a stream of factors is asked for: 8 kB.
_LINES_AHEAD = 128
# Numbers in a line, or in a vector, in double precision.
DOUBLES = LINE // 8
_VECTOR = ir.VectorType(ir.DoubleType(), DOUBLES)
_THREE = _uni_tuple(types.float64, 3)

# Real and imaginary part at two frequencies.
_PARTS = 4
# Sums of `sum_rows` that are taken together: so many rows of so many lines.
_ROWS, _LINES = 4, 2

Four = tuple[float, float, float, float]


def sum_products(factors: Any, which: Any, sources: Any, sums: Any) -> None:
    """sums[k, part] = sum_j factors[:, which[k], which[j]] sources[:, j, part].

    Two targets k at a time, so that every source is read once for both. Numbers lie in lanes of one
    cache line: `LINE` bytes, 16 in single and 8 in double precision.

    Parameters
    ----------
    factors : (lines, n, n, lanes) float32 or float64
        Contiguous, like all the others.
    which : (m,) int64
    sources : (lines, m, 4, lanes)
    sums : (m, 4, lines * lanes)
        Overwritten.
    """
    products = np.einsum("lkji,ljpi->kpli", factors[:, which][:, :, which], sources)
    sums[:] = products.reshape(sums.shape)


def _sum_products(context: Any, factors: Any, which: Any, sources: Any, sums: Any) -> Any:
    """The type of `sum_products`, and LLVM's instructions: 2 x 4 sums in registers."""
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = [
            context.make_array(kind)(context, builder, value)
            for kind, value in zip(signature.args, arguments, strict=True)
        ]
        number = context.get_value_type(factors.dtype)
        vector = ir.VectorType(number, LINE * 8 // factors.dtype.bitwidth)
        nothing = ir.Constant(vector, [0.0] * vector.count)
        factor_data, _, source_data, sum_data = (
            builder.bitcast(array.data, vector.as_pointer()) for array in arrays
        )
        lines, terms = _unpack(builder, arrays[2].shape, 4)[:2]
        n = _unpack(builder, arrays[0].shape, 4)[1]
        totals = [[_variable(builder, vector) for _ in range(_PARTS)] for _ in range(2)]
        with _counted_loop(builder, lines) as over_lines:
            line = over_lines.index
            first_source = builder.mul(line, terms)
            with _counted_loop(builder, _shares(builder, terms, 2)) as over_pairs:
                targets = _some(builder, over_pairs.index, terms, 2)
                for total in itertools.chain(*totals):
                    builder.store(nothing, total)
                rows = []
                for target in targets:
                    one = builder.load(builder.gep(arrays[1].data, [target]))
                    rows.append(builder.mul(builder.add(builder.mul(line, n), one), n))
                with _counted_loop(builder, terms) as over_terms:
                    column = builder.load(builder.gep(arrays[1].data, [over_terms.index]))
                    places = [builder.add(row, column) for row in rows]
                    source = builder.add(first_source, over_terms.index)
                    _add_products(builder, (factor_data, places), (source_data, source), totals)
                for target, total in zip(targets, totals, strict=True):
                    for part in range(_PARTS):
                        row = builder.add(_times(builder, target, _PARTS), target.type(part))
                        place = builder.add(builder.mul(row, lines), line)
                        sum_here = builder.gep(sum_data, [place])
                        builder.store(builder.load(total[part]), sum_here).align = _bytes(vector)
        return context.get_dummy_value()

    return types.none(factors, which, sources, sums), generate


def _add_products(
    builder: Any,
    factors: tuple[Any, list[Any]],
    source: tuple[Any, Any],
    totals: list[list[Any]],
) -> None:
    """Add one term to the sums of all parts of each target; ask for the factors that come later."""
    data, places = factors
    for place in places:
        emit_prefetch(builder, builder.gep(data, [builder.add(place, place.type(_LINES_AHEAD))]))
    loaded = [_load_line(builder, data, place) for place in places]
    first = _times(builder, source[1], _PARTS)
    for part in range(_PARTS):
        value = _load_line(builder, source[0], builder.add(first, first.type(part)))
        for factor, total in zip(loaded, totals, strict=True):
            more = _emit_fma(builder, factor, value, builder.load(total[part]))
            builder.store(more, total[part])


def _load_line(builder: Any, data: Any, index: Any) -> Any:
    """The vector with this index, whatever its numbers are, wherever they begin."""
    value = builder.load(builder.gep(data, [index]))
    value.align = _bytes(value.type)
    return value


def _bytes(vector: Any) -> int:
    """Of one of a vector's numbers."""
    return LINE // int(vector.count)


def _times(builder: Any, index: Any, factor: int) -> Any:
    return builder.mul(index, index.type(factor))


_compiled_sum_products: Any = intrinsic(_sum_products)


@overload(sum_products, inline="always", strict=False)
def _choose_sum_products(factors: Any, which: Any, sources: Any, sums: Any) -> Any:
    # Anything else than contiguous arrays would be read as if it were one.
    if any(array.layout != "C" for array in (factors, which, sources, sums)):
        return None
    return lambda factors, which, sources, sums: _compiled_sum_products(
        factors, which, sources, sums
    )


def sum_rows(weights: Any, rows: Any, sums: Any) -> None:
    """sums[i] = sum_j weights[i, j] rows[j].

    A matrix product for small matrices in cache: four sums and two cache lines at a time, so that
    every number that is read serves several times.

    Parameters
    ----------
    weights : (n, terms) float32 or float64
        Contiguous, like all the others, which are of the same kind.
    rows : (terms, columns)
        A multiple of the numbers in a cache line, `LINE` bytes.
    sums : (n, columns)
        Overwritten.
    """
    sums[:] = weights @ rows


def _sum_rows(context: Any, weights: Any, rows: Any, sums: Any) -> Any:
    """The type of `sum_rows`, and LLVM's instructions: 4 x 2 sums in registers."""
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        weight, row, total = (
            context.make_array(kind)(context, builder, value)
            for kind, value in zip(signature.args, arguments, strict=True)
        )
        number = context.get_value_type(rows.dtype)
        vector = ir.VectorType(number, LINE * 8 // rows.dtype.bitwidth)
        nothing = ir.Constant(vector, [0.0] * vector.count)
        row_data, sum_data = (
            builder.bitcast(array.data, vector.as_pointer()) for array in (row, total)
        )
        terms, columns = _unpack(builder, row.shape, 2)
        count = _unpack(builder, total.shape, 2)[0]
        lines = builder.sdiv(columns, columns.type(vector.count))
        totals = [[_variable(builder, vector) for _ in range(_LINES)] for _ in range(_ROWS)]
        with _counted_loop(builder, _shares(builder, lines, _LINES)) as over_lines:
            here = _some(builder, over_lines.index, lines, _LINES)
            with _counted_loop(builder, _shares(builder, count, _ROWS)) as over_rows:
                targets = _some(builder, over_rows.index, count, _ROWS)
                for sum_here in itertools.chain(*totals):
                    builder.store(nothing, sum_here)
                begins = [builder.mul(target, terms) for target in targets]
                with _counted_loop(builder, terms) as over_terms:
                    first = builder.mul(over_terms.index, lines)
                    values = [_load_line(builder, row_data, builder.add(first, k)) for k in here]
                    for begin, sums_here in zip(begins, totals, strict=True):
                        place = builder.gep(weight.data, [builder.add(begin, over_terms.index)])
                        factor = _emit_alike(builder, builder.load(place), vector)
                        for value, sum_here in zip(values, sums_here, strict=True):
                            more = _emit_fma(builder, factor, value, builder.load(sum_here))
                            builder.store(more, sum_here)
                for target, sums_here in zip(targets, totals, strict=True):
                    first = builder.mul(target, lines)
                    for k, sum_here in zip(here, sums_here, strict=True):
                        place = builder.gep(sum_data, [builder.add(first, k)])
                        builder.store(builder.load(sum_here), place).align = _bytes(vector)
        return context.get_dummy_value()

    return types.none(weights, rows, sums), generate


def _shares(builder: Any, count: Any, size: int) -> Any:
    """How many shares of `size` are all of `count`, the last one not full."""
    return builder.sdiv(builder.add(count, count.type(size - 1)), count.type(size))


def _some(builder: Any, share: Any, count: Any, size: int) -> list[Any]:
    """The things of one share; the last one again where none is left, which has the same result."""
    last = builder.sub(count, count.type(1))
    first = _times(builder, share, size)
    each = [builder.add(first, first.type(k)) for k in range(size)]
    return [builder.select(builder.icmp_signed("<", k, count), k, last) for k in each]


_compiled_sum_rows: Any = intrinsic(_sum_rows)


@overload(sum_rows, inline="always", strict=False)
def _choose_sum_rows(weights: Any, rows: Any, sums: Any) -> Any:
    arrays = weights, rows, sums
    if any(array.layout != "C" or array.dtype != rows.dtype for array in arrays):
        return None
    return lambda weights, rows, sums: _compiled_sum_rows(weights, rows, sums)


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
        (v, rise), (w, slope) = (
            [
                [_emit_alike(builder, weight) for weight in _unpack(builder, four, 4)]
                for four in _unpack(builder, pair, 2)
            ]
            for pair in arguments[2:4]
        )
        nothing = ir.Constant(_VECTOR, [0.0] * DOUBLES)
        totals = [_variable(builder, _VECTOR) for _ in range(3)]
        for total in totals:
            builder.store(nothing, total)
        with _counted_loop(builder, builder.sdiv(n, n.type(DOUBLES))) as over_blocks:
            begin = builder.mul(over_blocks.index, n.type(DOUBLES))
            value = along_x = along_y = nothing
            for a in range(4):
                straight = sloped = nothing
                for b in range(4):
                    place = _place(builder, (first, begin), (a, next_row), (b, n))
                    number = _emit_load(builder, node.data, place)
                    straight = _emit_fma(builder, w[b], number, straight)
                    sloped = _emit_fma(builder, slope[b], number, sloped)
                value = _emit_fma(builder, v[a], straight, value)
                along_x = _emit_fma(builder, v[a], sloped, along_x)
                along_y = _emit_fma(builder, rise[a], straight, along_y)
            once = _emit_load(builder, factor.data, begin)
            turned = _emit_load(builder, factor.data, builder.add(n, begin))
            parts = (once, along_x), (once, along_y), (turned, value)
            for total, (by, part) in zip(totals, parts, strict=True):
                builder.store(_emit_fma(builder, by, part, builder.load(total)), total)
        sums = [_emit_sum(builder, builder.load(total)) for total in totals]
        return context.make_tuple(builder, signature.return_type, sums)

    return _THREE(nodes, at, along_y, along_x, factors), generate


_compiled_sum_stencil: Any = intrinsic(_sum_stencil)


@overload(sum_stencil, inline="always", strict=False)
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
        rows, columns = (_unpack(builder, four, 4) for four in arguments[2:4])
        weights = [[_emit_alike(builder, builder.fmul(v, w)) for w in columns] for v in rows]
        with _counted_loop(builder, builder.sdiv(n, n.type(DOUBLES))) as over_blocks:
            begin = builder.mul(over_blocks.index, n.type(DOUBLES))
            value = _emit_load(builder, factor.data, begin)
            for a in range(4):
                for b in range(4):
                    place = _place(builder, (first, begin), (a, next_row), (b, n))
                    before = _emit_load(builder, node.data, place)
                    after = _emit_fma(builder, weights[a][b], value, before)
                    stored = builder.store(after, _vector_at(builder, node.data, place))
                    stored.align = 8
        return context.get_dummy_value()

    return types.none(nodes, at, along_y, along_x, basis), generate


_compiled_add_stencil: Any = intrinsic(_add_stencil)


@overload(add_stencil, inline="always", strict=False)
def _choose_add_stencil(nodes: Any, at: Any, along_y: Any, along_x: Any, basis: Any) -> Any:
    del at, along_y, along_x
    if any(array.layout != "C" for array in (nodes, basis)) or nodes.dtype != types.float64:
        return None
    return lambda nodes, at, along_y, along_x, basis: _compiled_add_stencil(
        nodes, at, along_y, along_x, basis
    )


def _strides(builder: Any, nodes: Any, at: Any) -> tuple[Any, Any, Any]:
    """Where node `at` begins, and how far the next row and the next column are."""
    _, columns, n = _unpack(builder, nodes.shape, 3)
    row, column = _unpack(builder, at, 2)
    next_row = builder.mul(columns, n)
    return builder.add(builder.mul(row, next_row), builder.mul(column, n)), next_row, n


def _place(builder: Any, starts: tuple[Any, Any], *steps: tuple[int, Any]) -> Any:
    """The sum of both starts and of so many of each step."""
    place = builder.add(*starts)
    for count, step in steps:
        place = builder.add(place, builder.mul(step.type(count), step))
    return place


def _vector_at(builder: Any, data: Any, place: Any) -> Any:
    """The address of `DOUBLES` numbers."""
    vector = ir.VectorType(data.type.pointee, DOUBLES)
    return builder.bitcast(builder.gep(data, [place]), vector.as_pointer())


def _emit_load(builder: Any, data: Any, place: Any) -> Any:
    """`DOUBLES` numbers, wherever they begin, in double precision."""
    value = builder.load(_vector_at(builder, data, place))
    single = isinstance(data.type.pointee, ir.FloatType)
    value.align = 4 if single else 8
    return builder.fpext(value, _VECTOR) if single else value


def _emit_alike(builder: Any, value: Any, vector: Any = _VECTOR) -> Any:
    """A vector of the same number."""
    empty = ir.Constant(vector, ir.Undefined)
    one = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, empty, _places(0 for _ in range(vector.count)))


def _emit_sum(builder: Any, vector: Any) -> Any:
    """The sum of a vector's numbers: halves are added until one is left."""
    count = vector.type.count
    while count > 1:
        count //= 2
        empty = ir.Constant(vector.type, ir.Undefined)
        low, high = (
            builder.shuffle_vector(vector, empty, _places(range(k, k + count))) for k in (0, count)
        )
        vector = builder.fadd(low, high)
    return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))


def _places(which: Iterable[int]) -> Any:
    places = list(which)
    return ir.Constant(ir.VectorType(ir.IntType(32), len(places)), places)


def _emit_fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """The fused multiply-add of vectors, which llvmlite has for numbers only."""
    kind = "f32" if isinstance(a.type.element, ir.FloatType) else "f64"
    name = f"llvm.fma.v{a.type.count}{kind}"
    function = _get_function(builder.module, ir.FunctionType(a.type, [a.type] * 3), name)
    return builder.call(function, [a, b, c])
