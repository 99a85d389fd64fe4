"""The stored yardsticks anew: solutions that the errors of the built-in scenes are measured against.

    nice .venv/bin/python workflows/yardsticks.py [--scenes NAME ...] [--quick] [--out DIR]

Two runs of every scene with interaction, the second coarser in all that errs: samples, time step and
interaction. The distance of their bins is what the first may be off by. With noise there are several runs
with seeds of their own, whose spread gives their sampling error. Without --out the files replace those of
the package; `--quick` makes worthless ones in a second or two each.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling import load_scene, simulate
from ellipsoid_coupling.compare import yardsticks
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import Bins, bin_result, distance, sampling_error
from ellipsoid_coupling.compare.resolutions import changed
from ellipsoid_coupling.compare.yardsticks import Yardstick, save_yardstick, yardstick_path
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import model_kinds
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import Report, scene_flow


class Resolution(NamedTuple):
    """Of a run: all that it errs by. With noise: runs of so many samples, with seeds of their own."""

    samples: int
    tolerance: float
    harmonics_tolerance: float
    runs: int = 1


class Recipe(NamedTuple):
    """The run that is kept, and the coarser one."""

    kept: Resolution
    coarser: Resolution


RECIPES = {
    "top_bottom": Recipe(Resolution(512**2, 1e-5, 5e-3), Resolution(362**2, 4e-5, 1e-2)),
    "rotation": Recipe(Resolution(512**2, 1e-5, 5e-3), Resolution(362**2, 4e-5, 1e-2)),
    "cavity": Recipe(Resolution(512**2, 1e-5, 5e-3), Resolution(362**2, 4e-5, 1e-2)),
    "stationary": Recipe(Resolution(500_000, 1e-3, 2e-2, 10), Resolution(500_000, 1e-2, 4e-2, 4)),
}
# Worthless, and quick.
QUICK = Resolution(32**2, 1e-2, 0.1), Resolution(24**2, 1e-1, 0.2)


def main(arguments: Sequence[str] | None = None) -> list[Path]:
    """Make the yardsticks; returns their files."""
    parser = argparse.ArgumentParser(description="the stored yardsticks of built-in scenes")
    parser.add_argument("--scenes", nargs="+", default=list(RECIPES), choices=list(RECIPES))
    parser.add_argument("--quick", action="store_true", help="worthless ones in seconds")
    parser.add_argument("--out", type=Path, help="folder; the package's if left out")
    options = parser.parse_args(arguments)
    folder = options.out or yardsticks.FOLDER
    files = []
    with ProgressReporter() as report:
        for name in options.scenes:
            scene = load_scene(name)
            flow = scene_flow(scene, None, report)
            recipe = quick_recipe(RECIPES[name]) if options.quick else RECIPES[name]
            found = make_yardstick(scene, flow, recipe, report)
            path = folder / yardstick_path(scene, flow).name
            save_yardstick(path, found)
            files.append(path)
            sys.stdout.write(f"{path.name}: {found.origin}\n")
    return files


def quick_recipe(recipe: Recipe) -> Recipe:
    """Few samples, long steps; as many runs."""
    kept, coarser = QUICK
    return Recipe(kept._replace(runs=recipe.kept.runs), coarser._replace(runs=recipe.coarser.runs))


def make_yardstick(
    scene: Scene, flow: FlowField | None, recipe: Recipe, report: Report | None = None
) -> Yardstick:
    """The bins of the finer run, and how far they may be off: the distance to the coarser one's.

    With noise, whose part is taken out of that distance, the expected error by the finite number of samples
    is added.
    """
    model, kept = bins_of(scene, flow, recipe.kept, 0, report)
    _, coarser = bins_of(scene, flow, recipe.coarser, recipe.kept.runs, report)
    moved = distance(kept, coarser)[0]
    random = recipe.kept.runs > 1
    own = sampling_error(kept, kept.samples * recipe.kept.runs) if random else Errors(0.0, 0.0)
    error = Errors(moved.density + own.density, moved.angle + own.angle)
    origin = (
        f"ellipsoid_coupling {version('ellipsoid_coupling')}, {in_words(recipe.kept)}; "
        f"errors: distance to {in_words(recipe.coarser)}"
    ) + (", and sampling" if random else "")
    return Yardstick(model, np.array(scene.times), kept, error, origin)


def bins_of(
    scene: Scene, flow: FlowField | None, resolution: Resolution, seed: int, report: Report | None
) -> tuple[str, Bins]:
    """The model's name, and the bins of each run as a group."""
    model = limit_model()
    values = {
        "particles.realisations": max(1, round(resolution.samples / scene.particles.number)),
        "numerics.tolerance": resolution.tolerance,
        "numerics.harmonics_tolerance": resolution.harmonics_tolerance,
    }
    finer = changed(scene, values)
    found = []
    for run in range(resolution.runs):
        result = simulate(finer, model, flow=flow, seed=seed + run, report=report)
        found.append(bin_result(result))
    density, angle = (np.concatenate([bins[k] for bins in found]) for k in (0, 1))
    samples = result.variables["x"][0].size if resolution.runs > 1 else 0
    return model, Bins(density, angle, samples)


def limit_model() -> str:
    """The model of the limit of infinite N."""
    return next(kind.name for kind in model_kinds() if kind.is_sampled_density)


def in_words(resolution: Resolution) -> str:
    """A resolution in a line."""
    runs = f"{resolution.runs} x " if resolution.runs > 1 else ""
    return (
        f"{runs}{resolution.samples} samples, tolerance {resolution.tolerance:g}, "
        f"interaction {resolution.harmonics_tolerance:g}"
    )


if __name__ == "__main__":
    run_in_words(main)
