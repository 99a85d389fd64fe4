"""Arithmetic on small tuples, so that a kernel reads like its formula: ``add(scale(decay, v), gains)``.

All fields of a cell stand side by side in a tuple whose length is known when a kernel is compiled; a
component that a scene does not have makes it shorter. Each function takes tuples of one length and
numbers, which count for every element; of empty tuples it makes an empty tuple, and no code. Rounding is
that of the plain operators, element by element: nothing is fused but `fused_axpy`.

Python has the same functions, for tests and for kernels that run without being compiled.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError

from ellipsoid_coupling.compiled.lowering import compile_as

# Numba ships half of its types: these have none.
_unpack: Any = cgutils.unpack_tuple
_tuple_of: Any = types.BaseTuple.from_types

Number = TypeVar("Number", int, float)
Values = tuple[float, ...]


def _columns(*operands: Any) -> Any:
    """The operands element by element; numbers count for every element."""
    # The first tuple gives the length; `zip` then refuses others of another length.
    count = next(len(operand) for operand in operands if isinstance(operand, tuple))
    rows = (o if isinstance(o, tuple) else (o,) * count for o in operands)
    return zip(*rows, strict=True)


def add(a: tuple[Number, ...] | Number, b: tuple[Number, ...] | Number) -> tuple[Number, ...]:
    """A + b."""
    return tuple(x + y for x, y in _columns(a, b))


def sub(a: tuple[Number, ...] | Number, b: tuple[Number, ...] | Number) -> tuple[Number, ...]:
    """A - b."""
    return tuple(x - y for x, y in _columns(a, b))


def mul(a: tuple[Number, ...] | Number, b: tuple[Number, ...] | Number) -> tuple[Number, ...]:
    """A b."""
    return tuple(x * y for x, y in _columns(a, b))


def div(a: Values | float, b: Values | float) -> Values:
    """A / b."""
    return tuple(x / y for x, y in _columns(a, b))


def scale(factor: float, a: Values) -> Values:
    """Factor a."""
    return tuple(factor * x for x in a)


def axpy(
    a: tuple[Number, ...] | Number, x: tuple[Number, ...] | Number, y: tuple[Number, ...] | Number
) -> tuple[Number, ...]:
    """A x + y, rounded twice."""
    return tuple(u * v + w for u, v, w in _columns(a, x, y))


def fused_axpy(a: Values | float, x: Values | float, y: Values | float) -> Values:
    """A x + y, in kernels with one rounding, as `intrinsics.fma`; plain Python rounds twice."""
    return tuple(u * v + w for u, v, w in _columns(a, x, y))


def maximum(a: Values | float, b: Values | float) -> Values:
    """The larger one; `a` where one of them is not a number."""
    return tuple(max(x, y) for x, y in _columns(a, b))


def minimum(a: Values | float, b: Values | float) -> Values:
    """The smaller one; `a` where one of them is not a number."""
    return tuple(min(x, y) for x, y in _columns(a, b))


def absolute(a: Values) -> Values:
    """The magnitude."""
    return tuple(abs(x) for x in a)


def select(condition: Any, a: Values | float, b: Values | float) -> Values:
    """`a` where the condition holds, else `b`; both are computed. One condition may count for all."""
    return tuple(x if c else y for c, x, y in _columns(condition, a, b))


def fill(value: Number, like: tuple[Any, ...]) -> tuple[Number, ...]:
    """`value` as often as `like` has elements."""
    return (value,) * len(like)


def total(values: Values) -> float:
    """The sum, in order; 0 of none."""
    return sum(values)


# The same in kernels: LLVM's instructions, element by element.


def _instruction(floating: str, whole: str) -> Callable[..., Any]:
    """The builder's instruction of that name, for numbers or for integers."""

    def write(builder: Any, floats: bool, *v: Any) -> Any:
        return getattr(builder, floating if floats else whole)(*v)

    return write


_add, _sub, _mul = (_instruction(f"f{name}", name) for name in ("add", "sub", "mul"))


def _div(builder: Any, floats: bool, a: Any, b: Any) -> Any:
    if not floats:
        raise TypingError("division is for floating point numbers")
    return builder.fdiv(a, b)


def _axpy(builder: Any, floats: bool, a: Any, x: Any, y: Any) -> Any:
    return _add(builder, floats, _mul(builder, floats, a, x), y)


def _fused_axpy(builder: Any, floats: bool, a: Any, x: Any, y: Any) -> Any:
    if not floats:
        raise TypingError("fused_axpy is for floating point numbers")
    return builder.fma(a, x, y)


def _second_if(comparison: str) -> Callable[..., Any]:
    """The second one if it compares so with the first one."""

    def write(builder: Any, floats: bool, a: Any, b: Any) -> Any:
        # Ordered comparisons are false for NaN, so that the first operand stays, as with Python's
        # max.
        compare = builder.fcmp_ordered if floats else builder.icmp_signed
        return builder.select(compare(comparison, b, a), b, a)

    return write


def _absolute(builder: Any, floats: bool, a: Any) -> Any:
    if not floats:
        raise TypingError("absolute is for floating point numbers")
    return builder.call(builder.module.declare_intrinsic("llvm.fabs", [a.type]), [a])


def _select(builder: Any, floats: bool, condition: Any, a: Any, b: Any) -> Any:
    del floats
    return builder.select(condition, a, b)


def _fill(builder: Any, floats: bool, value: Any, like: Any) -> Any:
    del builder, floats, like
    return value


def _is_spread(kind: Any) -> bool:
    return isinstance(kind, types.BaseTuple)


def _common(kinds: Sequence[Any]) -> Any:
    """The type of an operation's elements: that which all operands are brought to."""
    single = [kind.dtype if _is_spread(kind) else kind for kind in kinds]
    return types.float64 if any(isinstance(kind, types.Float) for kind in single) else types.int64


def _elementwise(function: Any, write: Callable[..., Any], valued: slice = slice(None)) -> None:
    """Compile `function` as `write` for each element; `valued` are the operands that have its type."""

    def result(context: Any, *kinds: Any) -> Any:
        del context
        # Lengths are part of the types: a mismatch is found when the kernel is compiled.
        counts = {kind.count for kind in kinds if _is_spread(kind)}
        if len(counts) != 1:
            raise TypingError(f"tuples of one length are needed, not {kinds}")
        (count,) = counts
        return _tuple_of([_common(kinds[valued])] * count if count else [])

    def emit(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
        made, count = signature.return_type, signature.return_type.count
        columns = []
        for k, (kind, argument) in enumerate(zip(signature.args, arguments, strict=True)):
            single = kind.dtype if _is_spread(kind) and count else kind
            column = _unpack(builder, argument, count) if _is_spread(kind) else [argument] * count
            if k in range(len(arguments))[valued]:
                # Integers become floating point numbers where any operand is one; conditions stay.
                column = [context.cast(builder, one, single, made.dtype) for one in column]
            columns.append(column)
        floats = count > 0 and isinstance(made.dtype, types.Float)
        values = [write(builder, floats, *row) for row in zip(*columns, strict=True)]
        return context.make_tuple(builder, made, values)

    compile_as(function, result, emit)


def _emit_total(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    del context
    numbers = _unpack(builder, arguments[0], signature.args[0].count)
    return functools.reduce(builder.fadd, numbers) if numbers else ir.Constant(ir.DoubleType(), 0.0)


_elementwise(add, _add)
_elementwise(sub, _sub)
_elementwise(mul, _mul)
_elementwise(scale, _mul)
_elementwise(div, _div)
_elementwise(axpy, _axpy)
_elementwise(fused_axpy, _fused_axpy)
_elementwise(maximum, _second_if(">"))
_elementwise(minimum, _second_if("<"))
_elementwise(absolute, _absolute)
_elementwise(select, _select, slice(1, None))
_elementwise(fill, _fill, slice(1))
compile_as(total, lambda context, values: types.float64, _emit_total)  # noqa: ARG005
