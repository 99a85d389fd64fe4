"""One field of the map: a model and a scheme on a case, watched from the first step to the last.

A run is bounded by its number of steps, never by the clock, so that a map does not depend on the
machine that it was made on.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ellipsoid_coupling.compare.stability.cases import Case, Table
from ellipsoid_coupling.compare.stability.distance import Shape, distances, shape_of
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.models import Model, SchemeName, Setup, build_model
from ellipsoid_coupling.scenes import Scene, terms_of

Outcome = Literal["completed", "broken", "stopped", "refused", "not applicable"]

# Steps, repeated ones included, that a run may take: some seconds on the small scene.
MOST_STEPS = {"particles": 100_000, "rho": 20_000, "q": 8_000}
# A run that keeps its mass to this, its density positive and its particles inside is whole.
LARGEST_DRIFT = 1e-12
# By how much the scheme `paper` is asked for a smaller step before it is given up.
_SMALLER = (0.1, 0.01, 1e-3, 1e-4)
# Beyond this error in place or angle, what completed is not a solution of the scene.
WRONG = 0.3


@dataclass(frozen=True)
class Field:
    """One run of the map; NaN where a number does not exist.

    Attributes
    ----------
    family, value, model, scheme : str
    outcome : str
        "completed"; "broken": it came to its end, but mass, positivity or the walls did not hold;
        "stopped": it said why; "refused": bad input; "not applicable": means nothing to the model.
    reason : str
        Its own words, where it did not complete.
    place_error, angle_error : float
        As in `distance`, against `reference`.
    reference : str
    mass_drift : float
        |mass at the end + what left - mass at the start|, relative; the largest of the run.
    least_density : float
        The smallest of any cell at any time; NaN for particles.
    steps, rejected : float
    needed_step : float
        For the scheme `paper` where it did not hold: the largest step tried with which it did.
    seconds : float
        Run time; compiling is in it the first time.
    """

    family: str
    value: str
    model: str
    scheme: str
    outcome: Outcome
    reason: str = ""
    place_error: float = math.nan
    angle_error: float = math.nan
    reference: str = ""
    mass_drift: float = math.nan
    least_density: float = math.nan
    steps: float = math.nan
    rejected: float = math.nan
    needed_step: float = math.nan
    seconds: float = math.nan

    @property
    def case(self) -> str:
        """What was varied, and to what."""
        return f"{self.family} {self.value}".strip()

    @property
    def error(self) -> float:
        """The larger of the two errors."""
        return float(np.fmax(self.place_error, self.angle_error))


@dataclass(frozen=True)
class _Run:
    """What a run came to, before it is held against anything."""

    outcome: Outcome
    reason: str
    shape: Shape | None
    drift: float = math.nan
    least: float = math.nan
    counts: dict[str, float] | None = None
    reached: float = 0.0
    seconds: float = 0.0


class _Watch:
    """Follows the promises that a run must keep at every moment."""

    def __init__(self, model: Model, scene: Scene, reflecting: bool) -> None:
        self._model, self._reflecting = model, reflecting
        self._ranges = ((scene.domain.x, "x"), (scene.domain.y, "y"))
        self.drift, self.least, self.outside = 0.0, math.nan, 0.0
        self.look()

    def look(self) -> None:
        """Take notice of the present state."""
        counts, now = self._model.counts(), self._model.snapshot()
        start = counts["mass_start"]
        drift = abs(counts["mass_end"] + counts["mass_left"] - start) / start
        self.drift = max(self.drift, drift) if drift == drift else math.nan
        if "density" in now:
            self.least = float(np.fmin(self.least, np.min(now["density"].astype(np.float64))))
        elif self._reflecting:
            for (low, high), name in self._ranges:
                place = np.asarray(now[name], np.float64)
                beyond = np.maximum(low - place, place - high).max(initial=0.0)
                self.outside = float(max(self.outside, beyond))

    def broken(self) -> str:
        """Which promise was not kept; empty if all were."""
        if not self.drift <= LARGEST_DRIFT:
            return f"mass off by {self.drift:.1e}"
        if self.least < 0.0:
            return f"a density of {self.least:.1e}"
        return f"a particle {self.outside:.1e} outside the walls" if self.outside > 0.0 else ""


def _run(
    case: Case, model: str, scheme: SchemeName, finer: Table | None = None, seed: int = 0
) -> _Run:
    started = time.perf_counter()
    try:
        scene = case.scene(model, finer)
        terms = terms_of(scene, model)
        flow = case.flow(scene)
        setup = Setup(scene, terms, scheme, flow, seed, scene.particles.realisations)
        built = build_model(model, setup)
    except InputError as error:
        return _Run("refused", str(error), None)
    watch = _Watch(built, scene, terms.reflection)
    outcome, reason = _advance(built, scene, watch)
    shape = shape_of(built, scene)
    if outcome == "completed" and not shape.finite:
        outcome, reason = "broken", "not finite"
    spent = time.perf_counter() - started
    return _Run(
        outcome, reason, shape, watch.drift, watch.least, built.counts(), built.time, spent
    )


def _advance(model: Model, scene: Scene, watch: _Watch) -> tuple[Outcome, str]:
    most = MOST_STEPS[model.layout]
    try:
        for until in scene.times:
            while model.time < until:
                model.advance(until)
                watch.look()
                counts = model.counts()
                taken = counts["steps"] + counts.get("rejected_steps", 0.0)
                if taken > most:
                    return "stopped", f"more than {most} steps, t = {model.time:.3g} reached"
    except RunError as error:
        return "stopped", str(error)
    broken = watch.broken()
    return ("broken", broken) if broken else ("completed", "")


def _finer(case: Case, model: str) -> tuple[Table, str]:
    """What makes a run of `accurate` the reference, and how it is called."""
    scene = case.scene(model)
    numerics = scene.numerics
    if build_layout(model) == "particles":
        if terms_of(scene, model).noise:
            # The noise of another step is another noise: only the law can be compared.
            count = 10 * scene.particles.realisations
            return {"particles.realisations": count}, f"accurate, other noise, {count} realisations"
        tolerance = 0.01 * min(numerics.tolerance, 1e-3)
        return {"numerics.tolerance": tolerance}, f"accurate, tolerance {tolerance:g}"
    angles = 2 * numerics.angle_cells
    cell = 0.5 * numerics.cell
    settings = {"numerics.cell": cell, "numerics.angle_cells": angles, "numerics.cfl": 0.9}
    return settings, f"accurate, h = {cell:.3g}, {angles} angles"


def build_layout(model: str) -> str:
    """Particles, rho or q: what a model's state is made of, told by its name."""
    if model in ("microscopic", "mckean_vlasov"):
        return "particles"
    return "rho" if model in ("rho_mono_kinetic", "diffusive") else "q"


def examine(case: Case, model: str, schemes: tuple[SchemeName, ...]) -> list[Field]:
    """The fields of one case and one model: both schemes against one reference."""
    if not case.suits(model):
        return [Field(case.family, case.value, model, s, "not applicable") for s in schemes]
    runs = {scheme: _run(case, model, scheme) for scheme in schemes}
    if all(run.outcome == "refused" for run in runs.values()):
        reference, words = None, ""
    else:
        finer, words = _finer(case, model)
        reference = _run(case, model, "accurate", finer, seed="realisations" in words)
    fields = [_field(case, model, s, runs[s], reference, words) for s in schemes]
    return [
        replace(f, needed_step=_needed_step(case, model, runs["paper"], reference))
        if f.scheme == "paper" and _failed(f)
        else f
        for f in fields
    ]


def _failed(field: Field) -> bool:
    return field.outcome in ("broken", "stopped") or (
        field.outcome == "completed" and field.error > WRONG
    )


def _field(
    case: Case, model: str, scheme: str, run: _Run, reference: _Run | None, words: str
) -> Field:
    counts = run.counts or {}
    place, angle = _errors(case, model, run, reference)
    if reference is not None and reference.outcome != "completed":
        words = f"none: {words}: {reference.reason}"
    return Field(
        case.family,
        case.value,
        model,
        scheme,
        run.outcome,
        run.reason,
        place,
        angle,
        words,
        run.drift,
        run.least,
        counts.get("steps", math.nan),
        counts.get("rejected_steps", math.nan),
        seconds=run.seconds,
    )


def _errors(case: Case, model: str, run: _Run, reference: _Run | None) -> tuple[float, float]:
    if reference is None or reference.outcome != "completed" or run.outcome != "completed":
        return math.nan, math.nan
    assert run.shape is not None
    assert reference.shape is not None
    turns = not case.scene(model).particles.is_circle
    return distances(run.shape, reference.shape, turns=turns)


def _needed_step(case: Case, model: str, run: _Run, reference: _Run | None) -> float:
    """The largest step tried with which the scheme `paper` holds; NaN if none did."""
    numerics = case.scene(model).numerics
    layout = build_layout(model)
    for factor in _SMALLER:
        if layout == "particles":
            changed: Table = {"numerics.time_step": factor * numerics.time_step}
        else:
            changed = {"numerics.cfl": factor * numerics.cfl}
        again = _run(case, model, "paper", changed)
        if again.counts is None or again.outcome == "stopped" and "more than" in again.reason:
            return math.nan
        if again.outcome == "completed" and not max(_errors(case, model, again, reference)) > WRONG:
            return again.reached / again.counts["steps"]
    return math.nan
