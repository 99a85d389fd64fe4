"""A run of the map that is checked after every call, from the first step to the last.

Its number of steps is bounded, not its seconds, so that the map does not depend on the machine.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ellipsoid_coupling.compare.stability.case import Case, Table
from ellipsoid_coupling.compare.stability.distance import Shape, shape_of
from ellipsoid_coupling.compiled.compile_events import CompileTimer
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.models import (
    Model,
    SchemeName,
    Setup,
    build_model,
    kind_named,
    model_terms,
)
from ellipsoid_coupling.monitors import Monitors
from ellipsoid_coupling.scenes import Scene

Outcome = Literal["completed", "broken", "stopped", "refused", "not applicable"]

# Steps, repeated ones included, that a run may take: some seconds on the small scene.
MOST_STEPS = {"particles": 120_000, "rho": 20_000, "q": 4_000}
# The largest relative change of mass of a run that holds.
LARGEST_DRIFT = 1e-12
_EXHAUSTED = "more than"


@dataclass(frozen=True)
class Run:
    """The outcome of a run, before it is compared with a reference."""

    outcome: Outcome
    reason: str
    shape: Shape | None
    drift: float = math.nan
    least: float = math.nan
    counts: dict[str, float] | None = None
    exhausted: bool = False
    reached: float = 0.0
    seconds: float = 0.0


class _Watch:
    """Checks the laws that must hold at every moment of a run."""

    def __init__(self, model: Model, scene: Scene, reflecting: bool) -> None:
        self._model, self._reflecting = model, reflecting
        self._ranges = ((scene.domain.x, "x"), (scene.domain.y, "y"))
        self.drift, self.least, self.outside = 0.0, math.nan, 0.0
        self.look()

    def look(self) -> None:
        """Check the present state."""
        counts, now = self._model.counts(), self._model.snapshot()
        start = counts["mass_start"]
        drift = abs(counts["mass_end"] + counts["mass_left"] - start) / start
        self.drift = max(self.drift, drift) if drift == drift else math.nan
        if "density" in now:
            self.least = float(np.fmin(self.least, np.min(now["density"].astype(np.float64))))
        elif self._reflecting:
            for (low, high), name in self._ranges:
                coordinate = np.asarray(now[name], np.float64)
                beyond = np.maximum(low - coordinate, coordinate - high).max(initial=0.0)
                self.outside = float(max(self.outside, beyond))

    def broken(self) -> str:
        """The law that was broken; empty if all held."""
        if not self.drift <= LARGEST_DRIFT:
            return f"mass off by {self.drift:.1e}"
        if self.least < 0.0:
            return f"a density of {self.least:.1e}"
        return f"a particle {self.outside:.1e} outside the walls" if self.outside > 0.0 else ""


def run_case(
    case: Case,
    model: str,
    scheme: SchemeName,
    finer: Table | None = None,
    *,
    seed: int = 0,
    share: float = 1.0,
) -> Run:
    """Run a case with additional changes, for at most a `share` of `MOST_STEPS`."""
    with CompileTimer() as compiling:
        started = time.perf_counter()
        run = _watched(case, model, scheme, finer, (seed, share))
        return replace(run, seconds=time.perf_counter() - started - compiling.seconds)


def _watched(
    case: Case, model: str, scheme: SchemeName, finer: Table | None, how: tuple[int, float]
) -> Run:
    try:
        kind = kind_named(model)
        scene = case.scene(kind, finer)
        terms = model_terms(scene, model)
        flow = case.flow(scene)
        setup = Setup(scene, terms, scheme, flow, how[0], scene.particles.realisations)
        built = build_model(model, setup)
    except InputError as error:
        return Run("refused", str(error), None)
    if case.background and kind.is_grid:
        fields = built.state()["fields"].copy()
        fields[0] += case.background
        built.restore({"fields": fields})
    watch = _Watch(built, scene, not scene.has_sides("leave"))
    monitors = Monitors(model, setup, built)
    most = round(how[1] * MOST_STEPS[kind.layout])
    outcome, reason = _advance(built, scene, (watch, monitors), most)
    exhausted = reason.startswith(_EXHAUSTED)
    shape = shape_of(built, scene)
    if outcome == "completed" and not shape.finite:
        outcome, reason = "broken", "not finite"
    counts = {name: value for name, value in built.counts().items() if isinstance(value, float)}
    return Run(outcome, reason, shape, watch.drift, watch.least, counts, exhausted, built.time)


def _advance(
    model: Model, scene: Scene, watches: tuple[_Watch, Monitors], most: int
) -> tuple[Outcome, str]:
    watch, monitors = watches
    try:
        for until in scene.times:
            while model.time < until:
                model.advance(until)
                watch.look()
                monitors.look(model)
                counts = model.counts()
                taken = counts["steps"] + counts.get("rejected_steps", 0.0)
                if taken > most:
                    return "stopped", f"{_EXHAUSTED} {most} steps, t = {model.time:.3g} reached"
    except RunError as error:
        return "stopped", str(error)
    broken = watch.broken()
    return ("broken", broken) if broken else ("completed", "")
