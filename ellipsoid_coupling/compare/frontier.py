"""Error against run time: every model and scheme at several resolutions, against one yardstick.

`run_frontier` climbs the ladder (`compare.resolutions`) of every model that fits the scene, times each
level (`compare.timing`) and splits its error into parts (`compare.error_budget`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
from ellipsoid_coupling.compare.reference_solution import Yardstick, make_yardstick, own_sampling
from ellipsoid_coupling.compare.resolutions import Ladder, Level, make_ladder
from ellipsoid_coupling.compare.timing import Bench, Timed
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import SCHEMES
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import Report

FRONTIER_MODELS = (
    "microscopic",
    "mckean_vlasov",
    "q_maxwellian",
    "q_mono_kinetic",
    "rho_mono_kinetic",
    "diffusive",
)
LONGEST = 60.0

# Of the spacings of two levels that are extrapolated: nearer ones would magnify what is not of order h^p.
_LEAST_RATIO = 1.45
# So many levels are tried whatever the one before took: after a crossing of characteristics a coarse
# grid may take more steps than a fine one. A run that takes too long is stopped.
_TRIED = 4


@dataclass(frozen=True)
class FrontierRow:
    """One row: what was run, how long it took, how far it was off at each saved time.

    density_errors, angle_errors : L1 distances to the reference, one a saved time.
    wall_seconds : the best of `repeats` runs; `median_seconds` their median.
    parts : of the errors; None where they were not split.
    warnings : what the run tells, see `Result.warnings`.
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
    """All rows of a scene, the reference that they are held against, and its sampling error.

    finest : the last result of each model and scheme; empty where they were not kept
    left_out : models that the scene does not have, and why
    reference_spread : distance of the reference to a coarser one; None where it is exact or unknown
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
class Rung:
    """One level of a ladder as it went: timed and binned, or why not."""

    level: Level
    timed: Timed | None
    bins: Bins | None
    status: str


def run_frontier(
    scene: Scene,
    flow: FlowField | None,
    *,
    models: Sequence[str] = FRONTIER_MODELS,
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
    models : names
    seed : int
        Of all runs; the yardstick's start is another one (seed + 1).
    longest : float
        Seconds that one run may take; a ladder ends where the next level would take longer.
    report : callable, optional
        Told stages and their parts.

    Raises
    ------
    InputError
        If no model fits.
    RunError
        If the yardstick cannot be computed.
    """
    bench = Bench(flow, seed, longest, report)
    ladders, left_out = _fitting(scene, models, bench)
    yardstick = make_yardstick(scene, models, bench)
    climbed = [(ladder, climb(ladder, bench, yardstick.group_size)) for ladder in ladders]
    yardstick.refined.update(_refined(climbed))
    rows = [_row(ladder, rung, yardstick) for ladder, rungs in climbed for rung in rungs]
    return Frontier(
        rows=rows,
        reference=yardstick.result,
        exact=yardstick.exact,
        sampling=own_sampling(yardstick),
        finest={},
        reference_name="exact" if yardstick.exact else "mckean_vlasov",
        left_out=tuple(left_out),
        reference_spread=yardstick.spread,
    )


def _fitting(
    scene: Scene, models: Sequence[str], bench: Bench
) -> tuple[list[Ladder], list[tuple[str, str]]]:
    """The ladders of the models that take the scene, warmed up; the others and their reasons."""
    ladders: list[Ladder] = []
    left_out: list[tuple[str, str]] = []
    for model in models:
        try:
            for scheme in SCHEMES:
                ladder = make_ladder(scene, model, scheme)
                bench.warm_up(ladder)
                ladders.append(ladder)
        except InputError as error:
            left_out.append((model, str(error)))
            ladders = [ladder for ladder in ladders if ladder.model != model]
    if not ladders:
        reasons = "; ".join(reason for _, reason in left_out)
        raise InputError(f"scene {scene.name}", "a model that fits", reasons, "Change the scene.")
    return ladders, left_out


def climb(ladder: Ladder, bench: Bench, sample_group: int | None) -> list[Rung]:
    """Time the levels from coarse to fine, until the next would take too long.

    sample_group : particles in an independent group of `mckean_vlasov`; None if not random
    """
    rungs: list[Rung] = []
    last: tuple[float, float] | None = None
    for number, level in enumerate(ladder.levels):
        foretold = 0.0 if last is None else last[0] * level.cost / last[1]
        if foretold > bench.longest and number >= _TRIED:
            told = f"not run: would take about {foretold:.0f} s"
            rungs.append(Rung(level, None, None, told))
            continue
        try:
            timed = bench.run(ladder, level)
        except RunError as error:
            rungs.append(Rung(level, None, None, f"failed: {error}"))
            continue
        size = level.scene.particles.number if ladder.model == "microscopic" else sample_group
        bins = bin_result(timed.result, None if ladder.is_grid else size)
        last = (timed.best, level.cost)
        light = replace(timed, result=replace(timed.result, variables={}))
        rungs.append(Rung(level, light, bins, "completed"))
    return rungs


def _refined(
    climbed: Sequence[tuple[Ladder, Sequence[Rung]]],
) -> dict[str, tuple[Bins, Errors | None]]:
    """Each grid model's extrapolated bins and their uncertainty (None with a single level)."""
    refined: dict[str, tuple[Bins, Errors | None]] = {}
    for ladder, rungs in climbed:
        if not ladder.is_grid or ladder.scheme != "accurate":
            continue
        chain = _coarser_and_coarser(rungs)
        if len(chain) == 1:
            refined[ladder.model] = (chain[0][1], None)
        elif chain:
            (h, fine), (h_middle, middle) = chain[:2]
            coarse = chain[2][1] if len(chain) > 2 else None
            spread = remaining_distance(fine, middle, coarse)
            refined[ladder.model] = (extrapolate(fine, middle, h_middle / h), spread)
    return refined


def _coarser_and_coarser(rungs: Sequence[Rung]) -> list[tuple[float, Bins]]:
    """Spacing and bins of the finest level, and on to the next that is wider by `_LEAST_RATIO`."""
    chain: list[tuple[float, Bins]] = []
    for rung in reversed(rungs):
        h = rung.level.spacing
        if rung.bins is not None and (not chain or h > _LEAST_RATIO * chain[-1][0]):
            chain.append((h, rung.bins))
    return chain


def _parts(ladder: Ladder, rung: Rung, bins: Bins, yardstick: Yardstick) -> Parts:
    """The parts of one level's error, see `compare.error_budget`."""
    y = yardstick.bins
    if ladder.is_grid:
        if ladder.model not in yardstick.refined:
            return Parts()  # the scheme `accurate` never came to its end
        refined, spread = yardstick.refined[ladder.model]
        closure, closure_spread = distance(refined, y)
        return Parts(
            discretisation=distance(bins, refined)[0],
            closure=closure,
            discretisation_spread=spread,
            offset_spread=closure_spread,
        )
    scene = rung.level.scene
    samples = scene.particles.number * scene.particles.realisations
    ensemble = yardstick.ensemble
    if ladder.model == "microscopic" and ensemble is not None:
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


def _row(ladder: Ladder, rung: Rung, yardstick: Yardstick) -> FrontierRow:
    scene = rung.level.scene
    if rung.timed is None or rung.bins is None:
        nothing = tuple(float("nan") for _ in scene.times)
        text = level_text(ladder, rung.level)
        return FrontierRow(
            scene.name, ladder.model, ladder.scheme, text, nothing, nothing, np.nan, rung.status
        )
    total = total_error(rung.bins, yardstick.bins)
    return FrontierRow(
        scene=scene.name,
        model=ladder.model,
        scheme=ladder.scheme,
        resolution=str(rung.timed.result.attributes["resolution"]),
        density_errors=tuple(map(float, total.density)),
        angle_errors=tuple(map(float, total.angle)),
        wall_seconds=rung.timed.best,
        median_seconds=rung.timed.median,
        repeats=rung.timed.repeats,
        parts=_parts(ladder, rung, rung.bins, yardstick),
        warnings=tuple(rung.timed.result.warnings),
    )


def level_text(ladder: Ladder, level: Level) -> str:
    """A level in words, for one that was not run."""
    numerics, particles = level.scene.numerics, level.scene.particles
    if ladder.is_grid:
        angles = f", {numerics.angle_cells} angles" if ladder.model.startswith("q_") else ""
        return f"h = {numerics.cell:g}{angles}"
    step = (
        f"dt = {numerics.time_step:g}"
        if ladder.scheme == "paper"
        else f"tolerance = {numerics.tolerance:g}"
    )
    return f"{particles.number} x {particles.realisations} particles, {step}"
