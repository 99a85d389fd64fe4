"""Pieces of LLVM's instructions for whole vectors, of which sums in registers are written."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from llvmlite import ir
from numba.core import cgutils

# Numba ships half of its types: these functions have none.
_get_function: Any = cgutils.get_or_insert_function
counted_loop: Any = cgutils.for_range
variable: Any = cgutils.alloca_once
unpack: Any = cgutils.unpack_tuple

# Bytes of a cache line, and of the widest vector of today's processors.
LINE = 64
# Numbers in a line, or in a vector, in double precision.
DOUBLES = LINE // 8
VECTOR = ir.VectorType(ir.DoubleType(), DOUBLES)


def load_line(builder: Any, data: Any, index: Any) -> Any:
    """The vector with this index, whatever its numbers are, wherever they begin."""
    value = builder.load(builder.gep(data, [index]))
    value.align = bytes_each(value.type)
    return value


def bytes_each(vector: Any) -> int:
    """Of one of a vector's numbers."""
    return LINE // int(vector.count)


def times(builder: Any, index: Any, factor: int) -> Any:
    """An index times a number that is known."""
    return builder.mul(index, index.type(factor))


def blocks_of(builder: Any, count: Any, size: int) -> Any:
    """How many blocks of `size` hold all of `count`; the last one need not be full."""
    return builder.sdiv(builder.add(count, count.type(size - 1)), count.type(size))


def indices_of_block(builder: Any, block: Any, count: Any, size: int) -> list[Any]:
    """Indices of one block; padding repeats the last index, whose result is simply written twice."""
    last = builder.sub(count, count.type(1))
    first = times(builder, block, size)
    each = [builder.add(first, first.type(k)) for k in range(size)]
    return [builder.select(builder.icmp_signed("<", k, count), k, last) for k in each]


def index_at(builder: Any, starts: tuple[Any, Any], *steps: tuple[int, Any]) -> Any:
    """The sum of both starts and of `count` times each step."""
    index = builder.add(*starts)
    for count, step in steps:
        index = builder.add(index, builder.mul(step.type(count), step))
    return index


def vector_at(builder: Any, data: Any, index: Any) -> Any:
    """The address of `DOUBLES` numbers."""
    vector = ir.VectorType(data.type.pointee, DOUBLES)
    return builder.bitcast(builder.gep(data, [index]), vector.as_pointer())


def load_doubles(builder: Any, data: Any, index: Any) -> Any:
    """`DOUBLES` numbers, wherever they begin, in double precision."""
    value = builder.load(vector_at(builder, data, index))
    single = isinstance(data.type.pointee, ir.FloatType)
    value.align = 4 if single else 8
    return builder.fpext(value, VECTOR) if single else value


def broadcast(builder: Any, value: Any, vector: Any = VECTOR) -> Any:
    """A vector of the same number."""
    empty = ir.Constant(vector, ir.Undefined)
    one = builder.insert_element(empty, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, empty, _lanes(0 for _ in range(vector.count)))


def sum_lanes(builder: Any, vector: Any) -> Any:
    """The sum of a vector's numbers: halves are added until one is left."""
    count = vector.type.count
    while count > 1:
        count //= 2
        empty = ir.Constant(vector.type, ir.Undefined)
        low, high = (
            builder.shuffle_vector(vector, empty, _lanes(range(k, k + count))) for k in (0, count)
        )
        vector = builder.fadd(low, high)
    return builder.extract_element(vector, ir.Constant(ir.IntType(32), 0))


def _lanes(which: Iterable[int]) -> Any:
    lanes = list(which)
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), lanes)


def fma(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """The fused multiply-add of vectors, which llvmlite has for numbers only."""
    kind = "f32" if isinstance(a.type.element, ir.FloatType) else "f64"
    name = f"llvm.fma.v{a.type.count}{kind}"
    function = _get_function(builder.module, ir.FunctionType(a.type, [a.type] * 3), name)
    return builder.call(function, [a, b, c])
