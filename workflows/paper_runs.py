"""The runs of workflows/paper.py: one scene with its models, both schemes and the mean-field limit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from paper_page import Difference, Page, Verdict

from ellipsoid_coupling import Result, load_scene, simulate
from ellipsoid_coupling.compare import errors_against
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.models import SCHEMES, SchemeName
from ellipsoid_coupling.output.figures import (
    axis_rows,
    density_rows,
    draw_angles,
    draw_density,
    draw_directors,
    draw_ellipses,
    draw_flow,
    draw_order,
)
from ellipsoid_coupling.simulation import scene_flow

Floats = NDArray[np.float64]

# Seconds instead of minutes: everything is written, but the verdicts mean nothing.
QUICK: dict[str, Any] = {
    "particles.realisations": 2,
    "particles.number": 60,
    "numerics.angle_cells": 12,
}
_COARSE = {"numerics.cell": 0.05, "flow.cells": 16}
QUICK_SCENES: dict[str, dict[str, Any]] = {
    "top_bottom": {"numerics.cell": 0.15},
    "rotation": {"numerics.cell": 0.15},
    "cavity": _COARSE,
    "cavity_free": _COARSE,
}
LIMIT = "mckean_vlasov"
TITLES = {"paper": "the paper's scheme", "accurate": "scheme accurate"}
SNAPSHOT_PARTICLES = {"top_bottom": 50, "rotation": 20, "cavity": 200, "cavity_free": 200}


@dataclass(frozen=True)
class Runs:
    """The runs of one scene: by scheme and model, and the mean-field limit; failed ones are absent."""

    by_scheme: dict[str, dict[str, Result]]
    limit: Result | None

    def shown(self, scheme: str) -> list[Result]:
        """Of one scheme, and the limit."""
        return [*self.by_scheme[scheme].values(), *([self.limit] if self.limit else [])]


def sizes_of(page: Page, name: str) -> dict[str, Any]:
    """The settings of a scene's runs: none but at `--quick`."""
    return QUICK | QUICK_SCENES[name] if page.quick else {}


def run_scene(page: Page, name: str, models: Sequence[str]) -> Runs:
    """The scene with each model and both schemes, and with `mckean_vlasov`."""
    scene = load_scene(name, sizes_of(page, name))
    flow = scene_flow(scene, None, page.report)

    def run(model: str, scheme: SchemeName) -> dict[str, Result]:
        try:
            result = simulate(scene, model, scheme, flow=flow, report=page.report)
        except RunError as error:
            page.tell_failure(scene.name, model, scheme, str(error))
            return {}
        page.tell_run(result)
        return {model: result}

    found: dict[str, dict[str, Result]] = {scheme: {} for scheme in SCHEMES}
    for scheme in SCHEMES:
        for model in models:
            found[scheme] |= run(model, scheme)
    runs = Runs(found, run(LIMIT, "accurate").get(LIMIT))
    tell_differences(page, runs)
    return runs


def tell_differences(page: Page, runs: Runs) -> None:
    """The parts of each grid model's distance to the microscopic ensemble: scheme, closure, finite N."""
    own, accurate = runs.by_scheme["paper"], runs.by_scheme["accurate"]
    ensemble = accurate.get("microscopic")
    if ensemble is None or runs.limit is None:
        return
    finite = errors_against(ensemble, runs.limit)
    for model in [name for name in accurate if name in own and name != "microscopic"]:
        scheme = errors_against(own[model], accurate[model])
        closure = errors_against(accurate[model], runs.limit)
        for kind in ("density", "angle"):
            parts = (getattr(errors, kind) for errors in (scheme, closure, finite))
            rows = zip(ensemble.times, *parts, strict=True)
            page.differences += [
                Difference(ensemble.scene.name, model, kind, *map(float, row)) for row in rows
            ]


def judge_both(
    page: Page,
    runs: Runs,
    statement: str,
    models: Sequence[str],
    decide: Callable[[dict[str, Result]], tuple[bool, str]],
) -> None:
    """A verdict for each scheme; one of whose models a run failed does not reproduce."""
    for scheme, results in runs.by_scheme.items():
        absent = [model for model in models if model not in results]
        holds, evidence = (False, f"failed: {', '.join(absent)}") if absent else decide(results)
        page.judge(Verdict(statement, holds, evidence, scheme))


def scene_figures(page: Page, name: str, runs: Runs) -> None:
    """Flow, ellipses, densities and angles of one scene; the last two for each scheme."""
    sizes = sizes_of(page, name)
    scene = load_scene(name, sizes)
    flow = scene_flow(scene, None, page.report)
    extent = (*scene.domain.x, *scene.domain.y)
    if flow is not None:
        page.add(draw_flow(flow, extent, page.folder / f"{name}_flow.png"), f"{scene.title}: flow.")
    few = load_scene(name, sizes | {"particles.number": SNAPSHOT_PARTICLES[name]})
    snapshot = simulate(few, "microscopic", flow=flow, realisations=1, report=page.report)
    path = page.folder / f"{name}_ellipses.png"
    page.add(draw_ellipses(snapshot, path, flow=flow), f"{scene.title}: ellipses to scale.")
    for scheme, title in TITLES.items():
        path = page.folder / f"{name}_density_{scheme}.png"
        rows = density_rows(list(runs.by_scheme[scheme].values()), flow=flow)
        page.add(draw_density(rows, path, title=title), f"{scene.title}: densities, {title}.")
        path = page.folder / f"{name}_angles_{scheme}.png"
        caption = (
            f"{scene.title}: angle distributions, {title}; McKean-Vlasov is the limit of many."
        )
        page.add(draw_angles(runs.shown(scheme), path, title=title), caption)
    accurate = list(runs.by_scheme["accurate"].values())
    if accurate:
        path = page.folder / f"{name}_directors.png"
        caption = f"{scene.title}: mean axes, as long as the order S."
        page.add(draw_directors(axis_rows(accurate, flow), path), caption)
        path = page.folder / f"{name}_order.png"
        caption = f"{scene.title}: the order of the axes."
        page.add(draw_order(runs.shown("accurate"), path), caption)


def distances(
    results: dict[str, Result], before: float = math.inf
) -> dict[str, tuple[Floats, Floats]]:
    """L1 distances (density, angle) of every model to `microscopic` at the times `before`."""
    reference = results["microscopic"]
    early = reference.times < before
    errors = {
        model: errors_against(result, reference)
        for model, result in results.items()
        if result is not reference
    }
    return {model: (found.density[early], found.angle[early]) for model, found in errors.items()}


def text_of(found: dict[str, Floats]) -> str:
    """Numbers by model, in words."""
    return "; ".join(
        f"{model} {', '.join(f'{value:.2f}' for value in values)}"
        for model, values in found.items()
    )


def all_within(
    results: dict[str, Result],
    models: Sequence[str],
    kind: Literal["density", "angle"],
    bound: float,
    before: float = math.inf,
) -> tuple[bool, str]:
    """Whether all models stay within a distance of `microscopic` at all times; and the distances."""
    index = 0 if kind == "density" else 1
    away = distances(results, before)
    chosen = {model: away[model][index] for model in models}
    holds = all(np.all(values <= bound) for values in chosen.values())
    return holds, f"L1 {kind}, bound {bound:g}: {text_of(chosen)}"
