"""Ellipses to scale in two flows of OpenFOAM: a vortex street, and an elbow with an inlet.

    .venv/bin/python workflows/flow_pictures.py [--quick] [--out DIR]

Takes the cases of foam_cases, which OpenFOAM solves first where nobody has done so before (half a minute).
Without OpenFOAM, or with --quick, it takes the coarse ones of the tests' data.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling import load_scene, simulate
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.flow import Wanted, openfoam_available
from ellipsoid_coupling.output.figures import draw_ellipses
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.simulation import scene_flow

DATA = Path(__file__).parents[1] / "tests" / "data"


class Picture(NamedTuple):
    """A scene, what is changed of it, its flow in the tests' data, and what is shown."""

    scene: str
    settings: dict[str, object]
    coarse: str
    title: str
    extent: tuple[float, float, float, float]


# Particles are larger than in the scenes: an ellipse of a hundredth of the domain would be a dot.
PICTURES = (
    Picture(
        "vortex_street",
        {
            "particles.length": 0.3,
            "particles.width": 0.1,
            "particles.inertia": 1e-3,
            "particles.number": 900,
            "particles.realisations": 1,
            "start.x": [-3.5, -0.6],
            "start.y": [-1.5, 1.5],
            "times": [9.0],
        },
        "vortex_street_8",
        "Ellipses in a cylinder's vortex street, Re = 100",
        (-1.5, 11.0, -2.5, 2.5),
    ),
    Picture(
        "elbow",
        {
            "particles.length": 0.12,
            "particles.width": 0.04,
            "particles.inertia": 1e-3,
            "particles.number": 250,
            "particles.realisations": 1,
            "times": [1.0, 4.0],
        },
        "elbow",
        "Ellipses in an elbow with an inlet, Re = 50",
        (0.0, 4.0, 0.0, 4.0),
    ),
)


def main(arguments: Sequence[str] | None = None) -> Path:
    """Draw vortex_street.png and elbow.png; returns their folder."""
    parser = argparse.ArgumentParser(description="ellipses in a vortex street and in an elbow")
    parser.add_argument("--quick", action="store_true", help="coarse flows and few particles")
    parser.add_argument("--out", type=Path, help="folder of the pictures")
    options = parser.parse_args(arguments)
    folder = options.out or Path("results") / time.strftime("flows-%Y%m%d-%H%M%S")
    few: dict[str, object] = {"particles.number": 60} if options.quick else {}
    coarse = options.quick or not openfoam_available()
    with ProgressReporter("flows") as report:
        for picture in PICTURES:
            scene = load_scene(picture.scene, picture.settings | few)
            given = Wanted(DATA / picture.coarse, allow_misfit=True) if coarse else None
            flow = scene_flow(scene, given, report)
            result = simulate(scene, "microscopic", flow=flow, report=report)
            draw_ellipses(
                result,
                folder / f"{picture.scene}.png",
                flow=flow,
                most=scene.particles.number * 4,
                title=picture.title,
                extent=picture.extent,
            )
    sys.stdout.write(f"{folder}\n")
    return folder


if __name__ == "__main__":
    run_in_words(main)
