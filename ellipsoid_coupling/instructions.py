"""What the processor can do and plain Python has no words for, to be used in kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, overload

# Numba ships half of its types: these functions have none.
_get_function: Any = cgutils.get_or_insert_function
_counted_loop: Any = cgutils.for_range
_variable: Any = cgutils.alloca_once
_unpack: Any = cgutils.unpack_tuple

# Bytes of a cache line, and of the widest vector of today's processors.
LINE = 64
# How many lines ahead a stream of factors is asked for: 4 kB.
_LINES_AHEAD = 64


def fused(a: float, b: float, c: float) -> float:
    """A b + c, in kernels with one rounding (one instruction); plain Python rounds twice."""
    return a * b + c


def _fma(context: Any, a: Any, b: Any, c: Any) -> Any:
    """The type of LLVM's fused multiply-add, and what makes it."""
    del context, a, b, c

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del context, signature
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


_compiled_fma: Any = intrinsic(_fma)


@overload(fused, inline="always", strict=False)
def _choose_fused(a: Any, b: Any, c: Any) -> Any:
    del a, b, c
    return lambda a, b, c: _compiled_fma(a, b, c)


def fetch_ahead(row: Any, index: int) -> None:
    """Ask for the cache line of ``row[index]``, in kernels; plain Python has no need to."""
    del row, index


def _prefetch(context: Any, row: Any, index: Any) -> Any:
    """The type of LLVM's prefetch of an array's element, and what makes it."""
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        _emit_prefetch(builder, builder.gep(data, [arguments[1]]))
        return context.get_dummy_value()

    return types.none(row, index), generate


def _emit_prefetch(builder: Any, address: Any) -> None:
    pointer = builder.bitcast(address, ir.IntType(8).as_pointer())
    number = ir.IntType(32)
    kind = ir.FunctionType(ir.VoidType(), [pointer.type, number, number, number])
    function = _get_function(builder.module, kind, "llvm.prefetch.p0i8")
    builder.call(function, [pointer, number(0), number(3), number(1)])


_compiled_prefetch: Any = intrinsic(_prefetch)


@overload(fetch_ahead, inline="always", strict=False)
def _choose_fetch_ahead(row: Any, index: Any) -> Any:
    del row, index
    return lambda row, index: _compiled_prefetch(row, index)


def sum_products(factors: Any, which: Any, sources: Any, sums: Any) -> None:
    """sums[part] = sum_k factors[:, which[k]] sources[:, k, part], kept in registers meanwhile.

    Numbers lie in lanes of one cache line: `LINE` bytes, 16 in single and 8 in double precision.

    Parameters
    ----------
    factors : (lines, n, lanes) float32 or float64
        Contiguous, like all the others.
    which : (m,) int64
    sources : (lines, m, parts, lanes)
    sums : (parts, lines * lanes)
        Overwritten.
    """
    products = np.einsum("lmi,lmpi->pli", factors[:, which], sources)
    sums[:] = products.reshape(sums.shape)


def _sum_products(context: Any, factors: Any, which: Any, sources: Any, sums: Any) -> Any:
    """The type of `sum_products` for four parts, and LLVM's instructions: 4 sums in registers."""
    del context
    parts = 4

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = [
            context.make_array(kind)(context, builder, value)
            for kind, value in zip(signature.args, arguments, strict=True)
        ]
        lanes = LINE * 8 // factors.dtype.bitwidth
        vector = ir.VectorType(context.get_value_type(factors.dtype), lanes)
        factor_data, _, source_data, sum_data = (
            builder.bitcast(array.data, vector.as_pointer()) for array in arrays
        )
        lines, terms = _unpack(builder, arrays[2].shape, 4)[:2]
        count = _unpack(builder, arrays[0].shape, 3)[1]
        totals = [_variable(builder, vector) for _ in range(parts)]

        def at(data: Any, index: Any) -> Any:
            return builder.gep(data, [index])

        def load(data: Any, index: Any) -> Any:
            value = builder.load(at(data, index))
            value.align = factors.dtype.bitwidth // 8
            return value

        with _counted_loop(builder, lines) as over_lines:
            line = over_lines.index
            for total in totals:
                builder.store(ir.Constant(vector, [0.0] * lanes), total)
            with _counted_loop(builder, terms) as over_terms:
                term = over_terms.index
                row = builder.load(at(arrays[1].data, term))
                place = builder.add(builder.mul(line, count), row)
                _emit_prefetch(
                    builder, at(factor_data, builder.add(place, line.type(_LINES_AHEAD)))
                )
                factor = load(factor_data, place)
                begin = builder.mul(builder.add(builder.mul(line, terms), term), line.type(parts))
                for part, total in enumerate(totals):
                    source = load(source_data, builder.add(begin, line.type(part)))
                    terms_so_far = builder.load(total)
                    builder.store(_emit_fma(builder, factor, source, terms_so_far), total)
            for part, total in enumerate(totals):
                place = builder.add(builder.mul(line.type(part), lines), line)
                stored = builder.store(builder.load(total), at(sum_data, place))
                stored.align = factors.dtype.bitwidth // 8
        return context.get_dummy_value()

    return types.none(factors, which, sources, sums), generate


def _emit_fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """The fused multiply-add of vectors, which llvmlite has for numbers only."""
    kind = "f32" if isinstance(a.type.element, ir.FloatType) else "f64"
    name = f"llvm.fma.v{a.type.count}{kind}"
    function = _get_function(builder.module, ir.FunctionType(a.type, [a.type] * 3), name)
    return builder.call(function, [a, b, c])


_compiled_sum_products: Any = intrinsic(_sum_products)


@overload(sum_products, inline="always", strict=False)
def _choose_sum_products(factors: Any, which: Any, sources: Any, sums: Any) -> Any:
    # Anything else than contiguous arrays would be read as if it were one.
    if any(array.layout != "C" for array in (factors, which, sources, sums)):
        return None
    return lambda factors, which, sources, sums: _compiled_sum_products(
        factors, which, sources, sums
    )
