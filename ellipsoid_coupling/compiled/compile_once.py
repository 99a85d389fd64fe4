"""Processes that need the same kernels at the same time: one compiles them, the others load them.

Numba's cache alone would let each of them compile everything, which takes as many times the work.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ellipsoid_coupling.compiled.jit import cache_folder

# The kinds of runs whose kernels this process has loaded.
_known: set[str] = set()
_guard = threading.Lock()


@contextmanager
def compiled_once(kind: str) -> Iterator[Callable[[], None]]:
    """Inside, this process is the only one that compiles for `kind` until it calls what is yielded.

    Parameters
    ----------
    kind : str
        Runs of one kind need the same kernels.

    Yields
    ------
    callable
        To be called once a step is done, when all kernels are there; the end of the context does so too.
        The lock is the system's: a kill releases it.
    """
    name = hashlib.sha256(kind.encode()).hexdigest()[:16]
    done = cache_folder() / f"compiled-{name}"
    if kind in _known or done.exists():
        yield lambda: None
        return
    handle = os.open(done.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    fcntl.flock(handle, fcntl.LOCK_EX)
    held = [handle]

    def ready() -> None:
        with _guard:
            if not held:
                return
            held.clear()
            _known.add(kind)
        done.touch()
        os.close(handle)

    try:
        yield ready
    finally:
        with _guard:
            failed = bool(held)
            held.clear()
        if failed:
            os.close(handle)
