"""Error against run time: every model and scheme at several resolutions, against one reference."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ellipsoid_coupling.compare.errors import Errors, errors_against, sampling_errors
from ellipsoid_coupling.compare.reference import exact_reference, has_exact_reference
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import SCHEMES, SchemeName
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, scene_from_table
from ellipsoid_coupling.simulation import Report, simulate

FRONTIER_MODELS = ("microscopic", "rho_mono_kinetic")

# How much coarser than the scene's own resolution each row of a model and scheme is.
_COARSER = (4, 2, 1)
_LOOSER = (100, 10, 1)


@dataclass(frozen=True)
class FrontierRow:
    """One row: what was run, how long it took, how far it was off at each saved time.

    density_errors, angle_errors : L1 distances to the reference, one a saved time.
    """

    scene: str
    model: str
    scheme: str
    resolution: str
    density_errors: tuple[float, ...]
    angle_errors: tuple[float, ...]
    wall_seconds: float
    status: str = "completed"


@dataclass(frozen=True)
class Frontier:
    """All rows of a scene, the reference that they are held against, and its sampling error."""

    rows: list[FrontierRow]
    reference: Result
    exact: bool
    sampling: Errors
    finest: dict[tuple[str, str], Result]


class Case(NamedTuple):
    """One run of a frontier."""

    model: str
    scheme: SchemeName
    scene: Scene


def _changed(scene: Scene, key: str, value: float) -> Scene:
    table: dict[str, Any] = scene.model_dump(mode="json", exclude_none=True)
    table["numerics"][key] = value
    return scene_from_table(table, f"scene {scene.name}, numerics.{key} = {value:g}")


def frontier_cases(scene: Scene, models: Sequence[str] = FRONTIER_MODELS) -> list[Case]:
    """Three resolutions of every model and scheme, the scene's own the last of each.

    Grids are refined in h; particles in the time step (`paper`) or the tolerance (`accurate`).
    """
    numerics = scene.numerics
    cases = []
    for model in models:
        for scheme in SCHEMES:
            if model != "microscopic":
                values = [("cell", numerics.cell * factor) for factor in _COARSER]
            elif scheme == "paper":
                values = [("time_step", numerics.time_step * factor) for factor in _COARSER]
            else:
                values = [("tolerance", numerics.tolerance * factor) for factor in _LOOSER]
            cases += [Case(model, scheme, _changed(scene, *value)) for value in values]
    return cases


def run_frontier(
    scene: Scene,
    flow: FlowField | None,
    *,
    models: Sequence[str] = FRONTIER_MODELS,
    seed: int = 0,
    folder: Path | None = None,
    report: Report | None = None,
) -> Frontier:
    """Run all cases of a scene and hold them against its reference.

    The reference is exact where particles are independent; elsewhere it is a microscopic ensemble
    of its own start positions (seed + 1), whose sampling error is given along. With a `folder`, the
    runs at the scene's own resolution are kept there as run folders.
    """
    reference, exact = _reference(scene, flow, seed, report)
    rows: list[FrontierRow] = []
    finest: dict[tuple[str, str], Result] = {}
    cases = frontier_cases(scene, models)
    for number, case in enumerate(cases):
        own = case.scene == scene
        try:
            result = simulate(
                case.scene,
                case.model,
                case.scheme,
                flow=flow,
                seed=seed,
                folder=folder / f"{scene.name}-{case.model}-{case.scheme}"
                if folder and own
                else None,
                report=_numbered(report, number + 1, len(cases)),
            )
        except RunError as error:
            rows.append(_failed_row(case, error))
            continue
        rows.append(frontier_row(result, reference))
        finest[case.model, case.scheme] = result
    ensemble = finest.get(("microscopic", "accurate"), reference) if exact else reference
    return Frontier(rows, reference, exact, sampling_errors(ensemble), finest)


def _reference(
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
    return FrontierRow(
        scene=result.scene.name,
        model=result.model,
        scheme=result.scheme,
        resolution=str(result.attributes["resolution"]),
        density_errors=tuple(map(float, errors.density)),
        angle_errors=tuple(map(float, errors.angle)),
        wall_seconds=float(result.attributes["wall_seconds"]),
    )


def _failed_row(case: Case, error: RunError) -> FrontierRow:
    nothing = tuple(float("nan") for _ in case.scene.times)
    return FrontierRow(
        case.scene.name, case.model, case.scheme, "", nothing, nothing, float("nan"), str(error)
    )


def compare_runs(results: Sequence[Result], flow: FlowField | None) -> Frontier:
    """Hold finished runs of one scene against the exact solution or their largest ensemble.

    Raises
    ------
    InputError
        For runs of different scenes, or none that can be the reference.
    """
    scene = results[0].scene
    names = {result.scene.name for result in results}
    if len(names) > 1:
        remedy = "Compare one scene at a time."
        raise InputError("compare", "runs of one scene", ", ".join(sorted(names)), remedy)
    exact = has_exact_reference(scene)
    if exact:
        reference = exact_reference(scene, flow)
    else:
        ensembles = [result for result in results if result.layout == "particles"]
        if not ensembles:
            remedy = "Add a microscopic run."
            raise InputError("compare", "a particle run as reference", "only grids", remedy)
        reference = max(ensembles, key=lambda result: result.variables["x"].size)
    rows = [frontier_row(result, reference) for result in results if result is not reference]
    finest = {(result.model, result.scheme): result for result in results}
    return Frontier(rows, reference, exact, sampling_errors(reference), finest)


def write_table(frontiers: Sequence[Frontier], folder: Path) -> Path:
    """errors.csv: one line per row of all frontiers, one error column per saved time."""
    path = folder / "errors.csv"
    beside = path.with_name(".errors.csv")
    with beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                "scene",
                "model",
                "scheme",
                "resolution",
                "time",
                "density_error",
                "angle_error",
                "sampling_error_density",
                "sampling_error_angle",
                "reference",
                "wall_seconds",
                "status",
            ]
        )
        for frontier in frontiers:
            writer.writerows(_csv_rows(frontier))
    beside.replace(path)
    return path


def _csv_rows(frontier: Frontier) -> list[list[str]]:
    kind = "exact" if frontier.exact else "microscopic ensemble"
    lines = []
    for row in frontier.rows:
        for i, time in enumerate(frontier.reference.times):
            numbers = (
                row.density_errors[i],
                row.angle_errors[i],
                float(frontier.sampling.density[i]),
                float(frontier.sampling.angle[i]),
            )
            lines.append(
                [row.scene, row.model, row.scheme, row.resolution, f"{time:g}"]
                + [f"{number:.6g}" for number in numbers]
                + [kind, f"{row.wall_seconds:.3f}", row.status]
            )
    return lines
