"""Work shared among threads: how many take part, how much each takes, and loops over Python calls."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numba
from numba.core import compiler_lock

from ellipsoid_coupling.compiled.tuning import MOST_TASKS_AT_ONCE, TASKS_PER_THREAD


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


def small_chunks(tasks: int) -> AbstractContextManager[None]:
    """Inside, threads take a few of so many tasks at a time.

    Small chunks balance tasks that differ in length; large ones save the way to the scheduler.
    """
    fair = tasks // (TASKS_PER_THREAD * numba.get_num_threads())
    size = max(1, min(MOST_TASKS_AT_ONCE, fair))
    chunks: AbstractContextManager[None] = numba.parallel_chunksize(size)
    return chunks


def single_task_chunks() -> AbstractContextManager[None]:
    """Inside, threads take one task at a time: these differ in length, or threads in speed."""
    chunks: AbstractContextManager[None] = numba.parallel_chunksize(1)
    return chunks


def chunk_ranges(count: int, most: int) -> list[tuple[int, int]]:
    """Cut 0 .. count - 1 into at most `most` ranges (first, end) of about one length.

    No range is empty, except the only one of count = 0. The ranges do not depend on the number of
    threads, so that sums over them always add up in the same order. `loops.chunk` is the same cut in
    kernels.
    """
    parts = max(1, min(most, count))
    return [(k * count // parts, (k + 1) * count // parts) for k in range(parts)]


@functools.cache
def _threads(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="ellipsoid")


# A forked process has none of these threads, and must not inherit a compiler that another thread was
# in the middle of using.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_threads.cache_clear)
    _lock: Any = compiler_lock.global_compiler_lock
    os.register_at_fork(
        before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release
    )


def for_each(count: int, task: Callable[[int], None]) -> None:
    """Run ``task(0) .. task(count - 1)`` on numba's number of threads; tasks must be independent.

    For kernels that release Python's lock, and for numpy, which does so too. The calling thread takes
    part. Numba's own lock makes sure that a kernel is compiled once.
    """
    # One iterator for all threads hands out each number once: a job a thread, not one a task.
    numbers = iter(range(count))

    def work() -> None:
        for k in numbers:
            task(k)

    # The calling thread is one of them.
    helpers = min(numba.get_num_threads(), count) - 1
    if helpers < 1:
        work()
        return
    jobs = [_threads(helpers).submit(work) for _ in range(helpers)]
    try:
        work()
    finally:
        wait(jobs)
    # Raises what a task has raised.
    for job in jobs:
        job.result()
