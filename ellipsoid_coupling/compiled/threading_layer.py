"""The threads below compiled loops: how they wait, what is refused before numba fails on it, forks.

Numba shares ``prange`` loops by one of three libraries. Of these

    omp         (GNU OpenMP, the usual one) keeps a team of threads that a forked process believes in
                but does not have, so that its first loop never ends; numba stops such a process.
    workqueue   ends the process when two threads enter loops at once.

Hence a team is given back before a fork and made anew on both sides when it is first used; and with
`workqueue` simulations in several threads take turns.
"""

from __future__ import annotations

import ctypes
import functools
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from ellipsoid_coupling.compiled.tuning import SPINS
from ellipsoid_coupling.errors import InputError

# Set before numba starts its threads. By default they spin while they wait for work, and on a machine
# that is busy with something else two threads then take longer than one (measured: 27 s, one thread
# 16 s, asleep 13 s).
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
os.environ.setdefault("GOMP_SPINCOUNT", str(SPINS))

_LAYERS = ("default", "tbb", "omp", "workqueue", "safe", "threadsafe", "forksafe")
# omp_pause_hard of OpenMP 5: the team's threads end, and its memory is freed.
_PAUSE_HARD = 2
# More than any machine has cores.
_MOST_THREADS = 100_000

_turn = threading.RLock()


def check_environment() -> None:
    """Refuse what numba would answer by a traceback when imported or when a loop first runs.

    Raises
    ------
    InputError
        For a NUMBA_NUM_THREADS or NUMBA_THREADING_LAYER that numba does not know.
    """
    threads = os.environ.get("NUMBA_NUM_THREADS")
    if threads is not None and not _is_number_of_threads(threads.strip()):
        expected = f"a whole number, 1 or more, at most {_MOST_THREADS}"
        raise InputError("NUMBA_NUM_THREADS", expected, repr(threads), "Change or unset it.")
    layer = os.environ.get("NUMBA_THREADING_LAYER")
    if layer is not None and layer.lower() not in _LAYERS:
        known = ", ".join(_LAYERS)
        raise InputError(
            "NUMBA_THREADING_LAYER", f"one of {known}", repr(layer), "Change or unset it."
        )


def _is_number_of_threads(text: str) -> bool:
    # Python reads no number of thousands of digits.
    few_digits = text.isdecimal() and len(text) <= len(str(_MOST_THREADS))
    return few_digits and 1 <= int(text) <= _MOST_THREADS


def _numba() -> Any:
    """Numba's own part for this, which it offers to nobody and ships no types for."""
    from numba.np.ufunc import parallel

    return parallel


@functools.cache
def layer() -> str:
    """The library that shares loops, started if it was not: "omp", "tbb" or "workqueue".

    Raises
    ------
    InputError
        If the one that NUMBA_THREADING_LAYER asks for is not installed.
    """
    parallel = _numba()
    try:
        parallel._launch_threads()
    except ValueError as error:
        # The first line says what; the others how conda would install it.
        found = str(error).splitlines()[0].rstrip(".")
        raise InputError(
            f"NUMBA_THREADING_LAYER={os.environ.get('NUMBA_THREADING_LAYER', 'default')}",
            "a library for threads that is installed", found, "Unset it, or install that library.",
        ) from None  # fmt: skip
    return str(parallel.threading_layer())


@contextmanager
def taking_turns() -> Iterator[None]:
    """Inside, no other thread is inside likewise where two at once would end the process."""
    if layer() != "workqueue":
        yield
        return
    with _turn:
        yield


def _omppool() -> Any:
    return import_module("numba.np.ufunc.omppool")


def _pause() -> Any:
    """OpenMP's function that ends a team, of the very library that numba uses; None without one."""
    # Nothing is imported for a fork: a program without numba's loops has no team.
    parallel: Any = sys.modules.get("numba.np.ufunc.parallel")
    if parallel is None or parallel._threading_layer != "omp":
        return None
    return getattr(ctypes.CDLL(_omppool().__file__), "omp_pause_resource_all", None)


def give_back_team() -> None:
    """Before a fork: end the forking thread's team; the next loop makes a new one."""
    pause = _pause()
    if pause is not None:
        pause(_PAUSE_HARD)


def start_anew() -> None:
    """In a forked process: make the lock anew, and tell numba that the team was given back.

    Where it could not be, numba ends this process with words at its first loop, which is better than
    a loop without an end.
    """
    global _turn
    _turn = threading.RLock()
    if _pause() is not None:
        launch = ctypes.CFUNCTYPE(None, ctypes.c_int)(_omppool().launch_threads)
        launch(_numba().NUM_THREADS)


# Absent where there is no fork.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=give_back_team, after_in_child=start_anew)
