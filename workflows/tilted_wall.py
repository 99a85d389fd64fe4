"""Particles that a force presses against a wall slide along it: how far, on grids and by samples.

    .venv/bin/python workflows/tilted_wall.py [--tilts 0 30] [--cells 0.1 0.05] [--models NAME ...]

Plug flow of speed 1 in a straight channel, gravity across it. No force acts along the walls, so the mean
way along them is that of the drag alone, whether or not particles touch the wall,

    t - (1 - e^(-gamma t))/gamma        t with drag 1e6 or without inertia

for every tilt of the channel against the grid. The table goes to standard output, in Markdown: the way of
each model as a part of the exact one.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, scene_from_table

DRAG, TIME, START = 5.0, 2.0, -1.0
# Half the channel's length and width, and half the side of the domain.
LONG, WIDE, HALF = 1.6, 0.4, 2.0
MODELS = ("mckean_vlasov", "rho_mono_kinetic", "diffusive")


class Direction(NamedTuple):
    """The unit vector along the channel."""

    x: float
    y: float


def direction(tilt: float) -> Direction:
    """Of a tilt in degrees."""
    return Direction(math.cos(math.radians(tilt)), math.sin(math.radians(tilt)))


def channel(way: Direction) -> FlowField:
    """Plug flow along the channel; its sides are walls, its ends open."""
    corners = np.array([[-LONG, -WIDE], [LONG, -WIDE], [LONG, WIDE], [-LONG, WIDE]])
    corners = corners @ np.array([[way.x, way.y], [-way.y, way.x]])
    parts = [
        (name, kind, corners[[k, (k + 1) % 4]], False)
        for k, (name, kind) in enumerate(
            (("low", "wall"), ("outlet", "patch"), ("high", "wall"), ("inlet", "patch"))
        )
    ]
    at = np.linspace(-HALF, HALF, 41)
    x, y = np.meshgrid(at, at)
    psi = way.x * y - way.y * x
    return FlowField.from_stream_function(psi, at, at, "plug flow", outline=polygon_outline(parts))


def tilted_scene(way: Direction, cell: float, gravity: float) -> Scene:
    """A square start in the middle of the channel; gravity, in units of drag, towards its low wall."""
    x, y = START * way.x, START * way.y
    table = {
        "name": "tilted wall", "times": [TIME],
        "domain": {"x": [-HALF, HALF], "y": [-HALF, HALF], "boundary": "open"},
        "particles": {"length": 0.1, "width": 0.1, "number": 1000},
        "start": {"x": [x - 0.2, x + 0.2], "y": [y - 0.2, y + 0.2]},
        "flow": {"source": "openfoam", "field": "none", "drag": DRAG, "angular_drag": DRAG},
        "gravity": {"x": gravity * DRAG * way.y, "y": -gravity * DRAG * way.x},
        "boundaries": {side: {"kind": "reflect"} for side in ("low", "high")},
        "numerics": {"cell": cell, "angle_cells": 4},
    }  # fmt: skip
    return scene_from_table(table, "tilted wall")


def mean_way(result: Result, way: Direction) -> float:
    """How far the mean place has gone along the channel."""
    if "x" in result.variables:
        along = way.x * result.variables["x"][-1] + way.y * result.variables["y"][-1]
        return float(along.mean()) - START
    x, y = np.meshgrid(result.coordinates["x"], result.coordinates["y"])
    density = result.cell_density()[-1]
    return float((density * (way.x * x + way.y * y)).sum() / density.sum()) - START


def exact_way(model: str) -> float:
    """See the module; the diffusive limit has no inertia."""
    return TIME if model == "diffusive" else TIME + math.expm1(-DRAG * TIME) / DRAG


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 0."""
    parser = argparse.ArgumentParser(description="the way along a tilted wall")
    parser.add_argument("--tilts", type=float, nargs="+", default=[0.0, 30.0])
    parser.add_argument("--cells", type=float, nargs="+", default=[0.1, 0.05, 0.025])
    parser.add_argument("--gravity", type=float, default=1.0, help="drift across, of the flow's")
    parser.add_argument("--models", nargs="+", default=list(MODELS))
    parser.add_argument("--scheme", default="accurate")
    options = parser.parse_args(arguments)
    print("| model | tilt | " + " | ".join(f"h = {cell:g}" for cell in options.cells) + " |")
    print("|---|---|" + "---|" * len(options.cells))
    for model in options.models:
        for tilt in options.tilts:
            way, parts = direction(tilt), []
            with ProgressReporter(f"{model}, {tilt:g} degrees") as report:
                for cell in options.cells:
                    scene = tilted_scene(way, cell, options.gravity)
                    found = ec.simulate(
                        scene, model, options.scheme, flow=channel(way), report=report
                    )
                    parts.append(mean_way(found, way) / exact_way(model))
            shown = " | ".join(f"{part:.3f}" for part in parts)
            print(f"| {model} | {tilt:g} | {shown} |", flush=True)
    return 0


if __name__ == "__main__":
    run_in_words(main)
