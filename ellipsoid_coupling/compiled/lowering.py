"""How a Python function gets a compiled twin that is written as LLVM's instructions."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.extending import lower_builtin, type_callable

# Numba ships half of its types: these have none.
_lower: Any = lower_builtin
_callable: Any = type_callable


def compile_as(
    function: Callable[..., Any],
    result: Callable[..., Any],
    emit: Callable[[Any, Any, Any, list[Any]], Any],
) -> None:
    """Make `emit` what kernels run for `function`, which stays what Python runs.

    Parameters
    ----------
    function : of a fixed number of arguments
    result : (typing context, numba's types of the arguments) -> type of the result
    emit : (context, builder, signature, arguments) -> value, writes the instructions
    """
    signature = inspect.signature(function)

    def make_typer(context: Any) -> Any:
        def typer(*operands: Any) -> Any:
            return result(context, *operands)

        # Numba would take the operands for one tuple.
        vars(typer)["pysig"] = signature
        return typer

    _callable(function)(make_typer)
    _lower(function, *[types.Any] * len(signature.parameters))(emit)
