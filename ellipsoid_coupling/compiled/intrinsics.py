"""Single instructions of the processor, to be used in kernels."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from ellipsoid_coupling.compiled.kernel_forms import in_kernels

# Numba ships half of its types: this function has none.
_get_function: Any = cgutils.get_or_insert_function


def fma(a: float, b: float, c: float) -> float:
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


@in_kernels(fma)
def _choose_fused(a: Any, b: Any, c: Any) -> Any:
    del a, b, c
    return lambda a, b, c: _compiled_fma(a, b, c)


def emit_prefetch(builder: Any, address: Any) -> None:
    """Write LLVM's prefetch of an address."""
    pointer = builder.bitcast(address, ir.IntType(8).as_pointer())
    number = ir.IntType(32)
    kind = ir.FunctionType(ir.VoidType(), [pointer.type, number, number, number])
    function = _get_function(builder.module, kind, "llvm.prefetch.p0i8")
    builder.call(function, [pointer, number(0), number(3), number(1)])
