"""Functions that Python runs as they are, and that kernels compile into themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ellipsoid_coupling.compiled.kernel_forms import in_kernels

Function = TypeVar("Function", bound=Callable[..., Any])


def jitable(function: Function) -> Function:
    """Let kernels call `function`, which stays what Python runs.

    For an algorithm whose parts are kernels in one place and Python in another, by the types of its
    arguments: it is written once (`dispatch.chosen_by_type` chooses the parts).
    """

    def choose(*arguments: Any) -> Function:
        del arguments
        return function

    in_kernels(function, inlined=False, cached=True)(choose)
    return function
