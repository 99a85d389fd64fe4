"""What a sweep costs beyond its runs: CPU and wall time a point, and the gain of a second worker.

python workflows/benchmark_sweeps.py [--points N] [--workers W]

Costs are differences of two sweeps of different length, so that starting processes, loading kernels and
compiling fall out. Other users of the machine change wall times, and CPU times by some ten per cent.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import ellipsoid_coupling as ec

# About 10 ms of one core a run: 100 particles in a trap with noise.
SETTINGS = {
    "interaction": None, "particles.number": 100, "particles.realisations": 1, "times": [2.0],
}  # fmt: skip
MODEL = "microscopic"


class Cost(NamedTuple):
    """Seconds: of the clock, of this process, of those that it has started."""

    wall: float
    own: float
    workers: float

    def less(self, other: Cost, points: int) -> Cost:
        """The difference, a point."""
        return Cost(*((a - b) / points for a, b in zip(self, other, strict=True)))


def now() -> Cost:
    """What has been spent so far."""
    own, others = (
        sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return Cost(time.perf_counter(), own, others)


def swept(points: int, workers: int) -> Cost:
    """A sweep over so many seeds."""
    scene = ec.load_scene("stationary", SETTINGS)
    with tempfile.TemporaryDirectory() as folder:
        before = now()
        ec.sweep(scene, models=MODEL, seeds=range(points), workers=workers, out=Path(folder) / "s")
        return now().less(before, 1)


def alone(points: int) -> Cost:
    """The same runs, without a folder."""
    scene = ec.load_scene("stationary", SETTINGS)
    before = now()
    for seed in range(points):
        ec.simulate(scene, MODEL, seed=seed)
    return now().less(before, 1)


def main(words: Sequence[str] | None = None) -> dict[str, Cost]:
    """Print, and return, the costs a point by the way that it ran."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=400)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args(words)
    few, many = max(1, given.points // 10), given.points
    alone(1)
    costs = {"simulate": alone(many).less(alone(few), many - few)}
    for workers in dict.fromkeys((1, given.workers)):
        swept(1, workers)
        costs[f"{workers} workers"] = swept(many, workers).less(swept(few, workers), many - few)
    print("ms a point      wall   CPU here   CPU of workers")
    for name, cost in costs.items():
        print(f"{name:12s}" + "".join(f"{1e3 * value:9.2f}" for value in cost))
    return costs


if __name__ == "__main__":
    main()
