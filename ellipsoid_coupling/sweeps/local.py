"""Points in this process, or in several of this machine.

The processes are spawned: a fork would copy locks that threads hold. Each gets its part of the cores.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any

from ellipsoid_coupling.errors import Interrupted
from ellipsoid_coupling.files.signals import Interruption, noticed
from ellipsoid_coupling.sweeps.job import Job
from ellipsoid_coupling.sweeps.points import Point
from ellipsoid_coupling.sweeps.records import Record, failed

# Called with the parts of the points in hand that are done, summed.
InHand = Callable[[float], None]

# Libraries that start threads of their own read these when they are loaded.
_THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
# Seconds between two messages of a worker about its point, and between two looks for signals.
_TELL, _LOOK = 0.25, 0.25
# A point whose process ends is given to another one so often.
_TRIES = 3


def run_here(job: Job, points: Sequence[Point], told: InHand) -> Iterator[tuple[int, Record]]:
    """Run the points one after another in this process; yields number and record."""
    for point in points:
        yield point.number, job.run(point, told)


def cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0))


def run_in_processes(
    job: Job, points: Sequence[Point], workers: int, told: InHand
) -> Iterator[tuple[int, Record]]:
    """Run the points in so many processes; yields number and record as they end.

    A process that is killed loses the point in its hand only, which another one goes on with.

    Raises
    ------
    Interrupted
        After a signal, once all processes have left checkpoints.
    """
    pool = _Pool(job, deque(points), workers, told)
    with noticed() as asked:
        try:
            yield from pool.run(asked)
        finally:
            pool.stop()


@dataclass
class _Worker:
    """A process, the pipe to it, and the point in its hand with the part of it that is done."""

    process: SpawnProcess
    pipe: Connection
    point: Point | None = None
    part: float = 0.0

    def give(self, point: Point) -> None:
        self.point, self.part = point, 0.0
        # One that has died meanwhile is noticed by the end of its pipe.
        with suppress(BrokenPipeError):
            self.pipe.send(point)


@dataclass
class _Pool:
    job: Job
    waiting: deque[Point]
    size: int
    told: InHand
    workers: list[_Worker] = field(default_factory=list)
    lost: dict[int, int] = field(default_factory=dict)

    def run(self, asked: Interruption) -> Iterator[tuple[int, Record]]:
        while self.waiting or any(worker.point for worker in self.workers):
            if asked.signal:
                self.stop()
                name = signal.Signals(asked.signal).name
                raise Interrupted(asked.signal, self.job.how_to_go_on(f"stopped by {name}"))
            self._hire()
            for worker in self._ready():
                yield from self._hear(worker)
            self.told(sum(worker.part for worker in self.workers if worker.point))

    def _hire(self) -> None:
        """Give every idle worker a point; start workers for points that none has."""
        for worker in self.workers:
            if worker.point is None and self.waiting:
                worker.give(self.waiting.popleft())
        while self.waiting and len(self.workers) < self.size:
            worker = _start(self.job, max(1, cores() // self.size))
            self.workers.append(worker)
            worker.give(self.waiting.popleft())

    def _ready(self) -> list[_Worker]:
        """The workers that have something to say, after a wait of at most `_LOOK`."""
        pipes = set(wait([worker.pipe for worker in self.workers], _LOOK))
        return [worker for worker in self.workers if worker.pipe in pipes]

    def _hear(self, worker: _Worker) -> Iterator[tuple[int, Record]]:
        try:
            message = worker.pipe.recv()
        except (EOFError, ConnectionResetError):
            yield from self._lose(worker)
            return
        if isinstance(message, float):
            worker.part = message
            return
        point, worker.point = worker.point, None
        assert point is not None
        # The next point at once: the caller may take its time with this record.
        if self.waiting:
            worker.give(self.waiting.popleft())
        yield point.number, message

    def _lose(self, worker: _Worker) -> Iterator[tuple[int, Record]]:
        """Pass on the point of a process that has ended."""
        self.workers.remove(worker)
        worker.process.join()
        point, code = worker.point, worker.process.exitcode
        if point is None:
            return
        self.lost[point.number] = self.lost.get(point.number, 0) + 1
        if self.lost[point.number] < _TRIES:
            self.waiting.append(point)
            return
        yield (
            point.number,
            failed(
                f"its process ended {_TRIES} times ({_ending(code)}). Use fewer --workers if the memory "
                "was short; a script that calls sweep needs the line: if __name__ == '__main__'."
            ),
        )

    def stop(self) -> None:
        """End all processes: those with a point after a checkpoint."""
        for worker in self.workers:
            if worker.point is not None:
                worker.process.terminate()
            # The end of the pipe tells an idle one, and one that is about to send a record.
            worker.pipe.close()
        for worker in self.workers:
            worker.process.join()
            worker.process.close()
        self.workers.clear()


def _ending(code: int | None) -> str:
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit status {code}"


def _start(job: Job, threads: int) -> _Worker:
    """A new process with so many threads."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, job), name="ellipsoid-sweep", daemon=True)
    with _environment(threads):
        process.start()
    theirs.close()  # so that the pipe ends with the process
    return _Worker(process, ours)


@contextmanager
def _environment(threads: int) -> Iterator[None]:
    """Inside, new processes are told how many threads to start; fewer where the user wants fewer."""
    before = {name: os.environ.get(name) for name in _THREADS}
    asked = before["NUMBA_NUM_THREADS"]
    count = threads if asked is None else min(threads, int(asked))
    os.environ.update(dict.fromkeys(_THREADS, str(count)))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _work(pipe: Connection, job: Job) -> None:
    """A worker's life: points in, records out, until the pipe ends."""
    # Ctrl-C and a lost terminal reach all processes; the first one tells the others to end.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    tell = _Teller(pipe)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError, Interrupted):
        while True:
            pipe.send(job.run(pipe.recv(), tell))


class _Teller:
    """Sends the part of a point that is done, now and then."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe, self._next = pipe, time.monotonic() + _TELL

    def __call__(self, part: float) -> None:
        now = time.monotonic()
        if now >= self._next:
            self._next = now + _TELL
            # Without a reader the run goes on to its checkpoint.
            with suppress(OSError):
                self._pipe.send(float(part))


def _end_with_parent() -> None:
    """Leave a checkpoint and end when the first process has been killed."""
    parent: Any = multiprocessing.parent_process()
    wait([parent.sentinel])
    os.kill(os.getpid(), signal.SIGTERM)
