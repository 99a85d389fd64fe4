"""How long a run takes: the bare computation, compiled and warm, best and median of a few repeats."""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass, replace

import numpy as np

from ellipsoid_coupling.compare.resolutions import Level, Refinement, changed
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import SchemeName
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import Report, simulate

REPEATS = 3
# Longer runs are timed once, because disturbances are a small part of them.
_SHORT = 2.0
# A run is stopped when it takes this many times the seconds that it may take.
PATIENCE = 1.5
# Part of the first save time that a warm-up runs to.
_WARM_UP = 1e-3


class Stopped(RunError):
    """A run that took longer than it was allowed to."""


def warm_up(
    scene: Scene, model: str, scheme: SchemeName, flow: FlowField | None, seed: int
) -> None:
    """A very short run: kernels compiled or loaded.

    One that fails here is left to fail where it is counted.

    Raises
    ------
    InputError
        If the model does not fit the scene.
    """
    short = changed(scene, {"times": [scene.times[0] * _WARM_UP]})
    with contextlib.suppress(RunError):
        simulate(short, model, scheme, flow=flow, seed=seed)


@dataclass(frozen=True)
class Timed:
    """A run and its seconds: the least, the median, and of how many repeats."""

    result: Result
    best: float
    median: float
    repeats: int

    def without_arrays(self) -> Timed:
        """The same, with a result that keeps its attributes alone."""
        return replace(self, result=replace(self.result, variables={}))


@dataclass(frozen=True)
class Bench:
    """Where runs are timed.

    flow : of all runs; None without fluid
    seed : of all runs
    longest : seconds that a run may take
    report : called with the stage and its finished part
    """

    flow: FlowField | None
    seed: int
    longest: float
    report: Report | None = None

    def tell(self, stage: str, part: float) -> None:
        """Pass on how far a stage is."""
        if self.report is not None:
            self.report(stage, part)

    def warm_up(self, refinement: Refinement) -> None:
        """`warm_up` with the coarsest level.

        Raises
        ------
        InputError
            If the model does not fit the scene.
        """
        self.tell(f"{refinement.model}, {refinement.scheme}: warm-up", 0.0)
        coarsest = refinement.levels[0].scene
        warm_up(coarsest, refinement.model, refinement.scheme, self.flow, self.seed)

    def run(self, refinement: Refinement, level: Level, repeats: int = REPEATS) -> Timed:
        """Time a level; a short run as often as `repeats`.

        Raises
        ------
        RunError
            If the run fails; `Stopped` if it takes too long.
        """
        seconds: list[float] = []
        while True:
            result = self._once(refinement, level)
            seconds.append(float(result.attributes["wall_seconds"]))
            if len(seconds) >= repeats or seconds[0] > _SHORT:
                break
        return Timed(result, min(seconds), float(np.median(seconds)), len(seconds))

    def _once(self, refinement: Refinement, level: Level) -> Result:
        # The clock starts with the first report: compiling comes before it.
        started: list[float] = []

        def watch(stage: str, part: float) -> None:
            now = time.perf_counter()
            if not started:
                started.append(now)
            if part < 1.0 and now - started[0] > PATIENCE * self.longest:
                raise Stopped(f"stopped at {part:.0%} after {now - started[0]:.0f} s")
            self.tell(stage, part)

        return simulate(
            level.scene,
            refinement.model,
            refinement.scheme,
            flow=self.flow,
            seed=self.seed,
            report=watch,
        )
