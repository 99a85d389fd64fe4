"""Sums that stay in the processor's vector registers, written as LLVM's instructions.

Loops over arrays keep sums in memory: what one loop adds, the next one reads back. These do not. Each
has a plain twin of the same name for Python.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from ellipsoid_coupling.compiled.intrinsics import emit_prefetch
from ellipsoid_coupling.compiled.kernel_forms import in_kernels
from ellipsoid_coupling.compiled.simd_vectors import (
    LINE,
    blocks_of,
    broadcast,
    bytes_each,
    counted_loop,
    fma,
    indices_of_block,
    load_line,
    times,
    unpack,
    variable,
)
from ellipsoid_coupling.compiled.tuning import LINES_AHEAD, SUM_LINES, SUM_ROWS

# Real and imaginary part at two frequencies.
_PARTS = 4


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
        # All arrays but the indices are read and written as whole vectors.
        factor_data, _, source_data, sum_data = (
            builder.bitcast(array.data, vector.as_pointer()) for array in arrays
        )
        lines, terms = unpack(builder, arrays[2].shape, 4)[:2]
        n = unpack(builder, arrays[0].shape, 4)[1]
        totals = [[variable(builder, vector) for _ in range(_PARTS)] for _ in range(2)]
        with counted_loop(builder, lines) as over_lines:
            line = over_lines.index
            # All targets and sources of one line of frequencies, before the next line: the line's
            # blocks are contiguous.
            first_source = builder.mul(line, terms)
            with counted_loop(builder, blocks_of(builder, terms, 2)) as over_pairs:
                targets = indices_of_block(builder, over_pairs.index, terms, 2)
                # Variables on the stack: LLVM keeps these eight sums in registers.
                for total in itertools.chain(*totals):
                    builder.store(nothing, total)
                rows = []
                for target in targets:
                    one = builder.load(builder.gep(arrays[1].data, [target]))
                    rows.append(builder.mul(builder.add(builder.mul(line, n), one), n))
                with counted_loop(builder, terms) as over_terms:
                    column = builder.load(builder.gep(arrays[1].data, [over_terms.index]))
                    places = [builder.add(row, column) for row in rows]
                    source = builder.add(first_source, over_terms.index)
                    _add_products(builder, (factor_data, places), (source_data, source), totals)
                for target, total in zip(targets, totals, strict=True):
                    for part in range(_PARTS):
                        row = builder.add(times(builder, target, _PARTS), target.type(part))
                        place = builder.add(builder.mul(row, lines), line)
                        sum_here = builder.gep(sum_data, [place])
                        builder.store(builder.load(total[part]), sum_here).align = bytes_each(
                            vector
                        )
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
        emit_prefetch(builder, builder.gep(data, [builder.add(place, place.type(LINES_AHEAD))]))
    # The factors of both targets are loaded once, each source is used for both.
    loaded = [load_line(builder, data, place) for place in places]
    first = times(builder, source[1], _PARTS)
    for part in range(_PARTS):
        value = load_line(builder, source[0], builder.add(first, first.type(part)))
        for factor, total in zip(loaded, totals, strict=True):
            more = fma(builder, factor, value, builder.load(total[part]))
            builder.store(more, total[part])


_compiled_sum_products: Any = intrinsic(_sum_products)


@in_kernels(sum_products)
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
        terms, columns = unpack(builder, row.shape, 2)
        count = unpack(builder, total.shape, 2)[0]
        lines = builder.sdiv(columns, columns.type(vector.count))
        totals = [[variable(builder, vector) for _ in range(SUM_LINES)] for _ in range(SUM_ROWS)]
        with counted_loop(builder, blocks_of(builder, lines, SUM_LINES)) as over_lines:
            here = indices_of_block(builder, over_lines.index, lines, SUM_LINES)
            with counted_loop(builder, blocks_of(builder, count, SUM_ROWS)) as over_rows:
                targets = indices_of_block(builder, over_rows.index, count, SUM_ROWS)
                for sum_here in itertools.chain(*totals):
                    builder.store(nothing, sum_here)
                # Four rows of weights times two lines of columns: each loaded number serves several
                # sums.
                begins = [builder.mul(target, terms) for target in targets]
                with counted_loop(builder, terms) as over_terms:
                    first = builder.mul(over_terms.index, lines)
                    values = [load_line(builder, row_data, builder.add(first, k)) for k in here]
                    for begin, sums_here in zip(begins, totals, strict=True):
                        place = builder.gep(weight.data, [builder.add(begin, over_terms.index)])
                        factor = broadcast(builder, builder.load(place), vector)
                        for value, sum_here in zip(values, sums_here, strict=True):
                            more = fma(builder, factor, value, builder.load(sum_here))
                            builder.store(more, sum_here)
                for target, sums_here in zip(targets, totals, strict=True):
                    first = builder.mul(target, lines)
                    for k, sum_here in zip(here, sums_here, strict=True):
                        place = builder.gep(sum_data, [builder.add(first, k)])
                        builder.store(builder.load(sum_here), place).align = bytes_each(vector)
        return context.get_dummy_value()

    return types.none(weights, rows, sums), generate


_compiled_sum_rows: Any = intrinsic(_sum_rows)


@in_kernels(sum_rows)
def _choose_sum_rows(weights: Any, rows: Any, sums: Any) -> Any:
    arrays = weights, rows, sums
    if any(array.layout != "C" or array.dtype != rows.dtype for array in arrays):
        return None
    return lambda weights, rows, sums: _compiled_sum_rows(weights, rows, sums)
