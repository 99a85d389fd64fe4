"""Progress for people: a bar on a terminal, a plain line now and then in a log."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

# In a log: a line at each new stage, at its end, and when this many seconds have passed.
_SECONDS_BETWEEN_LINES = 10.0


class ProgressReporter:
    """Callable with (stage, part done between 0 and 1); use as a context.

    Attributes
    ----------
    console : rich.console.Console
        Standard error, so that results on standard output stay clean.
    """

    def __init__(self) -> None:
        self.console = Console(stderr=True)
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        self._stage = ""
        self._stage_started = self._last_line = time.monotonic()

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeRemainingColumn(),
            )
            self._bar = Progress(*columns, console=self.console, transient=True)
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, stage: str, part: float) -> None:
        """Tell that `stage` is done by `part`."""
        if stage != self._stage:
            self._stage, self._stage_started, self._last_line = stage, time.monotonic(), 0.0
            if self._bar is not None and self._task is not None:
                self._bar.remove_task(self._task)
            self._task = self._bar.add_task(stage, total=1.0) if self._bar is not None else None
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=part)
        elif self._bar is None:
            self._line(part)

    def _line(self, part: float) -> None:
        now = time.monotonic()
        if now - self._last_line < _SECONDS_BETWEEN_LINES and part < 1.0:
            return
        self._last_line = now
        spent = now - self._stage_started
        left = f", {spent * (1.0 - part) / part:.0f} s left" if 0.0 < part < 1.0 else ""
        sys.stderr.write(f"{self._stage}: {100 * part:.0f} %{left}\n")
        sys.stderr.flush()
