"""Progress: a bar on a terminal, plain lines in a log, and lines while kernels are compiled."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from types import TracebackType
from typing import ClassVar, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from ellipsoid_coupling.compiled.events import listening
from ellipsoid_coupling.errors import readable
from ellipsoid_coupling.files.signals import stopping

# Before the number of kernels so far.
COMPILING = "compiling (once per machine and version)"

# Seconds between two checks whether a log needs a line, and the longest silence: during the work, and
# before it begins.
_BEAT, _SILENCE, _PATIENCE = 0.25, 1.0, 0.5
# From twenty minutes on the silence is this part of the time so far, to keep the log of a night short.
_PART_OF_TIME = _SILENCE / 1200.0


def _write(line: str) -> None:
    try:
        sys.stderr.write(line + "\n")
        sys.stderr.flush()
    except (AttributeError, OSError, ValueError):
        return  # without a reader the run continues


class _Heart:
    """A thread that calls `beat` four times a second, as long as it is entered."""

    def __init__(self, beat: Callable[[], None]) -> None:
        self._beat = beat
        self._ended = threading.Event()
        # A daemon, so that the program can end without waiting for it.
        self._thread = threading.Thread(target=self._live, name="ellipsoid-progress", daemon=True)

    def _live(self) -> None:
        while not self._ended.wait(_BEAT):
            self._beat()

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_details: object) -> None:
        self._ended.set()
        self._thread.join()


class Waiting:
    """Lines for a command without progress of its own: while it loads, and while it writes its results.

    Nothing is written in the first half second, nor while a `ProgressReporter` is entered. Compiling is
    told as such, and at once. Use as a context; `clock` as there.
    """

    busy: ClassVar[int] = 0  # the reporters that are entered now

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._last_line = clock()
        self._what, self._pause = "loading", _PATIENCE
        self._compiling, self._compiled = 0, 0
        self._entered = ExitStack()

    def __enter__(self) -> Self:
        self._entered.enter_context(_Heart(self.beat))
        self._entered.enter_context(listening(self._on_compiling))
        return self

    def __exit__(self, *_details: object) -> None:
        self._entered.close()

    def _on_compiling(self, kernel: str | None) -> None:
        """A kernel's compiling starts, or has ended; kernels are compiled within others."""
        self._compiling += 1 if kernel is not None else -1
        self._compiled += kernel is None
        if self._compiling == 1 and self._compiled == 0 and not Waiting.busy:
            self._line()

    def _line(self) -> None:
        self._last_line, self._pause = self._clock(), _SILENCE
        kernels = f"{COMPILING}, {self._compiled} kernels so far"
        _write(f"{kernels if self._compiling > 0 else self._what} ...")

    def beat(self) -> None:
        """Write a line if the command has been silent for long."""
        now = self._clock()
        if Waiting.busy:
            self._last_line, self._what, self._pause = now, "finishing", _PATIENCE
        elif now - self._last_line >= self._pause:
            self._line()


class ProgressReporter:
    """Callable with (stage, part done between 0 and 1); use as a context.

    Its first line comes at once, and in the first twenty minutes two seconds never pass without one: a
    thread writes lines while the work reports nothing.

    Parameters
    ----------
    what : str
        The text until the first stage.
    clock : callable
        The seconds; `time.monotonic` but for tests.

    Attributes
    ----------
    console : rich.console.Console
        Standard error, so that results on standard output stay clean.
    """

    def __init__(self, what: str = "starting", clock: Callable[[], float] = time.monotonic) -> None:
        self.console = Console(stderr=True)
        self._clock = clock
        self._began = self._stage_began = self._last_line = clock()
        self._stage, self._part, self._stage_part = readable(what), 0.0, 0.0
        self._compiling, self._compiled = 0, 0
        self._bar: Progress | None = None
        self._task: TaskID | None = None
        # Lines come from the work and from the heart.
        self._lock = threading.RLock()
        self._entered = ExitStack()

    def __enter__(self) -> Self:
        if sys.stderr is not None and sys.stderr.isatty():
            columns = (
                SpinnerColumn(),
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                TextColumn("{task.percentage:>3.0f} %"),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
            )
            self._bar = Progress(*columns, console=self.console, transient=True)
            self._task = self._bar.add_task(self._stage, total=1.0)
            self._entered.enter_context(self._bar)
        else:
            self._line()
            self._entered.enter_context(_Heart(self.beat))
        Waiting.busy += 1
        self._entered.enter_context(listening(self._on_compiling))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        Waiting.busy -= 1
        self._entered.close()

    def __call__(self, stage: str, part: float) -> None:
        """Show that a part of `stage` is done; a stage may quote names from anywhere."""
        stage = readable(stage)
        with self._lock:
            new, self._part = stage != self._stage, part
            if new:
                self._stage, self._stage_began, self._stage_part = stage, self._clock(), part
            if self._bar is not None and self._task is not None:
                if new:
                    self._bar.reset(self._task, description=stage)
                self._bar.update(self._task, completed=part, description=stage)
            elif new or part >= 1.0:
                self._line()
            else:
                self.beat()

    def beat(self) -> None:
        """Write a line if none has been written for long."""
        with self._lock:
            now = self._clock()
            if now - self._last_line >= max(_SILENCE, _PART_OF_TIME * (now - self._began)):
                self._line()

    def _on_compiling(self, kernel: str | None) -> None:
        """A kernel's compiling starts, or has ended; kernels are compiled within others."""
        with self._lock:
            self._compiling += 1 if kernel is not None else -1
            self._compiled += kernel is None
            if self._bar is not None and self._task is not None:
                self._bar.update(self._task, description=self._status())
            elif self._compiling == 1 and self._compiled == 0:
                self._line()

    def _status(self) -> str:
        if self._compiling > 0:
            return f"{stopping()}{self._stage}: {COMPILING}, {self._compiled} kernels so far"
        return stopping() + self._stage

    def _line(self) -> None:
        now = self._clock()
        self._last_line = now
        spent, done = now - self._stage_began, self._part - self._stage_part
        if self._compiling > 0:
            line = f"{self._status()}, {now - self._began:.0f} s"
        else:
            # A stage may begin with a part done: its speed is that of what it adds.
            known = done > 0.0 and self._part < 1.0
            left = f", {spent * (1.0 - self._part) / done:.0f} s left" if known else ""
            line = f"{self._status()}: {100 * self._part:.0f} %{left}"
        _write(line)
