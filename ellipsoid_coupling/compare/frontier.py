"""Error against run time: every model and scheme at several resolutions, against one reference.

`run_frontier` refines every model that fits the scene (`compare.resolutions`), times each level
(`compare.timing`) and splits its error into parts (`compare.error_budget`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import (
    Bins,
    Parts,
    bin_result,
    distance,
    extrapolate,
    first_groups,
    remaining_distance,
    sampling_error,
    total_error,
)
from ellipsoid_coupling.compare.reference_solution import Reference, make_reference, own_sampling
from ellipsoid_coupling.compare.resolutions import Level, Refinement, make_refinement
from ellipsoid_coupling.compare.timing import Bench, Timed
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import (
    ADAPTIVE_SCHEME,
    SCHEMES,
    ModelKind,
    model_kinds,
    resolution_text,
)
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import Report

LONGEST = 60.0

# Ratio of the spacings of two levels that are extrapolated: closer ones would magnify all errors that
# are not of order h^p.
_LEAST_RATIO = 1.45
# This many levels are tried whatever the prediction is: after a crossing of characteristics a coarse
# grid may take more steps than a fine one. A run that takes too long is stopped.
_TRIED = 4


def frontier_models() -> list[str]:
    """The models that are compared by default: all but equilibria, which have no time to run."""
    return [kind.name for kind in model_kinds() if not kind.equilibrium]


@dataclass(frozen=True)
class FrontierRow:
    """One run: its model and resolution, its seconds, and its errors at the saved times.

    density_errors, angle_errors : L1 distances to the reference, one a saved time.
    wall_seconds : the best of `repeats` runs; `median_seconds` their median.
    parts : of the errors; None where they were not split.
    warnings : see `Result.warnings`.
    """

    scene: str
    model: str
    scheme: str
    resolution: str
    density_errors: tuple[float, ...]
    angle_errors: tuple[float, ...]
    wall_seconds: float
    status: str = "completed"
    median_seconds: float = float("nan")
    repeats: int = 1
    parts: Parts | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Frontier:
    """All runs of a scene, the reference of their errors, and the reference's sampling error.

    finest : the last result of each model and scheme; empty where they were not kept
    left_out : models that refuse the scene, and why
    reference_spread : how far it may be off, as in `Reference`; None where it is exact or unknown
    """

    rows: list[FrontierRow]
    reference: Result
    exact: bool
    sampling: Errors
    finest: dict[tuple[str, str], Result]
    reference_name: str = "microscopic ensemble"
    left_out: tuple[tuple[str, str], ...] = ()
    reference_spread: Errors | None = None


@dataclass(frozen=True)
class LevelRun:
    """The run of one level: its time and its bins, or the status without them."""

    level: Level
    timed: Timed | None
    bins: Bins | None
    status: str


def run_frontier(
    scene: Scene,
    flow: FlowField | None,
    *,
    models: Sequence[str] | None = None,
    seed: int = 0,
    longest: float = LONGEST,
    report: Report | None = None,
) -> Frontier:
    """Every model that fits the scene, from coarse to fine, each error with its parts.

    Parameters
    ----------
    scene : Scene
    flow : FlowField or None
        None for a scene without fluid.
    models : names, `frontier_models` if left out
    seed : int
        Of all runs; the reference's start is another one (seed + 1).
    longest : float
        Seconds that one run may take; a refinement ends where the next level would take longer.
    report : callable, optional
        Called with the stage and its finished part.

    Raises
    ------
    InputError
        If no model fits.
    RunError
        If the reference cannot be computed.
    """
    bench = Bench(flow, seed, longest, report)
    models = frontier_models() if models is None else models
    refinements, left_out = fitting_refinements(scene, models, bench)
    reference = make_reference(scene, models, bench)
    group = reference.group_size
    runs = [(refinement, run_levels(refinement, bench, group)) for refinement in refinements]
    reference.refined.update(_refined(runs))
    rows = [_row(refinement, run, reference) for refinement, levels in runs for run in levels]
    return Frontier(
        rows=rows,
        reference=reference.result,
        exact=reference.exact,
        sampling=own_sampling(reference),
        finest={},
        reference_name=reference.name,
        left_out=tuple(left_out),
        reference_spread=reference.spread,
    )


def fitting_refinements(
    scene: Scene, models: Sequence[str], bench: Bench
) -> tuple[list[Refinement], list[tuple[str, str]]]:
    """The refinements of the models that take the scene, warmed up; the others and their reasons."""
    refinements: list[Refinement] = []
    left_out: list[tuple[str, str]] = []
    for model in models:
        try:
            for scheme in SCHEMES:
                refinement = make_refinement(scene, model, scheme)
                bench.warm_up(refinement)
                refinements.append(refinement)
        except InputError as error:
            left_out.append((model, str(error)))
            refinements = [refinement for refinement in refinements if refinement.model != model]
    if not refinements:
        reasons = "; ".join(reason for _, reason in left_out)
        raise InputError(f"scene {scene.name}", "a model that fits", reasons, "Change the scene.")
    return refinements, left_out


def run_levels(refinement: Refinement, bench: Bench, sample_group: int | None) -> list[LevelRun]:
    """Time the levels from coarse to fine, until the next would take too long.

    sample_group : particles in an independent group of samples; None if they are not random
    """
    runs: list[LevelRun] = []
    last: tuple[float, float] | None = None
    for number, level in enumerate(refinement.levels):
        predicted = 0.0 if last is None else last[0] * level.cost / last[1]
        if predicted > bench.longest and number >= _TRIED:
            reason = f"not run: would take about {predicted:.0f} s"
            runs.append(LevelRun(level, None, None, reason))
            continue
        try:
            timed = bench.run(refinement, level)
        except RunError as error:
            runs.append(LevelRun(level, None, None, f"failed: {error}"))
            continue
        bins = bin_result(timed.result, group_size(refinement.kind, level.scene, sample_group))
        last = (timed.best, level.cost)
        runs.append(LevelRun(level, timed.without_arrays(), bins, "completed"))
    return runs


def group_size(kind: ModelKind, scene: Scene, sample_group: int | None) -> int | None:
    """The number of particles in a group that is independent of the others; None without groups."""
    if kind.is_grid:
        return None
    return scene.particles.number if kind.independent_realisations else sample_group


def _refined(
    runs: Sequence[tuple[Refinement, Sequence[LevelRun]]],
) -> dict[str, tuple[Bins, Errors | None]]:
    """Each grid model's extrapolated bins and their uncertainty (None with a single level)."""
    refined: dict[str, tuple[Bins, Errors | None]] = {}
    for refinement, levels in runs:
        if not refinement.kind.is_grid or refinement.scheme != ADAPTIVE_SCHEME:
            continue
        chain = coarser_and_coarser(levels)
        if len(chain) == 1:
            refined[refinement.model] = (chain[0][1], None)
        elif chain:
            (h, fine), (h_middle, middle) = chain[:2]
            coarse = chain[2][1] if len(chain) > 2 else None
            spread = remaining_distance(fine, middle, coarse)
            refined[refinement.model] = (extrapolate(fine, middle, h_middle / h), spread)
    return refined


def coarser_and_coarser(runs: Sequence[LevelRun]) -> list[tuple[float, Bins]]:
    """Spacing and bins of the finest level, and on to the next that is wider by `_LEAST_RATIO`."""
    chain: list[tuple[float, Bins]] = []
    for run in reversed(runs):
        h = run.level.spacing
        if run.bins is not None and (not chain or h > _LEAST_RATIO * chain[-1][0]):
            chain.append((h, run.bins))
    return chain


def _parts(refinement: Refinement, run: LevelRun, bins: Bins, reference: Reference) -> Parts:
    """The parts of one level's error, see `compare.error_budget`."""
    y = reference.bins
    if refinement.kind.is_grid:
        if refinement.model not in reference.refined:
            return Parts()  # no run of the finer scheme came to its end
        refined, spread = reference.refined[refinement.model]
        closure, closure_spread = distance(refined, y)
        return Parts(
            discretisation=distance(bins, refined)[0],
            closure=closure,
            discretisation_spread=spread,
            offset_spread=closure_spread,
        )
    scene = run.level.scene
    samples = scene.particles.number * scene.particles.realisations
    ensemble = reference.ensemble
    if refinement.kind.independent_realisations and ensemble is not None:
        count = min(bins.density.shape[0], ensemble.density.shape[0])
        same = first_groups(bins, count), first_groups(ensemble, count)
        away, spread = distance(*same)
        finite, finite_spread = distance(ensemble, y)
        sampling = sampling_error(ensemble, samples)
        return Parts(away, None, finite, sampling, spread, finite_spread)
    away, spread = distance(bins, y)
    if y.density.shape[0] == 1:
        return Parts(discretisation=away)
    return Parts(
        discretisation=away, sampling=sampling_error(y, samples), discretisation_spread=spread
    )


def _row(refinement: Refinement, run: LevelRun, reference: Reference) -> FrontierRow:
    scene = run.level.scene
    if run.timed is None or run.bins is None:
        nothing = tuple(float("nan") for _ in scene.times)
        realisations = scene.particles.realisations
        text = resolution_text(refinement.model, refinement.scheme, scene, realisations)
        return FrontierRow(
            scene.name,
            refinement.model,
            refinement.scheme,
            text,
            nothing,
            nothing,
            np.nan,
            run.status,
        )
    total = total_error(run.bins, reference.bins)
    return FrontierRow(
        scene=scene.name,
        model=refinement.model,
        scheme=refinement.scheme,
        resolution=str(run.timed.result.attributes["resolution"]),
        density_errors=tuple(map(float, total.density)),
        angle_errors=tuple(map(float, total.angle)),
        wall_seconds=run.timed.best,
        median_seconds=run.timed.median,
        repeats=run.timed.repeats,
        parts=_parts(refinement, run, run.bins, reference),
        warnings=tuple(run.timed.result.warnings),
    )
