"""Compiled kernels: one wrapper holds every compile option, one folder holds what was compiled.

Numba's cache does not notice an edit in a file other than the cached function's own, so the cache
folder is named by a hash of all sources of the package: an edit anywhere compiles anew, an unchanged
package never does.
"""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Self, TypeVar, cast

import numba
from numba.core import caching, compiler, compiler_lock, event

from ellipsoid_coupling.compiled.events import announce
from ellipsoid_coupling.compiled.threading_layer import layer
from ellipsoid_coupling.files.cache import cache_home, kernel_folder

__all__ = [
    "KERNEL_OPTIONS",
    "CompileTimer",
    "apart_kernel",
    "cache_home",
    "few_by_few",
    "for_each",
    "inline_kernel",
    "kernel",
    "one_by_one",
    "parallel_kernel",
    "plain",
    "shares",
    "threads_for",
    "view_kernel",
]

# Numba ships half of its types: this class has none.
_compiler: Any = compiler.Compiler

Function = TypeVar("Function", bound=Callable[..., Any])

# Strict floating point. With re-association or contraction the compiler rounds as it likes, and not
# alike in a process that compiles a kernel and in one that loads it from the cache: the linker may
# then choose another copy of an inner kernel. Sums whose order may be free are written in lanes, and
# fused multiply-adds as `intrinsics.fused`, so that this costs little.
KERNEL_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": False,
}


def _source_hash() -> str:
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


# Threads that wait for work shall sleep: by default they spin, and on a machine that is busy with
# something else two threads then take longer than one (measured: 27 s, one thread 16 s, asleep 13 s).
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
# But not at once: to wake them takes 60 us, which small grids would pay at every loop. So many turns
# (some 30 us) bridge the way from one kernel to the next: 2 us.
os.environ.setdefault("GOMP_SPINCOUNT", "2000")

_config: Any = numba.config
# Always a folder that can be written: else numba would write beside the sources, or fail.
_config.CACHE_DIR = str(kernel_folder(_source_hash()))
if "NUMBA_THREADING_LAYER" in os.environ:
    layer()  # told now if it is missing, not after a minute of compiling


# Types whose formulas come from outside of the package, see `leave_uncached`.
_uncached: set[type[Any]] = set()


def leave_uncached(kind: type[Any]) -> None:
    """Compile whatever takes an argument of type `kind`, a NamedTuple, anew in every session."""
    _uncached.add(kind)


def _is_uncached(kind: Any) -> bool:
    """Whether a type of numba's is one of these, or holds one."""
    return getattr(kind, "instance_class", None) in _uncached or any(
        map(_is_uncached, getattr(kind, "types", ()))
    )


def _goes_to_disk(signature: Any) -> bool:
    return not any(map(_is_uncached, getattr(signature, "args", signature)))


def _load(cache: Any, signature: Any, context: Any) -> Any:
    return (
        super(_Cache, cache).load_overload(signature, context) if _goes_to_disk(signature) else None
    )


def _save(cache: Any, signature: Any, result: Any) -> None:
    if _goes_to_disk(signature):
        super(_Cache, cache).save_overload(signature, result)


_FunctionCache: Any = caching.FunctionCache
_Cache: Any = type("_Cache", (_FunctionCache,), {"load_overload": _load, "save_overload": _save})


def _cached(function: Callable[..., Any], **options: Any) -> Any:
    """Compile `function` with numba, into a cache that leaves out what comes from outside."""
    compiled: Any = numba.njit(nogil=True, **(KERNEL_OPTIONS | options))(function)
    # With compilation switched off, kernels are what Python runs.
    if compiled is not function:
        compiled._cache = _Cache(function)
    return compiled


def kernel(function: Function) -> Function:
    """Compile `function` for one thread; the original stays reachable as ``.py_func``."""
    return cast(Function, _cached(function))


def view_kernel(function: Function) -> Function:
    """Compile `function` for one thread, without any allocation in it: for work on views of rows.

    Numba counts who refers to an array, atomically and for every view; ten views of a row of 150
    cells cost as much as its update. Where nothing can be allocated, nothing is counted; hence such
    a kernel must not return an array either, which its caller would believe counted.
    """
    return cast(Function, _cached(function, _nrt=False))


def _declare_apart(pipeline: Any) -> Any:
    """Numba's own passes, with the flag by which it declares a kernel's arguments apart."""
    pipeline.state.flags.noalias = True
    return _compiler.define_pipelines(pipeline)


_Apart = type("_Apart", (_compiler,), {"define_pipelines": _declare_apart})


def apart_kernel(function: Function) -> Function:
    """A `view_kernel` whose arguments share no memory that it writes to, so that its loops vectorise.

    To make sure of that at run time, as other kernels do, LLVM would have to compare every two
    addresses, and gives up at some ten. What two arguments may share is what is only read.
    """
    return cast(Function, _cached(function, _nrt=False, pipeline_class=_Apart))


def inline_kernel(function: Function) -> Function:
    """Compile a small scalar formula that every caller shall inline, so that its loop vectorises."""
    return cast(Function, _cached(function, inline="always"))


def parallel_kernel(function: Function) -> Function:
    """Compile `function` with its ``numba.prange`` loops shared among the threads."""
    return cast(Function, _cached(function, parallel=True))


def plain(function: Function) -> Function:
    """The Python function that a kernel was compiled from: its slow twin in tests."""
    compiled: Any = function
    return cast(Function, getattr(compiled, "py_func", function))


@contextmanager
def threads_for(work: int, least: int) -> Iterator[None]:
    """Inside, parallel kernels share `work` items among threads that get at least `least` each.

    A loop too short to share only waits for the other threads, the longer the busier the machine.
    The number of threads never changes a bit of a result.
    """
    before = numba.get_num_threads()
    numba.set_num_threads(max(1, min(before, work // least)))
    try:
        yield
    finally:
        numba.set_num_threads(before)


# Tasks that a thread takes at a time, at the most, where they are many and differ in length.
_CHUNK = 16


def few_by_few(tasks: int) -> AbstractContextManager[None]:
    """Inside, threads take some of so many tasks after others, the fewer the fewer there are."""
    fair = tasks // (16 * numba.get_num_threads())
    chunks: AbstractContextManager[None] = numba.parallel_chunksize(max(1, min(_CHUNK, fair)))
    return chunks


def one_by_one() -> AbstractContextManager[None]:
    """Inside, threads take one task after another: these differ in length, or threads in speed."""
    chunks: AbstractContextManager[None] = numba.parallel_chunksize(1)
    return chunks


def shares(count: int, most: int) -> list[tuple[int, int]]:
    """The ranges (first, end) that `count` things are dealt out in: `most` of them, none empty.

    One range that may be empty where there is nothing. Which ranges does not depend on the number of
    threads, so that sums over them always add up in the same order.
    """
    parts = max(1, min(most, count))
    return [(k * count // parts, (k + 1) * count // parts) for k in range(parts)]


@functools.cache
def _threads(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="ellipsoid")


# What a forked process must not find as it was: threads that it does not have, and a compiler that
# another thread was in the middle of.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_threads.cache_clear)
    _lock: Any = compiler_lock.global_compiler_lock
    os.register_at_fork(
        before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release
    )


def for_each(count: int, task: Callable[[int], None]) -> None:
    """Run ``task(0) .. task(count - 1)`` on numba's number of threads; tasks must be independent.

    For what Python does as well, and kernels that release its lock. The calling thread takes its share.
    Numba's own lock sees to it that a kernel is compiled once.
    """
    # One iterator for all threads, which hands out each number once: a job a thread, not one a task.
    left = iter(range(count))

    def work() -> None:
        for k in left:
            task(k)

    helpers = min(numba.get_num_threads(), count) - 1
    if helpers < 1:
        work()
        return
    jobs = [_threads(helpers).submit(work) for _ in range(helpers)]
    try:
        work()
    finally:
        wait(jobs)
    for job in jobs:
        job.result()


def _announce_start(happening: Any) -> None:
    announce(str(happening.data["dispatcher"].py_func.__name__))


def _announce_end(_happening: Any) -> None:
    announce(None)


# Numba ships half of its types: this class has none.
_Listener: Any = event.Listener
_Announcer = type(
    "_Announcer",
    (_Listener,),
    {
        "on_start": lambda _self, happening: _announce_start(happening),
        "on_end": lambda _self, happening: _announce_end(happening),
    },
)
_register: Any = event.register
_register("numba:compile", _Announcer())

_TimingListener: Callable[[], Any] = event.TimingListener


class CompileTimer:
    """A context that adds up the seconds that numba spends compiling, in `seconds`."""

    def __init__(self) -> None:
        self._listener = _TimingListener()
        self._context: AbstractContextManager[object] = event.install_listener(
            "numba:compile", self._listener
        )

    @property
    def seconds(self) -> float:
        """Seconds so far; 0 if everything came from the cache."""
        return float(self._listener.duration) if self._listener.done else 0.0

    def __enter__(self) -> Self:
        self._context.__enter__()
        return self

    def __exit__(self, *details: object) -> None:
        self._context.__exit__(None, None, None)
