"""Progress in a log, by a clock that the test sets: what is written, and that nothing stays silent."""

from __future__ import annotations

import io
import os
import pty
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise

import pytest

from ellipsoid_coupling.compiled.events import announce
from ellipsoid_coupling.files.signals import noticed, stopping
from ellipsoid_coupling.output import progress
from ellipsoid_coupling.output.progress import COMPILING, ProgressReporter, Waiting

Lines = Callable[[], list[str]]


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """A clock, and no thread that beats beside the test."""
    monkeypatch.setattr(progress._Heart, "_live", lambda _self: None)
    return Clock()


@pytest.fixture
def lines(capsys: pytest.CaptureFixture[str]) -> Lines:
    return lambda: capsys.readouterr().err.splitlines()


def test_the_first_line_comes_before_anything_else(clock: Clock, lines: Lines) -> None:
    with ProgressReporter("run", clock):
        assert lines() == ["run: 0 %"]


def test_the_first_kernel_is_told_at_once_and_the_others_are_counted(
    clock: Clock, lines: Lines
) -> None:
    """Kernels are compiled within others; a cached run compiles none and says nothing of it."""
    with ProgressReporter("run", clock) as report:
        lines()
        announce("outer")
        assert lines() == [f"run: {COMPILING}, 0 kernels so far, 0 s"]
        announce("inner")
        announce(None)
        assert lines() == []
        clock.now += 2.0
        report.beat()
        assert lines() == [f"run: {COMPILING}, 1 kernels so far, 2 s"]
        announce(None)
        clock.now += 2.0
        report.beat()
        assert lines() == ["run: 0 %"]
    announce("after the end")
    announce(None)
    assert lines() == []


@pytest.mark.usefixtures("obeyed")
def test_a_signal_that_waits_for_the_step_in_hand_is_told(clock: Clock, lines: Lines) -> None:
    """A step whose kernels are being compiled takes minutes, and Ctrl-C seems to do nothing."""
    with ProgressReporter("run", clock) as report, noticed():
        lines()
        announce("kernel")
        lines()
        os.kill(os.getpid(), signal.SIGTERM)
        clock.now += 2.0
        report.beat()
        (line,) = lines()
        # As many as tests before this one have compiled in this process.
        assert re.match(
            r"stopping for SIGTERM after this step: run: compiling \(.*\), \d+ kernels", line
        )
        announce(None)
        os.kill(os.getpid(), signal.SIGINT)
        clock.now += 2.0
        report.beat()
        assert lines() == ["stopping for SIGINT after this step, Ctrl-C again: at once: run: 0 %"]
    assert stopping() == ""


def test_no_two_seconds_without_a_line_in_twenty_minutes(clock: Clock, lines: Lines) -> None:
    """Whatever the work says, a few times a second or never; later a night takes a few thousand."""
    with ProgressReporter("run", clock) as report:
        told = [clock.now]
        for beat in range(4 * 1200):
            clock.now += 0.25
            if beat % 3 == 0:
                report("stage", 0.5)
            report.beat()
            told += [clock.now] * len(lines())
        assert max(b - a for a, b in pairwise(told)) < 2.0
        for _ in range(10 * 3600):
            clock.now += 1.0
            report.beat()
        assert len(lines()) < 5500


def test_stages_are_told_at_their_start_and_end(clock: Clock, lines: Lines) -> None:
    with ProgressReporter("run", clock) as report:
        report("one", 0.0)
        clock.now += 0.5
        report("one", 0.5)
        report("one", 1.0)
        report("two", 0.25)
    assert lines() == ["run: 0 %", "one: 0 %", "one: 100 %", "two: 25 %"]


def test_a_stage_steers_no_terminal_and_stays_one_line(clock: Clock, lines: Lines) -> None:
    """A received folder may be called anything, and stages quote its name."""
    with ProgressReporter("a\x1b[31m\nb", clock) as report:
        report("flow c\x1b[2J\nx\r\u202e: mesh", 0.0)
        report("flow c\x1b[2J\nx\r\u202e: mesh", 0.5)
    assert lines() == [
        r"a\x1b[31m b: 0 %",
        r"flow c\x1b[2J x\r\u202e: mesh: 0 %",
    ]


def test_the_time_left_is_that_of_the_stage(clock: Clock, lines: Lines) -> None:
    with ProgressReporter("run", clock) as report:
        clock.now += 100.0
        report("stage", 0.0)
        clock.now += 30.0
        report("stage", 0.75)
    assert lines()[-1] == "stage: 75 %, 10 s left"


def test_a_stage_that_begins_later_tells_its_own_speed(clock: Clock, lines: Lines) -> None:
    """From 50 to 60 % in 20 s: 80 s for the other 40 %, and nothing is known at its beginning."""
    with ProgressReporter("run", clock) as report:
        clock.now += 100.0
        report("second", 0.5)
        assert lines()[-1] == "second: 50 %"
        clock.now += 20.0
        report("second", 0.6)
    assert lines()[-1] == "second: 60 %, 80 s left"


def test_a_command_that_loads_says_so_after_a_while(clock: Clock, lines: Lines) -> None:
    """Before its reporter begins and after it has ended; a short one says nothing."""
    with Waiting(clock) as waiting:
        waiting.beat()
        clock.now += 0.4
        waiting.beat()
        assert lines() == []
        clock.now += 0.2
        waiting.beat()
        assert lines() == ["loading ..."]
        clock.now += 0.6
        waiting.beat()
        assert lines() == []
        clock.now += 0.6
        waiting.beat()
        assert lines() == ["loading ..."]
        with ProgressReporter("run", clock):
            clock.now += 10.0
            waiting.beat()
            assert lines() == ["run: 0 %"]
        clock.now += 1.0
        waiting.beat()
        assert lines() == ["finishing ..."]


def test_a_command_without_a_reporter_tells_of_compiling(clock: Clock, lines: Lines) -> None:
    """At once, then as often as of anything; a reporter tells it instead where there is one."""
    with Waiting(clock) as waiting:
        announce("outer")
        assert lines() == [f"{COMPILING}, 0 kernels so far ..."]
        announce("inner")
        announce(None)
        clock.now += 1.1
        waiting.beat()
        assert lines() == [f"{COMPILING}, 1 kernels so far ..."]
        announce(None)
        clock.now += 1.1
        waiting.beat()
        assert lines() == ["loading ..."]
    announce("after the end")
    announce(None)
    with Waiting(clock), ProgressReporter("run", clock):
        announce("kernel")
        announce(None)
        assert lines() == ["run: 0 %", f"run: {COMPILING}, 0 kernels so far, 0 s"]


class Terminal:
    """The far end of a pseudo-terminal: what a program has written to it."""

    def __init__(self) -> None:
        self._far, near = pty.openpty()
        self.stream = os.fdopen(near, "w", encoding="utf-8")

    def shown(self) -> str:
        """What has been written so far, less the codes that move the cursor and colour."""
        os.set_blocking(self._far, False)
        text = b""
        with suppress(BlockingIOError):
            while piece := os.read(self._far, 65536):
                text += piece
        return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text.decode())

    def close(self) -> None:
        self.stream.close()
        os.close(self._far)


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    made = Terminal()
    yield made
    made.close()


def test_a_terminal_shows_what_is_compiled_and_what_is_done(
    clock: Clock, terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drawn by `refresh` here and by rich ten times a second in a program, whatever the work does."""
    # Here and not in the fixture: pytest puts its own stream there before it calls a test.
    monkeypatch.setattr(sys, "stderr", terminal.stream)
    monkeypatch.setenv("COLUMNS", "150")
    monkeypatch.setenv("TERM", "xterm")
    with ProgressReporter("run", clock) as report:
        bar = report._bar
        assert bar is not None
        assert bar.live.auto_refresh
        assert bar.live.refresh_per_second >= 2.0
        bar.refresh()
        assert "run" in terminal.shown()
        announce("kernel")
        bar.refresh()
        assert f"run: {COMPILING}, 0 kernels so far" in terminal.shown()
        announce(None)
        report("stage", 0.25)
        bar.refresh()
        text = terminal.shown()
        assert "stage" in text
        assert "25 %" in text


@pytest.mark.parametrize("stream", [None, io.StringIO()])
def test_a_stream_that_is_closed_stops_nothing(
    stream: io.StringIO | None, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    if stream is not None:
        stream.close()
    with ProgressReporter("run", clock) as report:
        monkeypatch.setattr(sys, "stderr", stream)
        report("stage", 0.5)
        report("stage", 1.0)


def test_the_heart_beats_until_it_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """A real thread, waited for: it is not the clock that ends this test."""
    monkeypatch.setattr(progress, "_BEAT", 0.001)
    beats = threading.Semaphore(0)
    with progress._Heart(beats.release) as heart:
        for _ in range(3):
            beats.acquire()
    assert not heart._thread.is_alive()
