"""Signals that ask a run to end are noticed between steps, so that a checkpoint comes first."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import ClassVar

# A lost connection sends SIGHUP; under nohup it is ignored, and stays so.
_CAUGHT = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


class Interruption:
    """The signal that has asked the run to end; `signal` is 0 without one.

    `pending` is a signal that was noted and not yet obeyed. A step whose kernels are being compiled may
    take minutes, and meanwhile a user wants to know that the signal was seen.
    """

    pending: ClassVar[int] = 0

    def __init__(self) -> None:
        self.signal = 0

    def note(self, number: int, _frame: FrameType | None) -> None:
        """Remember a signal; a second Ctrl-C ends the run at once."""
        if self.signal == signal.SIGINT == number:
            raise KeyboardInterrupt
        self.signal = Interruption.pending = number


def stopping() -> str:
    """In words that a signal was noted and is obeyed after the step in hand; "" if none was."""
    number = Interruption.pending
    if not number:
        return ""
    again = ", Ctrl-C again: at once" if number == signal.SIGINT else ""
    return f"stopping for {signal.Signals(number).name} after this step{again}: "


@contextmanager
def noticed() -> Iterator[Interruption]:
    """Inside, SIGTERM, SIGINT and SIGHUP are noted instead of obeyed.

    Only the main thread of a program may do so; elsewhere nothing changes and none is ever noted.
    """
    asked = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    # Ignored signals stay ignored, such as SIGINT in the background of a shell.
    caught = [number for number in _CAUGHT if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, asked.note) for number in caught}
    try:
        yield asked
    finally:
        Interruption.pending = 0
        for number, handler in before.items():
            signal.signal(number, handler)
