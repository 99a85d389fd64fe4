"""One field of the map: a model and a scheme on a case, held against a reference."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ellipsoid_coupling.compare.stability.case import Case, Table
from ellipsoid_coupling.compare.stability.distance import distances
from ellipsoid_coupling.compare.stability.watched_run import Outcome, Run, run_case
from ellipsoid_coupling.models import SchemeName, layout_of
from ellipsoid_coupling.scenes import Scene, terms_of

# By how much the scheme `paper` is asked for a smaller step before it is given up, and the share of
# the steps that it may take.
_SMALLER = (0.1, 0.01, 1e-3)
_SHARE_OF_SEARCH = 0.1
# A reference has so many times as many cells in every direction.
_FINER = 1.5
# A reference takes more steps, on more cells; under pressure these are so dear that it may take fewer.
REFERENCE_OF_PRESSURE = 0.4


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
        Run time without compiling.
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


def _finer(case: Case, model: str) -> tuple[Table, str]:
    """What makes a run of `accurate` the reference, and how it is called."""
    scene = case.scene(model)
    numerics = scene.numerics
    if layout_of(model) == "particles":
        if terms_of(scene, model).noise:
            # The noise of another step is another noise: only the law can be compared.
            count = 10 * scene.particles.realisations
            return {"particles.realisations": count}, f"accurate, other noise, {count} realisations"
        tolerance = 0.01 * min(numerics.tolerance, 1e-3)
        return {"numerics.tolerance": tolerance}, f"accurate, tolerance {tolerance:g}"
    angles = round(_FINER * numerics.angle_cells)
    cell = scene.domain.width / math.ceil(_FINER * round(scene.domain.width / numerics.cell))
    settings = {"numerics.cell": cell, "numerics.angle_cells": angles, "numerics.cfl": 0.9}
    return settings, f"accurate, h = {cell:.3g}, {angles} angles"


def examine(case: Case, model: str, schemes: tuple[SchemeName, ...]) -> list[Field]:
    """The fields of one case and one model: both schemes against one reference."""
    if not case.suits(model):
        return [Field(case.family, case.value, model, s, "not applicable") for s in schemes]
    runs = {scheme: run_case(case, model, scheme) for scheme in schemes}
    if not case.reference:
        reference, words = None, "none: it would take too long"
    elif all(run.outcome == "refused" for run in runs.values()):
        reference, words = None, ""
    else:
        finer, words = _finer(case, model)
        share = REFERENCE_OF_PRESSURE if model == "q_maxwellian" else 1.0
        seed = 1 if "realisations" in words else 0
        reference = run_case(case, model, "accurate", finer, seed=seed, share=share)
    fields = [_field(case, model, s, runs[s], reference, words) for s in schemes]
    return [
        replace(f, needed_step=_needed_step(case, model, runs["paper"]))
        if f.scheme == "paper" and f.outcome in ("broken", "stopped")
        else f
        for f in fields
    ]


def _field(
    case: Case, model: str, scheme: str, run: Run, reference: Run | None, words: str
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


def _errors(case: Case, model: str, run: Run, reference: Run | None) -> tuple[float, float]:
    if reference is None or reference.outcome != "completed" or run.outcome != "completed":
        return math.nan, math.nan
    assert run.shape is not None
    assert reference.shape is not None
    turns = not case.scene(model).particles.is_circle
    return distances(run.shape, reference.shape, turns=turns)


def _largest_damping(scene: Scene) -> float:
    """The larger of gamma + A^2/2 and gamma_bar + B^2/2."""
    flow, noise = scene.flow, scene.noise
    drags = (flow.drag, flow.angular_drag) if flow else (0.0, 0.0)
    kicks = (noise.noise, noise.angular_noise) if noise else (0.0, 0.0)
    return max(drag + kick * kick / 2 for drag, kick in zip(drags, kicks, strict=True))


def _needed_step(case: Case, model: str, run: Run) -> float:
    """The step that the scheme `paper` would need: known, or the largest tried with which it holds.

    Known for explicit damping, dt Gamma < 2, and for a run that ended with its number of steps. NaN
    if it held with none of those tried.
    """
    if run.exhausted and run.counts is not None:
        return run.reached / run.counts["steps"]
    scene = case.scene(model)
    particles = layout_of(model) == "particles"
    damping, step = _largest_damping(scene), scene.numerics.time_step
    if particles and damping * step > 2.0:
        return 2.0 / damping
    key, value = ("time_step", step) if particles else ("cfl", scene.numerics.cfl)
    for factor in _SMALLER:
        changed: Table = {f"numerics.{key}": factor * value}
        again = run_case(case, model, "paper", changed, share=_SHARE_OF_SEARCH)
        if again.exhausted or again.counts is None:
            return math.nan
        if again.outcome == "completed":
            return again.reached / again.counts["steps"]
    return math.nan
