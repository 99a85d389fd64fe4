"""Compiled kernels: one place holds every compile option, one folder holds what was compiled.

    kernel                  for one thread
    kernel(noalias=True)    on rows of arrays: arguments share no memory, nothing is allocated
    inline_kernel           a scalar formula that each caller inlines
    parallel_kernel         with `numba.prange` loops that threads share

Numba's cache does not notice an edit in a file other than the cached function's own, so the cache
folder is named by a hash of all sources of the package: an edit anywhere compiles anew, an unchanged
package never does.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeVar, cast, overload

import numba
from numba.core import compiler

from ellipsoid_coupling.compiled.kernel_forms import two_forms

# Registers the listener that tells of every kernel that is compiled.
from ellipsoid_coupling.compiled.threading_layer import layer
from ellipsoid_coupling.files.cache import kernel_folder

# Numba ships half of its types: this class has none.
_compiler: Any = compiler.Compiler

Function = TypeVar("Function", bound=Callable[..., Any])


def _source_hash() -> str:
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


_config: Any = numba.config
# Always a folder that can be written: else numba would write beside the sources, or fail.
_config.CACHE_DIR = str(kernel_folder(_source_hash()))
if "NUMBA_THREADING_LAYER" in os.environ:
    layer()  # a missing library is reported now, not after a minute of compiling


def cache_folder() -> Path:
    """The folder of the kernels that were compiled from these sources."""
    return Path(_config.CACHE_DIR)


def _compiled(function: Function, passes: Any = _compiler, **options: Any) -> Function:
    """Compile `function` with numba, into a cache that leaves out what comes from outside."""
    # With compilation switched off, kernels are what Python runs.
    if _config.DISABLE_JIT:
        return function
    return cast(Function, two_forms(function, passes, {"nogil": True} | options))


def _set_noalias(pipeline: Any) -> Any:
    """Numba's own passes, with the flag by which LLVM learns that arguments do not alias."""
    pipeline.state.flags.noalias = True
    return _compiler.define_pipelines(pipeline)


_NoaliasCompiler = type("_NoaliasCompiler", (_compiler,), {"define_pipelines": _set_noalias})


@overload
def kernel(function: Function) -> Function: ...


@overload
def kernel(*, noalias: Literal[True]) -> Callable[[Function], Function]: ...


def kernel(function: Any = None, *, noalias: bool = False) -> Any:
    """Compile a function for one thread; the original stays reachable as ``.py_func``.

    Parameters
    ----------
    noalias : bool
        For loops over rows of arrays. Memory that an argument is written through is reached through
        no other argument; memory that is only read may be shared. Without this LLVM compares every two
        addresses at run time before it uses vector instructions, and gives up at some ten of them.
        Nothing may be allocated in such a kernel, so that numba does not count references either,
        atomically and once a view: ten views of a row of 150 cells cost as much as its update. Hence
        it must not return an array, which its caller would believe counted.
    """
    if not noalias:
        return _compiled(function)

    def decorate(decorated: Function) -> Function:
        return _compiled(decorated, _NoaliasCompiler, _nrt=False)

    return decorate


def inline_kernel(function: Function) -> Function:
    """Compile a small scalar formula that every caller inlines, so that its loop vectorises.

    LLVM inlines it. Numba's own ``inline="always"`` would rewrite and type the formula anew in every
    caller, a quarter of all time to compile, and gives the same bits at the same speed.
    """
    return _compiled(function, forceinline=True)


def parallel_kernel(function: Function) -> Function:
    """Compile `function` with its ``numba.prange`` loops shared among the threads."""
    return _compiled(function, parallel=True)


def plain(function: Function) -> Function:
    """The Python function that a kernel was compiled from: its slow twin in tests."""
    compiled: Any = function
    return cast(Function, getattr(compiled, "py_func", function))
