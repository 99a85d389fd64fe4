"""The errors of two models at three resolutions, or of finished runs, without their parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.compare.distances import errors_against, sampling_errors
from ellipsoid_coupling.compare.exact_solution import exact_reference, has_exact_reference
from ellipsoid_coupling.compare.frontier import Frontier, FrontierRow
from ellipsoid_coupling.compare.resolutions import changed
from ellipsoid_coupling.compare.timing import warm_up
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import (
    ADAPTIVE_SCHEME,
    SCHEMES,
    SchemeName,
    model_kinds,
    scheme_named,
)
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import Report, simulate

# How much coarser than the scene's own resolution each row of `short_frontier` is.
_COARSER = (4, 2, 1)
_LOOSER = (100, 10, 1)


class ShortRun(NamedTuple):
    """One run of a `short_frontier`."""

    model: str
    scheme: SchemeName
    scene: Scene


def particle_model() -> str:
    """The first model of particles, of which every scene has one."""
    return next(kind.name for kind in model_kinds() if kind.independent_realisations)


def short_runs(scene: Scene) -> list[ShortRun]:
    """Two models, both schemes, three resolutions, the scene's own the last of each.

    The models are the first of particles and the first on a grid in space. The grid is refined in h;
    particles in the time step or the tolerance.
    """
    numerics = scene.numerics
    on_grid = next(kind.name for kind in model_kinds() if kind.layout == "rho")
    runs = []
    for model in (particle_model(), on_grid):
        for name in SCHEMES:
            scheme = scheme_named(name)
            if model == on_grid:
                values = [("numerics.cell", numerics.cell * factor) for factor in _COARSER]
            else:
                factors = _LOOSER if scheme.adaptive else _COARSER
                key = f"numerics.{scheme.step_key}"
                values = [(key, scheme.step(numerics) * factor) for factor in factors]
            runs += [ShortRun(model, name, changed(scene, dict([value]))) for value in values]
    return runs


def short_frontier(
    scene: Scene,
    flow: FlowField | None,
    *,
    seed: int = 0,
    folder: Path | None = None,
    report: Report | None = None,
) -> Frontier:
    """Two models at three resolutions each, timed once after a warm-up, without parts.

    The reference is exact where particles are independent; elsewhere it is an ensemble of particles
    with start positions of its own (seed + 1), whose sampling error is part of the result. With a
    `folder`, the runs at the scene's own resolution are kept there as run folders.
    """
    reference, exact = _short_reference(scene, flow, seed, report)
    rows: list[FrontierRow] = []
    finest: dict[tuple[str, str], Result] = {}
    runs = short_runs(scene)
    for number, run in enumerate(runs):
        if number % len(_COARSER) == 0:
            warm_up(run.scene, run.model, run.scheme, flow, seed)
        keep = folder is not None and run.scene == scene
        name = f"{scene.name}-{run.model}-{run.scheme}"
        try:
            result = simulate(
                run.scene,
                run.model,
                run.scheme,
                flow=flow,
                seed=seed,
                folder=folder / name if folder is not None and keep else None,
                report=_numbered(report, number + 1, len(runs)),
            )
        except RunError as error:
            rows.append(_failed_row(run, error))
            continue
        rows.append(frontier_row(result, reference))
        finest[run.model, run.scheme] = result
    particles = particle_model(), ADAPTIVE_SCHEME
    ensemble = finest.get(particles, reference) if exact else reference
    return Frontier(
        rows, reference, exact, sampling_errors(ensemble), finest, _reference_name(exact)
    )


def _reference_name(exact: bool) -> str:
    return "exact" if exact else "microscopic ensemble"


def _short_reference(
    scene: Scene, flow: FlowField | None, seed: int, report: Report | None
) -> tuple[Result, bool]:
    if has_exact_reference(scene):
        _tell(report, f"{scene.name}: exact reference", 0.0)
        reference = exact_reference(scene, flow)
        _tell(report, f"{scene.name}: exact reference", 1.0)
        return reference, True

    def named(stage: str, part: float) -> None:
        _tell(report, f"{stage} (reference)", part)

    return simulate(scene, particle_model(), flow=flow, seed=seed + 1, report=named), False


def _numbered(report: Report | None, number: int, count: int) -> Report | None:
    if report is None:
        return None
    return lambda stage, part: report(f"{stage} (run {number} of {count})", part)


def _tell(report: Callable[[str, float], None] | None, stage: str, part: float) -> None:
    if report is not None:
        report(stage, part)


def frontier_row(result: Result, reference: Result) -> FrontierRow:
    """The errors of one result against the reference."""
    errors = errors_against(result, reference)
    seconds = float(result.attributes["wall_seconds"])
    return FrontierRow(
        scene=result.scene.name,
        model=result.model,
        scheme=result.scheme,
        resolution=str(result.attributes["resolution"]),
        density_errors=tuple(map(float, errors.density)),
        angle_errors=tuple(map(float, errors.angle)),
        wall_seconds=seconds,
        median_seconds=seconds,
        warnings=tuple(result.warnings),
    )


def _failed_row(run: ShortRun, error: RunError) -> FrontierRow:
    nothing = tuple(float("nan") for _ in run.scene.times)
    return FrontierRow(
        run.scene.name, run.model, run.scheme, "", nothing, nothing, float("nan"), str(error)
    )


def compare_runs(
    results: Sequence[Result], flow: FlowField | Sequence[FlowField | None] | None
) -> Frontier:
    """The errors of finished runs of one scene against the exact solution or their largest ensemble.

    Parameters
    ----------
    results : Results
    flow : that of all of them, or one a result; None for a scene without fluid

    Raises
    ------
    InputError
        For runs of different scenes or in different flows, or none that can be the reference.
    """
    scene = results[0].scene
    names = {result.scene.name for result in results}
    if len(names) > 1:
        remedy = "Compare one scene at a time."
        raise InputError("compare", "runs of one scene", ", ".join(sorted(names)), remedy)
    common = _common_flow(flow) if isinstance(flow, Sequence) else flow
    exact = has_exact_reference(scene)
    if exact:
        reference = exact_reference(scene, common)
    else:
        ensembles = [result for result in results if result.layout == "particles"]
        if not ensembles:
            remedy = "Add a microscopic run."
            raise InputError("compare", "a particle run as reference", "only grids", remedy)
        reference = max(ensembles, key=lambda result: result.variables["x"].size)
    rows = [frontier_row(result, reference) for result in results if result is not reference]
    finest = {(result.model, result.scheme): result for result in results}
    sampling = sampling_errors(reference)
    return Frontier(rows, reference, exact, sampling, finest, _reference_name(exact))


def _common_flow(flows: Sequence[FlowField | None]) -> FlowField | None:
    """The one flow of all runs; InputError where their numbers differ."""
    different = {flow.digest: flow for flow in flows if flow is not None}
    if len(different) > 1:
        origins = "; ".join(f"{f.origin} (digest {digest})" for digest, f in different.items())
        raise InputError("compare", "runs in one flow", origins, "Compare runs in the same flow.")
    return next(iter(different.values()), None)
