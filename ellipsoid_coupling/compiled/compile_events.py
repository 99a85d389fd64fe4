"""Numba's compile events: told to whoever listens (`events`), and timed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Self

from numba.core import event

from ellipsoid_coupling.compiled.events import announce

# Numba ships half of its types: these have none.
_Listener: Any = event.Listener
_register: Any = event.register
_TimingListener: Callable[[], Any] = event.TimingListener


def _announce_start(happening: Any) -> None:
    announce(str(happening.data["dispatcher"].py_func.__name__))


_Announcer = type(
    "_Announcer",
    (_Listener,),
    {
        "on_start": lambda _self, happening: _announce_start(happening),
        "on_end": lambda _self, _happening: announce(None),
    },
)
_register("numba:compile", _Announcer())


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
