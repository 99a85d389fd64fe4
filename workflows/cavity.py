"""The main job: ellipsoids in the driven cavity, from icoFoam to pictures.

    .venv/bin/python workflows/cavity.py [--full] [--out DIR]

Solves the flow, runs `cavity_free` and `cavity` with the microscopic model and the rho-equation in
both schemes at three resolutions, holds them against the exact solution or the microscopic ensemble,
runs the wall's two ghost densities, and leaves everything in one folder.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ellipsoid_coupling import FlowField, Result, Scene, load_scene, simulate
from ellipsoid_coupling.compare import Frontier, short_frontier
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.output.figures import (
    DensityRow,
    axis_rows,
    density_rows,
    draw_angles,
    draw_density,
    draw_directors,
    draw_ellipses,
    draw_flow,
    draw_order,
)
from ellipsoid_coupling.output.frontier_report import report_frontiers
from ellipsoid_coupling.output.paraview import export, export_flow
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.output.tables import print_table
from ellipsoid_coupling.simulation import scene_flow

# The small version: the same job with fewer realisations and wider cells.
SMALL = {"flow.cells": 64, "particles.realisations": 16, "numerics.cell": 0.01}
# The ghost density 1/h^2 taken literally is some 10^4 times the matched one and grows as h shrinks;
# at this width the run still takes seconds.
LITERAL_CELL = 0.02
NEAR_LID = 0.05


def main(arguments: Sequence[str] | None = None) -> Path:
    """Run the job; returns the folder with its results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--full", action="store_true", help="the paper's numbers (minutes)")
    parser.add_argument("--out", type=Path, help="folder of the results")
    parser.add_argument("--set", nargs="*", default=[], metavar="KEY=VALUE", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    settings: dict[str, Any] = {} if options.full else dict(SMALL)
    for text in options.set:
        key, _, value = text.partition("=")
        settings[key] = json.loads(value)
    started = time.perf_counter()
    folder = options.out or Path("results") / time.strftime("cavity-%Y%m%d-%H%M%S")
    folder.mkdir(parents=True, exist_ok=True)
    with ProgressReporter() as report:
        scenes = [load_scene(name, settings) for name in ("cavity_free", "cavity")]
        flow = scene_flow(scenes[0], None, report)
        assert flow is not None  # both scenes have [flow]
        frontiers = [
            short_frontier(scene, flow, folder=folder / "runs", report=report) for scene in scenes
        ]
        walls = compare_walls(settings, flow, report)
        draw_pictures(frontiers, flow, folder, report)
        write_paraview(frontiers, flow, folder / "paraview", report)
    report_frontiers(frontiers, folder)
    report_walls(walls, frontiers[1], flow, folder)
    print_table("Flow", ("", ""), [("source", flow.origin)])
    sys.stdout.write(f"{time.perf_counter() - started:.0f} s\n{folder}\n")
    return folder


def compare_walls(
    settings: dict[str, Any], flow: FlowField, report: ProgressReporter
) -> dict[str, Result]:
    """The rho-equation with either ghost density, at a width that the literal one can bear."""
    results = {}
    for density in ("matched", "paper"):
        cell = max(LITERAL_CELL, float(settings.get("numerics.cell", 0.0)))
        own = {"walls.ghost_density": density, "numerics.cell": cell}
        scene = load_scene("cavity", settings | own)
        results[density] = simulate(scene, "rho_mono_kinetic", flow=flow, report=report)
    return results


def near_lid(result: Result) -> float:
    """The mass within 0.05 of the lid at the last time."""
    density = result.density(20)[-1]
    domain = result.scene.domain
    rows = round(NEAR_LID / domain.height * 20)
    return float(density[-rows:].sum() * domain.width * domain.height / 400)


def fastest(result: Result) -> float:
    """The largest speed in a cell that holds a millionth of the densest cell's mass, at any time."""
    filled = result.variables["density"] > 1e-6 * result.variables["density"].max()
    speed = np.hypot(result.variables["velocity_x"], result.variables["velocity_y"])
    return float(speed[filled].max())


def report_walls(
    walls: dict[str, Result], frontier: Frontier, flow: FlowField, folder: Path
) -> None:
    """Which wall lets how much mass to the lid: a table and a picture."""
    rows = [
        (
            f"rho, ghost cells {name}",
            str(result.attributes["resolution"]),
            f"{near_lid(result):.4f}",
            f"{fastest(result):.3g}",
            f"{result.attributes['steps']:.0f}",
            f"{result.attributes['wall_seconds']:.1f}",
        )
        for name, result in walls.items()
    ]
    ensemble = frontier.reference
    resolution = str(ensemble.attributes["resolution"])
    rows.append(("microscopic ensemble", resolution, f"{near_lid(ensemble):.4f}", "", "", ""))
    columns = ("wall", "resolution", "mass within 0.05 of the lid", "fastest", "steps", "wall s")
    print_table("Cavity with interaction: the two ghost densities", columns, rows)
    panels: list[DensityRow] = []
    for name, result in walls.items():
        label = f"rho, {name}"
        panels += [
            row._replace(label=label, details=row.details.replace(row.label, label))
            for row in density_rows([result], flow=flow)
        ]
    panels += density_rows([ensemble], histograms=False, flow=flow)
    draw_density(panels, folder / "walls.png", title="Ghost cells: matched and 1/h²")


def draw_pictures(
    frontiers: list[Frontier], flow: FlowField, folder: Path, report: ProgressReporter
) -> None:
    """Flow, densities with and without interaction, angles, mean axes, order, ellipses."""
    report("pictures", 0.0)
    scene: Scene = frontiers[0].reference.scene
    draw_flow(flow, (*scene.domain.x, *scene.domain.y), folder / "flow.png", title="Cavity flow")
    for number, frontier in enumerate(frontiers):
        results = [
            frontier.finest[model, "accurate"] for model in ("microscopic", "rho_mono_kinetic")
        ]
        name, title = results[0].scene.name, results[0].scene.title
        rows = density_rows(results, flow=flow)
        draw_density(rows, folder / f"density_{name}.png", title=title)
        draw_angles(results, folder / f"angles_{name}.png", title=title)
        axes = axis_rows(results, flow)
        draw_directors(axes, folder / f"directors_{name}.png", title=title)
        draw_order(results, folder / f"order_{name}.png", title=title)
        draw_ellipses(results[0], folder / f"ellipses_{name}.png", flow=flow, title=title)
        report("pictures", (number + 1) / len(frontiers))


def write_paraview(
    frontiers: list[Frontier], flow: FlowField, folder: Path, report: ProgressReporter
) -> None:
    """One folder a run of the scheme `accurate`, and the flow on all that it serves."""
    report("ParaView files", 0.0)
    for frontier in frontiers:
        for (model, scheme), result in frontier.finest.items():
            if scheme == "accurate":
                export(result, folder / f"{result.scene.name}-{model}", flow)
    export_flow(flow, frontiers[1].reference.scene, folder / "flow")
    report("ParaView files", 1.0)


if __name__ == "__main__":
    run_in_words(main)
