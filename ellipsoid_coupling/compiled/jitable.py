"""Functions that Python runs as they are, and that kernels compile into themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.extending import register_jitable

from ellipsoid_coupling.compiled.jit import KERNEL_OPTIONS

Function = TypeVar("Function", bound=Callable[..., Any])

# Numba ships half of its types: this has none.
_register: Any = register_jitable


def jitable(function: Function) -> Function:
    """Let kernels call `function`, which stays what Python runs.

    For an algorithm whose parts are kernels in one place and Python in another, by the types of its
    arguments: it is written once (`dispatch.chosen_by_type` chooses the parts).
    """
    registered: Function = _register(**KERNEL_OPTIONS)(function)
    return registered
