"""Error against run time: every model and scheme at several resolutions, against one yardstick.

`run_frontier` climbs the ladder (`compare.ladder`) of every model that fits the scene, times each
level (`compare.timing`) and splits its error into parts (`compare.split`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ellipsoid_coupling.compare.errors import Errors
from ellipsoid_coupling.compare.ladder import Ladder, Level, changed, make_ladder
from ellipsoid_coupling.compare.reference import exact_reference, has_exact_reference
from ellipsoid_coupling.compare.split import (
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

# Of the yardstick: samples, and how much finer than the scene's own its interaction is summed. At
# the scene's own harmonics_tolerance the angles of `rotation` are 0.03 off.
_MOST_SAMPLES = 1_000_000
# 384^2 points of the exact solution are 0.003 off on the bins of `cavity_free`, 256^2 0.005.
_EXACT_SIDE = 384
_FINER_HARMONICS = 4.0
_FEWEST_REALISATIONS = 8
# Of the spacings of two levels that are extrapolated: nearer ones would magnify what is not of order h^p.
_LEAST_RATIO = 1.45
# So many levels are tried whatever the one before took: after a crossing of characteristics a coarse
# grid may take more steps than a fine one. A run that takes too long is stopped.
_TRIED = 4
# The yardstick may take so many times what other runs may: all of them are measured against it.
_YARDSTICK_TIME = 3.0


@dataclass(frozen=True)
class FrontierRow:
    """One row: what was run, how long it took, how far it was off at each saved time.

    density_errors, angle_errors : L1 distances to the reference, one a saved time.
    wall_seconds : the best of `repeats` runs; `median_seconds` their median.
    parts : of the errors; None where they were not split.
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


@dataclass(frozen=True)
class Yardstick:
    """What errors are measured against.

    result, bins : the exact solution or the refined `mckean_vlasov`
    ensemble : the refined `microscopic` ensemble; None where that model was not asked for
    refined : each grid model's extrapolated bins and their uncertainty
    group_size : particles of a realisation; None where samples are not random
    spread : distance of the refined `mckean_vlasov` to the run before it; None for exact or one run
    """

    result: Result
    bins: Bins
    exact: bool
    ensemble: Bins | None
    refined: dict[str, tuple[Bins, Errors | None]]
    group_size: int | None
    spread: Errors | None


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
    yardstick = _yardstick(scene, models, bench)
    climbed = [(ladder, climb(ladder, bench, yardstick.group_size)) for ladder in ladders]
    yardstick.refined.update(_refined(climbed))
    rows = [_row(ladder, rung, yardstick) for ladder, rungs in climbed for rung in rungs]
    return Frontier(
        rows=rows,
        reference=yardstick.result,
        exact=yardstick.exact,
        sampling=_own_sampling(yardstick),
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


def _yardstick(scene: Scene, models: Sequence[str], bench: Bench) -> Yardstick:
    noisy = scene.noise is not None and (scene.noise.noise > 0 or scene.noise.angular_noise > 0)
    group = scene.particles.number if noisy else None
    spread = None
    exact = has_exact_reference(scene)
    if exact:
        bench.tell(f"{scene.name}: exact reference", 0.0)
        result = exact_reference(scene, bench.flow, _EXACT_SIDE)
        bench.tell(f"{scene.name}: exact reference", 1.0)
        bins = bin_result(result)
    else:
        result, before = _refined_samples(
            scene, replace(bench, seed=bench.seed + 1, longest=_YARDSTICK_TIME * bench.longest)
        )
        bins = bin_result(result, group)
        if before is not None:
            spread = distance(bins, bin_result(before, group))[0]
    ensemble = _refined_ensemble(scene, bench) if "microscopic" in models else None
    return Yardstick(result, bins, exact, ensemble, {}, group, spread)


def _refined_samples(scene: Scene, bench: Bench) -> tuple[Result, Result | None]:
    """`mckean_vlasov` up to the scene's own tolerance and a million samples, as far as time allows.

    The finest, and the one before it.
    """
    numerics, own = scene.numerics, scene.particles.realisations
    most = max(own, _MOST_SAMPLES // scene.particles.number)
    finer = {"numerics.harmonics_tolerance": numerics.harmonics_tolerance / _FINER_HARMONICS}
    levels = [
        Level(
            changed(scene, finer | {"numerics.tolerance": numerics.tolerance * factor}), cost, 0.0
        )
        for factor, cost in ((100.0, 1.0), (10.0, 1.3), (1.0, 2.0))
    ]
    # Building the harmonics costs most of a run; what a sample costs is unknown before: too long a
    # run is stopped, and the one before it taken.
    most_of_all = changed(levels[-1].scene, {"particles.realisations": most})
    levels.append(Level(most_of_all, 4.0, 0.0))
    return _finest(Ladder("mckean_vlasov", "accurate", tuple(levels), False), bench)


def _refined_ensemble(scene: Scene, bench: Bench) -> Bins:
    """`microscopic` at the scene's own tolerance and realisations, or as many as time allows."""
    own = max(_FEWEST_REALISATIONS, scene.particles.realisations)
    counts = sorted({max(_FEWEST_REALISATIONS, own // part) for part in (16, 4, 2, 1)})
    levels = [
        Level(changed(scene, {"particles.realisations": count}), float(count), 0.0)
        for count in counts
    ]
    result, _ = _finest(Ladder("microscopic", "accurate", tuple(levels), False), bench)
    return bin_result(result, scene.particles.number)


def _finest(ladder: Ladder, bench: Bench) -> tuple[Result, Result | None]:
    """The finest level that the time allows, and the one before it.

    Raises
    ------
    RunError
        If the first level fails.
    """
    bench.warm_up(ladder)
    last: Timed | None = None
    before: Timed | None = None
    cost = 0.0
    for level in ladder.levels:
        if last is not None and last.best * level.cost / cost > bench.longest:
            break
        try:
            # There must be one: the first level may take as long as it needs.
            allowed = bench if last is not None else replace(bench, longest=math.inf)
            found = allowed.run(ladder, level, repeats=1)
        except RunError:
            if last is None:
                raise
            break
        last, before, cost = found, last, level.cost
    assert last is not None  # a ladder has a level, and the first one raises
    return last.result, None if before is None else before.result


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
    """The parts of one level's error, see `compare.split`."""
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


def _own_sampling(yardstick: Yardstick) -> Errors:
    """What the yardstick's own finite number of samples costs; 0 where they are not random."""
    bins = yardstick.bins
    if bins.density.shape[0] > 1:
        return sampling_error(bins, bins.samples * bins.density.shape[0])
    nothing = np.zeros(yardstick.result.times.size)
    return Errors(nothing, nothing)
