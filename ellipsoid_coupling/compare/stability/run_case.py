"""One entry of the map: a model and a scheme on a case, compared with a reference."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ellipsoid_coupling.compare.stability.case import Case, Table
from ellipsoid_coupling.compare.stability.distance import distances
from ellipsoid_coupling.compare.stability.watched_run import Outcome, Run, run_case
from ellipsoid_coupling.models import ADAPTIVE_SCHEME, SchemeName, kind_named, scheme_named
from ellipsoid_coupling.scenes import Scene, terms_of

# Factors on the step of a scheme of fixed steps that are tried, and the share of the steps that a try may
# take.
_SMALLER = (0.1, 0.01, 1e-3)
_SHARE_OF_SEARCH = 0.1
# Factor on a reference's number of cells in every direction.
_FINER = 1.5
# Share of the steps that a reference under pressure may take: its steps are the most expensive of all.
REFERENCE_OF_PRESSURE = 0.4


@dataclass(frozen=True)
class MapEntry:
    """One run of the map; NaN where a number does not exist.

    Attributes
    ----------
    family, value, model, scheme : str
    outcome : str
        "completed"; "broken": it came to its end, but mass, positivity or the walls did not hold;
        "stopped": it raised an error; "refused": bad input; "not applicable": the model lacks it.
    reason : str
        The message, if it did not complete.
    place_error, angle_error : float
        As in `distance`, against `reference`.
    reference : str
    mass_drift : float
        |mass at the end + mass that left - mass at the start|, relative; the largest of the run.
    least_density : float
        The smallest of any cell at any time; NaN for particles.
    steps, rejected : float
    needed_step : float
        For a scheme of fixed steps that did not hold: the largest step tried with which it did.
    seconds : float
        Run time without compiling.
    """

    family: str
    value: str
    model: str
    scheme: SchemeName
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
        """The varied quantity and its value."""
        return f"{self.family} {self.value}".strip()

    @property
    def error(self) -> float:
        """The larger of the two errors."""
        return float(np.fmax(self.place_error, self.angle_error))


def _finer(case: Case, model: str) -> tuple[Table, str]:
    """The settings that make a run of `accurate` the reference, and their description."""
    kind = kind_named(model)
    scene = case.scene(kind)
    numerics = scene.numerics
    if not kind.is_grid:
        if terms_of(scene).noise:
            # Another step draws other noise, so only the law can be compared.
            count = 10 * scene.particles.realisations
            return {"particles.realisations": count}, f"accurate, other noise, {count} realisations"
        tolerance = 0.01 * min(numerics.tolerance, 1e-3)
        return {"numerics.tolerance": tolerance}, f"accurate, tolerance {tolerance:g}"
    angles = round(_FINER * numerics.angle_cells)
    cell = scene.domain.width / math.ceil(_FINER * round(scene.domain.width / numerics.cell))
    settings = {"numerics.cell": cell, "numerics.angle_cells": angles, "numerics.cfl": 0.9}
    return settings, f"accurate, h = {cell:.3g}, {angles} angles"


def examine(case: Case, model: str, schemes: tuple[SchemeName, ...]) -> list[MapEntry]:
    """The entries of one case and one model: both schemes against one reference."""
    kind = kind_named(model)
    if not case.suits(kind):
        return [MapEntry(case.family, case.value, model, s, "not applicable") for s in schemes]
    runs = {scheme: run_case(case, model, scheme) for scheme in schemes}
    if not case.reference:
        reference, words = None, "none: it would take too long"
    elif all(run.outcome == "refused" for run in runs.values()):
        reference, words = None, ""
    else:
        finer, words = _finer(case, model)
        share = REFERENCE_OF_PRESSURE if kind.pressure != 0.0 else 1.0
        seed = 1 if "realisations" in words else 0
        reference = run_case(case, model, ADAPTIVE_SCHEME, finer, seed=seed, share=share)
    entries = [_entry(case, model, s, runs[s], reference, words) for s in schemes]
    return [
        replace(entry, needed_step=_needed_step(case, model, entry.scheme, runs[entry.scheme]))
        if not scheme_named(entry.scheme).adaptive and entry.outcome in ("broken", "stopped")
        else entry
        for entry in entries
    ]


def _entry(
    case: Case, model: str, scheme: SchemeName, run: Run, reference: Run | None, words: str
) -> MapEntry:
    counts = run.counts or {}
    place, angle = _errors(case, model, run, reference)
    if reference is not None and reference.outcome != "completed":
        words = f"none: {words}: {reference.reason}"
    return MapEntry(
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
    turns = not case.scene(kind_named(model)).particles.is_circle
    return distances(run.shape, reference.shape, turns=turns)


def _largest_damping(scene: Scene) -> float:
    """The larger of gamma + A^2/2 and gamma_bar + B^2/2."""
    flow, noise = scene.flow, scene.noise
    drags = (flow.drag, flow.angular_drag) if flow else (0.0, 0.0)
    kicks = (noise.noise, noise.angular_noise) if noise else (0.0, 0.0)
    return max(drag + kick * kick / 2 for drag, kick in zip(drags, kicks, strict=True))


def _needed_step(case: Case, model: str, scheme: SchemeName, run: Run) -> float:
    """The step that a scheme of fixed steps needs: known, or the largest tried with which it holds.

    It is known for explicit damping, dt Gamma < 2, and for a run that ended at its number of steps. NaN
    if the scheme held with none of those tried.
    """
    if run.exhausted and run.counts is not None:
        return run.reached / run.counts["steps"]
    kind = kind_named(model)
    scene, particles = case.scene(kind), not kind.is_grid
    damping, step = _largest_damping(scene), scene.numerics.time_step
    if particles and damping * step > 2.0:
        return 2.0 / damping
    key, value = ("time_step", step) if particles else ("cfl", scene.numerics.cfl)
    for factor in _SMALLER:
        changed: Table = {f"numerics.{key}": factor * value}
        again = run_case(case, model, scheme, changed, share=_SHARE_OF_SEARCH)
        if again.exhausted or again.counts is None:
            return math.nan
        if again.outcome == "completed":
            return again.reached / again.counts["steps"]
    return math.nan
