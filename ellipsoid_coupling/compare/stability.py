"""A map of stability: stiff and extreme cases, every model and scheme, what held and what broke.

A case is a change of a small cavity scene. A run is "stable" if it comes to its end with finite
fields, mass to rounding, no negative density, and speeds that stay within ten times what drives them;
"unstable" if only the speeds go beyond; "failed" if the solver stopped, with its own words.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import SCHEMES, SchemeName
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, load_scene
from ellipsoid_coupling.simulation import Report, scene_flow, simulate

STABILITY_MODELS = ("microscopic", "rho_mono_kinetic")

_SMALL: dict[str, Any] = {
    "particles.number": 200,
    "particles.realisations": 2,
    "times": [1.0],
    "flow.cells": 64,
    "numerics.cell": 0.04,
}
CASES: dict[str, dict[str, Any]] = {
    "the cavity as it is": {},
    "no drag": {"flow.drag": 0.0, "flow.angular_drag": 0.0},
    "stiff drag, 1e3": {"flow.drag": 1e3, "flow.angular_drag": 1e3},
    "stiff drag, 1e6": {"flow.drag": 1e6, "flow.angular_drag": 1e6},
    "time step and CFL number at their largest": {
        "numerics.time_step": 0.1,
        "numerics.tolerance": 1.0,
        "numerics.cfl": 1.0,
    },
    "interaction 100 times stronger": {"interaction.strength": 100.0},
    "inertia 1e-6": {"particles.inertia": 1e-6},
    "needles, aspect ratio 20": {"particles.width": 0.0025},
    "circles": {"particles.width": 0.05},
    "one filled cell": {"start.x": [0.48, 0.52], "start.y": [0.48, 0.52]},
    "start against the lid": {"start.x": [0.4, 0.6], "start.y": [0.8, 1.0]},
    "ghost cells of density 1/h^2": {"walls.ghost_density": "paper"},
    "strong noise, A = B = 10": {"noise": {"noise": 10.0, "angular_noise": 10.0}},
}
_SPEED_LIMIT = 10.0


@dataclass(frozen=True)
class StabilityCell:
    """One run of the map."""

    case: str
    model: str
    scheme: str
    verdict: str
    detail: str
    fastest: float
    steps: float
    wall_seconds: float


def stability_scene(changes: dict[str, Any]) -> Scene:
    """The small cavity scene with a case's changes."""
    return load_scene("cavity", _SMALL | changes)


def map_stability(
    report: Report | None = None, flow: FlowField | None = None
) -> list[StabilityCell]:
    """Run every case with every model and scheme."""
    field = flow if flow is not None else scene_flow(stability_scene({}), None, report)
    cells: list[StabilityCell] = []
    total = len(CASES) * len(STABILITY_MODELS) * len(SCHEMES)
    for case, changes in CASES.items():
        scene = stability_scene(changes)
        for model in STABILITY_MODELS:
            for scheme in SCHEMES:
                if report is not None:
                    report("stability map", len(cells) / total)
                cells.append(_examine(case, scene, model, scheme, field))
    if report is not None:
        report("stability map", 1.0)
    return cells


def _examine(
    case: str, scene: Scene, model: str, scheme: SchemeName, flow: FlowField | None
) -> StabilityCell:
    started = time.perf_counter()
    try:
        result = simulate(scene, model, scheme, flow=flow)
    except RunError as error:
        words = str(error).split(": ", 1)[-1]
        spent = time.perf_counter() - started
        return StabilityCell(case, model, scheme, "failed", words, float("nan"), 0.0, spent)
    fastest = _fastest(result)
    verdict, detail = _judge(result, scene, fastest)
    return StabilityCell(
        case,
        model,
        scheme,
        verdict,
        detail,
        fastest,
        float(result.attributes["steps"]),
        float(result.attributes["wall_seconds"]),
    )


def _fastest(result: Result) -> float:
    """The largest speed; in cells only where a millionth of the largest density is."""
    speed = np.hypot(result.variables["velocity_x"], result.variables["velocity_y"])
    if result.layout == "rho":
        density = result.variables["density"]
        speed = speed[density > 1e-6 * density.max()]
    return float(speed.max())


def _judge(result: Result, scene: Scene, fastest: float) -> tuple[str, str]:
    if not all(np.isfinite(values).all() for values in result.variables.values()):
        return "failed", "not finite"
    if result.layout == "rho":
        if result.variables["density"].min() < 0.0:
            return "failed", "negative density"
        lost = abs(result.attributes["mass_end"] / result.attributes["mass_start"] - 1.0)
        if lost > 1e-12:
            return "failed", f"mass off by {lost:.1e}"
    noise = scene.noise.noise if scene.noise is not None else 0.0
    # The lid drives with speed 1, noise with a unit Gaussian (five standard deviations at the most).
    limit = _SPEED_LIMIT * (1.0 if noise == 0.0 else 5.0)
    words = f"fastest {fastest:.3g}, {result.attributes['steps']:.0f} steps"
    return ("stable" if fastest <= limit else "unstable"), words


def write_stability(cells: Sequence[StabilityCell], folder: Path) -> Path:
    """stability.csv, one line a run."""
    path = folder / "stability.csv"
    beside = path.with_name(".stability.csv")
    with beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(list(StabilityCell.__dataclass_fields__))
        writer.writerows([list(vars(cell).values()) for cell in cells])
    beside.replace(path)
    return path
