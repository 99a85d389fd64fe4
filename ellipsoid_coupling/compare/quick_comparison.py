"""Two models at three resolutions, or finished runs, held against one reference; without parts."""

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
from ellipsoid_coupling.models import SCHEMES, SchemeName
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import Report, simulate

SHORT_MODELS = ("microscopic", "rho_mono_kinetic")

# How much coarser than the scene's own resolution each row of `short_frontier` is.
_COARSER = (4, 2, 1)
_LOOSER = (100, 10, 1)


class Case(NamedTuple):
    """One run of a `short_frontier`."""

    model: str
    scheme: SchemeName
    scene: Scene


def short_cases(scene: Scene) -> list[Case]:
    """Two models, both schemes, three resolutions, the scene's own the last of each.

    The grid is refined in h; particles in the time step (`paper`) or the tolerance (`accurate`).
    """
    numerics = scene.numerics
    cases = []
    for model in SHORT_MODELS:
        for scheme in SCHEMES:
            if model != "microscopic":
                values = [("numerics.cell", numerics.cell * factor) for factor in _COARSER]
            elif scheme == "paper":
                values = [("numerics.time_step", numerics.time_step * f) for f in _COARSER]
            else:
                values = [("numerics.tolerance", numerics.tolerance * f) for f in _LOOSER]
            cases += [Case(model, scheme, changed(scene, dict([value]))) for value in values]
    return cases


def short_frontier(
    scene: Scene,
    flow: FlowField | None,
    *,
    seed: int = 0,
    folder: Path | None = None,
    report: Report | None = None,
) -> Frontier:
    """Two models at three resolutions each, timed once after a warm-up, without parts.

    The reference is exact where particles are independent; elsewhere it is a microscopic ensemble
    of its own start positions (seed + 1), whose sampling error is given along. With a `folder`, the
    runs at the scene's own resolution are kept there as run folders.
    """
    reference, exact = _short_reference(scene, flow, seed, report)
    rows: list[FrontierRow] = []
    finest: dict[tuple[str, str], Result] = {}
    cases = short_cases(scene)
    for number, case in enumerate(cases):
        if number % len(_COARSER) == 0:
            warm_up(case.scene, case.model, case.scheme, flow, seed)
        keep = folder is not None and case.scene == scene
        name = f"{scene.name}-{case.model}-{case.scheme}"
        try:
            result = simulate(
                case.scene,
                case.model,
                case.scheme,
                flow=flow,
                seed=seed,
                folder=folder / name if folder is not None and keep else None,
                report=_numbered(report, number + 1, len(cases)),
            )
        except RunError as error:
            rows.append(_failed_row(case, error))
            continue
        rows.append(frontier_row(result, reference))
        finest[case.model, case.scheme] = result
    ensemble = finest.get(("microscopic", "accurate"), reference) if exact else reference
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

    return simulate(scene, "microscopic", flow=flow, seed=seed + 1, report=named), False


def _numbered(report: Report | None, number: int, count: int) -> Report | None:
    if report is None:
        return None
    return lambda stage, part: report(f"{stage} (run {number} of {count})", part)


def _tell(report: Callable[[str, float], None] | None, stage: str, part: float) -> None:
    if report is not None:
        report(stage, part)


def frontier_row(result: Result, reference: Result) -> FrontierRow:
    """One result held against the reference."""
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


def _failed_row(case: Case, error: RunError) -> FrontierRow:
    nothing = tuple(float("nan") for _ in case.scene.times)
    return FrontierRow(
        case.scene.name, case.model, case.scheme, "", nothing, nothing, float("nan"), str(error)
    )


def compare_runs(
    results: Sequence[Result], flow: FlowField | Sequence[FlowField | None] | None
) -> Frontier:
    """Hold finished runs of one scene against the exact solution or their largest ensemble.

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
    """The one flow that all are; InputError where their numbers differ."""
    found = {flow.digest: flow for flow in flows if flow is not None}
    if len(found) > 1:
        told = "; ".join(f"{flow.origin} (digest {digest})" for digest, flow in found.items())
        raise InputError("compare", "runs in one flow", told, "Compare runs in the same flow.")
    return next(iter(found.values()), None)
