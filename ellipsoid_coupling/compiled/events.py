"""Listeners that are told which kernel is being compiled: by `compile_events`, for `progress`.

This module imports no compiler, so that a command can listen before it does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

# Called with the name of a kernel whose compiling starts, and with None when it has ended.
Listener = Callable[[str | None], None]

_listeners: list[Listener] = []


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Inside, `listener` is told of every kernel that is compiled, in whichever thread."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def announce(kernel: str | None) -> None:
    """Tell all listeners of the start (a name) or the end (None) of compiling a kernel."""
    for listener in tuple(_listeners):
        listener(kernel)
