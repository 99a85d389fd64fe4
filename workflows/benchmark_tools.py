"""Shared by the benchmarks: timing, rows of the table, the machine's own limits."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Self

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.models import Model
from ellipsoid_coupling.physics.elementary import exp_of_negative
from ellipsoid_coupling.stepping.step_control import REJECTED, STEPS

Floats = NDArray[np.float64]


class Row(NamedTuple):
    """One line: the task, its aim, the measured value, the rival's; numbers for the JSON."""

    work: str
    aim: str
    measured: str
    beside: str
    numbers: dict[str, float]

    @property
    def words(self) -> tuple[str, str, str, str]:
        """The texts of the table's row."""
        return self.work, self.aim, self.measured, self.beside


@dataclass(frozen=True)
class Sizes:
    """How large the benchmarks are; `quick` is for a test that they run."""

    repeats: int = 7
    pairs: int = 3
    particles: int = 1000
    realisations: int = 128
    clouds: tuple[int, ...] = (10_000, 100_000, 1_000_000)
    samples: tuple[int, ...] = (10_000, 100_000, 1_000_000, 10_000_000)
    q_cells: int = 150
    angles: int = 60
    rho_cells: int = 200
    memory: int = 20_000_000
    scene_cell: float = 0.02
    scene_times: tuple[float, ...] = (0.3, 0.5, 0.9)
    cavity_cell: float = 0.005
    start: bool = True
    flow_cells: int = 64
    exact_side: int = 256

    @classmethod
    def quick(cls) -> Self:
        """Seconds instead of minutes."""
        return cls(
            repeats=1, pairs=1, particles=100, realisations=4, clouds=(1000, 2000), samples=(1000, 2000),
            q_cells=16, angles=8, rho_cells=24, memory=10**5, scene_cell=0.1, scene_times=(0.1,),
            cavity_cell=0.05, start=False, flow_cells=16, exact_side=64,
        )  # fmt: skip


def seconds(work: Callable[[], object], repeats: int) -> float:
    """The median time of `work` after one call that warms up."""
    work()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return float(np.median(times))


def step_seconds(model: Model, until: float, calls: int) -> float:
    """The median time of a tried step of `model`, over this many calls after a warm-up."""
    clock = model.state()["clock"]
    times = []
    for _ in range(calls + 1):
        before, started = clock[0, STEPS] + clock[0, REJECTED], time.perf_counter()
        model.advance(until)
        tried = clock[0, STEPS] + clock[0, REJECTED] - before
        times.append((time.perf_counter() - started) / tried)
    return float(np.median(times[1:]))


def with_threads(threads: int, work: Callable[[], float]) -> float:
    """The result of `work` on a number of threads, at most numba's."""
    before = numba.get_num_threads()
    numba.set_num_threads(min(threads, before))
    try:
        return work()
    finally:
        numba.set_num_threads(before)


@parallel_kernel
def _triad(a: Floats, b: Floats, c: Floats, factor: float) -> None:
    for i in numba.prange(a.size):
        a[i] = b[i] + factor * c[i]


@kernel
def _exponentials(x: Floats, out: Floats) -> None:
    for i in range(x.size):
        out[i] = exp_of_negative(x[i])


def limits(sizes: Sizes) -> dict[str, float]:
    """Memory triad on one and two threads in GB/s; the package's exp on one core in 10^6/s."""
    a, b, c = np.zeros((3, sizes.memory))
    moved = 24e-9 * sizes.memory

    def triad() -> float:
        return moved / seconds(lambda: _triad(a, b, c, 2.0), sizes.repeats)

    x, out = np.linspace(-30.0, 0.0, 10_000), np.empty(10_000)
    rate = 1e-2 / seconds(lambda: _exponentials(x, out), 5 * sizes.repeats)
    return {
        "triad GB/s, one thread": with_threads(1, triad),
        "two threads": with_threads(2, triad),
        "exp 10^6/s": rate,
    }
