"""The stored yardsticks anew: solutions that the errors of the built-in scenes are measured against.

    nice .venv/bin/python workflows/yardsticks.py [--scenes NAME ...] [--quick] [--out DIR]

Without --out the files replace those of the package; `--quick` makes worthless ones in seconds.

Without noise the flow map X of the samples (`geometry.flow_map`) is combined from runs that each are fine
in one respect. With many samples and steps of length h, and few samples and h, h/2, h/4 (tolerances
falling by 8),

    X = X_many(h) + [(4 X_few(h/4) - X_few(h/2))/3 - X_few(h)]

The bracket is small, so that few samples carry it. Errors are added up: the bins of X from every third
sample of each row and column, a third of their distance from those of all (first order in the spacing;
1.3 was measured); the extrapolation from h and h/2 against that from h/2 and h/4 (third order would leave
a seventh of it); what twice as exact an interaction does to the bins of few samples. The files say what
they were made from: their errors are at least the distance to independent runs, extrapolated likewise.

With noise there are runs with seeds of their own, whose spread gives their sampling error. A step of dt
makes variances wrong by dt^2/11 of the potential's curvature (`particles.exponential`), and a Gaussian's
bins with them: by E|z^2 - 1|/2 of that for an angle, E|r^2/2 - 1| = 2/e for places. That is added.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling import Result, load_scene, simulate
from ellipsoid_coupling.compare import yardsticks
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import Bins, bin_result, distance, sampling_error
from ellipsoid_coupling.compare.resolutions import changed
from ellipsoid_coupling.compare.yardsticks import (
    Yardstick,
    fluid_velocity,
    save_yardstick,
    yardstick_path,
)
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.flow_map import midpoint_values
from ellipsoid_coupling.models import model_kinds
from ellipsoid_coupling.output.progress import ProgressReporter
from ellipsoid_coupling.result import SAMPLES_ACROSS
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.simulation import Report, scene_flow

Floats = NDArray[np.float64]

FIELDS = ("x", "y", "angle")
# Samples in a block with noise.
_BLOCK = 1000
# E|z^2 - 1|/2 and E|r^2/2 - 1| of standard normal z and r = (z_1, z_2).
_OF_ANGLE, _OF_PLACE = 0.484, 2.0 / math.e
# A step's error goes like the third power of its length.
HALF_STEP = 1.0 / 8.0


class Recipe(NamedTuple):
    """How a yardstick is made.

    many, few : numbers of samples; with noise `many` in each run
    tolerance, interaction : of the steps and of the interaction
    runs : with noise, how many runs there are
    """

    many: int
    few: int
    tolerance: float
    interaction: float
    runs: int = 1


RECIPES = {
    "top_bottom": Recipe(640_000, 65_536, 3e-4, 4e-2),
    "rotation": Recipe(2_000_000, 65_536, 3e-4, 2e-2),
    "cavity": Recipe(2_000_000, 65_536, 1e-3, 2e-2),
    "stationary": Recipe(500_000, 0, 2e-2, 4e-2, 8),
}
QUICK = Recipe(48**2, 24**2, 1e-1, 0.2)


class Maker(NamedTuple):
    """What all runs of a scene share."""

    scene: Scene
    flow: FlowField | None
    report: Report | None

    def run(self, samples: int, tolerance: float, interaction: float, seed: int = 0) -> Result:
        """A run of the model of infinite N, with blocks of many samples."""
        number = self.scene.particles.number if self.scene.walls else _BLOCK
        values = {
            "particles.number": number,
            "particles.realisations": max(1, round(samples / number)),
            "numerics.tolerance": tolerance,
            "numerics.harmonics_tolerance": interaction,
        }
        model = next(kind.name for kind in model_kinds() if kind.is_sampled_density)
        scene = changed(self.scene, values)
        return simulate(scene, model, flow=self.flow, seed=seed, report=self.report)


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
            recipe = QUICK._replace(runs=RECIPES[name].runs) if options.quick else RECIPES[name]
            maker = Maker(scene, flow, report)
            found = noisy_yardstick(maker, recipe) if recipe.runs > 1 else combined(maker, recipe)
            files.append(folder / yardstick_path(scene).name)
            save_yardstick(files[-1], found)
            sys.stdout.write(f"{files[-1].name}: {found.origin}\n")
    return files


def combined(maker: Maker, recipe: Recipe) -> Yardstick:
    """The yardstick of a scene without noise."""
    many, few, tolerance, interaction, _ = recipe
    steps = [maker.run(few, tolerance * HALF_STEP**k, interaction) for k in range(3)]
    exact = maker.run(few, tolerance, 0.5 * interaction)
    first, second, third = map(fields_of, steps)
    extrapolated, coarser = third + (third - second) / 3.0, second + (second - first) / 3.0
    whole = maker.run(many, tolerance, interaction)
    shape = fields_of(whole).shape
    fields = fields_of(whole) + to_lattice(extrapolated - first, shape)
    bins = bins_of(whole, fields)
    parts = {
        "samples": Errors(*(d / 3.0 for d in distance(*thirds(whole, fields))[0])),
        "steps": distance(bins_of(steps[0], extrapolated), bins_of(steps[0], coarser))[0],
        "interaction": distance(bins_of(exact, fields_of(exact)), bins_of(exact, first))[0],
    }
    error = sum_of(parts)
    numbers = f"{shape[2]} x {shape[3]} samples, {few} for the corrections"
    origin, fluid = origin_of(recipe, numbers, parts), fluid_velocity(maker.scene, maker.flow)
    return Yardstick(whole.model, whole.times, bins, error, fluid, origin)


def fields_of(result: Result) -> Floats:
    """x, y and angle of samples that started evenly spread, (3, T, rows, columns)."""
    across = int(result.attributes[SAMPLES_ACROSS])
    variables = np.array([result.variables[name] for name in FIELDS])
    return variables.reshape(*variables.shape[:2], -1, across)


def to_lattice(fields: Floats, shape: tuple[int, ...]) -> Floats:
    """Fields (3, T, rows, columns) of few samples at the places of many."""
    return np.array([[midpoint_values(values, *shape[2:]) for values in times] for times in fields])


def bins_of(result: Result, fields: Floats) -> Bins:
    """The bins of a result whose samples have other places and angles."""
    count = fields.shape[1]
    variables = {
        name: values.reshape(count, 1, -1) for name, values in zip(FIELDS, fields, strict=True)
    }
    attributes = result.attributes | {SAMPLES_ACROSS: fields.shape[3]}
    return bin_result(replace(result, variables=variables, attributes=attributes))


def thirds(result: Result, fields: Floats) -> tuple[Bins, Bins]:
    """The bins of all samples, and of every third in each row and column, on the same part of the box."""
    rows, columns = (count - count % 3 for count in fields.shape[2:])
    part = fields[:, :, :rows, :columns]
    return bins_of(result, part), bins_of(result, part[:, :, 1::3, 1::3])


def noisy_yardstick(maker: Maker, recipe: Recipe) -> Yardstick:
    """The yardstick of a scene with noise."""
    found = []
    for seed in range(recipe.runs):
        result = maker.run(recipe.many, recipe.tolerance, recipe.interaction, seed)
        found.append(bin_result(result))
    density, angle = (np.concatenate([bins[k] for bins in found]) for k in (0, 1))
    bins = Bins(density, angle, result.variables["x"][0].size)
    step = result.times[-1] / float(result.attributes["steps"])
    wrong = np.full(result.times.size, step**2 / 11.0)
    parts = {
        "samples": sampling_error(bins, bins.samples * recipe.runs),
        "steps": Errors(_OF_PLACE * wrong, _OF_ANGLE * wrong),
    }
    error = sum_of(parts)
    origin = origin_of(recipe, f"{recipe.runs} x {bins.samples} samples", parts)
    fluid = fluid_velocity(maker.scene, maker.flow)
    return Yardstick(result.model, result.times, bins, error, fluid, origin)


def sum_of(parts: dict[str, Errors]) -> Errors:
    """All parts together: they may all point one way."""
    return Errors(*(np.sum([part[k] for part in parts.values()], axis=0) for k in (0, 1)))


def origin_of(recipe: Recipe, numbers: str, parts: dict[str, Errors]) -> str:
    """One line: version, settings, the largest error and its parts."""
    shares = ", ".join(f"{name} {in_words(part)}" for name, part in parts.items())
    return (
        f"ellipsoid_coupling {version('ellipsoid_coupling')}, {numbers}, tolerance {recipe.tolerance:g}, "
        f"interaction {recipe.interaction:g}; density and angle may be off by {in_words(sum_of(parts))} "
        f"({shares})"
    )


def in_words(errors: Errors) -> str:
    """The largest over the times, of density and angle."""
    return f"{errors.density.max():.4f} and {errors.angle.max():.4f}"


if __name__ == "__main__":
    run_in_words(main)
