"""Refinements: the resolutions that a model and scheme is run with, from coarse to fine.

    grids in r            h = width/n,  n = n_0/8 ... 4 n_0 by doubling (n_0 the scene's own), n >= 12
    grids in (r, theta)   (n, angles) in fixed proportion, 1, 3/2, 2, 5/2, 3, 4, 6 times the coarsest
    particles             realisations R times 2, time step divided by sqrt(2) or tolerance by
                          10^(1/4): sampling and stepping errors fall alike, by some sqrt(2) a level
    samples of a density  samples times 2, time step or tolerance and interaction such that all three
                          err alike; with noise more samples, whose own error is much the largest

`cost` is the number of operations of a level, up to a factor that all levels of one refinement share: with
the seconds of one level it predicts those of the next.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.files.limits import LEAST_HARMONICS_TOLERANCE
from ellipsoid_coupling.models import ModelKind, SchemeName, kind_named, scheme_named
from ellipsoid_coupling.scenes import Scene, scene_from_table, set_key
from ellipsoid_coupling.scenes.scene import Domain

LEVELS = 5

# Doublings from the scene's own number of cells, and the fewest cells worth a run.
_DOUBLINGS = (-3, -2, -1, 0, 1, 2)
_FEWEST_CELLS = 12
# Cells across the domain in units of the coarsest level's, and angles: both grow alike.
_Q_FACTORS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0)
_Q_ANGLES = (8, 12, 16, 20, 24, 32, 48)
_Q_CELLS_PER_START_BOX = 3
_FEWEST_Q_CELLS = 10
# Realisations, time step and tolerance in units of the scene's own.
_ENSEMBLES = tuple(2.0 ** (k - 6) for k in range(9))
_STEPS = tuple(8.0 * 2.0 ** (-0.5 * k) for k in range(9))
_TOLERANCES = tuple(1000.0 * 10.0 ** (-0.25 * k) for k in range(9))
# The nodes of the samples' interaction cost as much as this many samples, however few samples there are.
_SAMPLES_OF_GRID = 500_000
# Harmonics tolerance in units of the scene's own, and its work as a power, measured from 1e-1 to 5e-3. The
# reference's is finer than the last: a run with the reference's nodes would agree with itself.
_HARMONICS = (8.0, 4.0, 4.0, 2.0, 2.0, 1.0, 0.5)
_WORK_OF_HARMONICS = -0.8
_SAMPLES = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0, 2.0, 4.0)
_SAMPLE_STEPS = (12.0, 8.0, 6.0, 4.0, 3.0, 2.0, 1.0)
_SAMPLE_TOLERANCES = (100.0, 30.0, 10.0, 3.0, 1.0, 0.3, 0.1)
# With noise samples err like 1/sqrt(S), some 0.02 for 100 000 of them; steps and interaction by far less.
_NOISY_SAMPLES = (1 / 4, 1 / 2, 1.0, 2.0, 4.0, 8.0, 16.0)
_NOISY_HARMONICS = (8.0, 8.0, 8.0, 4.0, 4.0, 4.0, 4.0)
_NOISY_TOLERANCES = (1000.0, 1000.0, 1000.0, 300.0, 300.0, 300.0, 100.0)
# Steps that a tolerance asks for: about its power -1/4, measured between 1e-1 and 1e-4.
_STEPS_OF_TOLERANCE = -0.25


class Level(NamedTuple):
    """One resolution.

    scene : with that resolution's numerics and realisations
    cost : operations, up to a factor of the refinement
    spacing : h of a grid, 0 for particles
    """

    scene: Scene
    cost: float
    spacing: float


@dataclass(frozen=True)
class Refinement:
    """The levels of one model and scheme, coarse to fine."""

    kind: ModelKind
    scheme: SchemeName
    levels: tuple[Level, ...]

    @property
    def model(self) -> str:
        """The model's name."""
        return self.kind.name


def changed(scene: Scene, values: Mapping[str, object]) -> Scene:
    """The scene with other values of keys such as "numerics.cell" or "times".

    Raises
    ------
    InputError
        For values that do not fit.
    """
    table = scene.model_dump(mode="json", exclude_none=True)
    for key, value in values.items():
        set_key(table, key, value)
    return scene_from_table(table, f"scene {scene.name} with {dict(values)}")


def has_noise(scene: Scene) -> bool:
    """Whether particles move at random."""
    return scene.noise is not None and (scene.noise.noise > 0 or scene.noise.angular_noise > 0)


def make_refinement(scene: Scene, model: str, scheme: SchemeName) -> Refinement:
    """The levels of a model and scheme on a scene."""
    kind, adaptive = kind_named(model), scheme_named(scheme).adaptive
    if kind.layout == "q":
        levels = _q_levels(scene)
    elif kind.layout == "rho":
        levels = _r_levels(scene)
    elif kind.independent_realisations:
        levels = _particle_levels(scene, scheme, _ENSEMBLES, _TOLERANCES if adaptive else _STEPS)
    else:
        noisy = has_noise(scene)
        tolerances = _NOISY_TOLERANCES if noisy else _SAMPLE_TOLERANCES
        steps = tolerances if adaptive else _SAMPLE_STEPS
        levels = _particle_levels(scene, scheme, _NOISY_SAMPLES if noisy else _SAMPLES, steps)
        if scene.interaction is not None:
            harmonics = _NOISY_HARMONICS if noisy else _HARMONICS
            levels = _with_harmonics(levels, steps, harmonics, scheme)
    return Refinement(kind, scheme, tuple(levels))


def cells_across(domain: Domain, least: int) -> int:
    """The smallest number of cells in x, from `least` on, whose squares fill the domain's height."""
    for count in range(least, 4 * least):
        rows = domain.height / domain.width * count
        if abs(rows - round(rows)) < 1e-9 * rows:
            return count
    return least


def _r_levels(scene: Scene) -> list[Level]:
    """Five levels; the scene's own number of cells stands among them."""
    own = round(scene.domain.width / scene.numerics.cell)
    counts = [own * 2**k if k >= 0 else round(own / 2**-k) for k in _DOUBLINGS]
    fit = sorted({cells_across(scene.domain, count) for count in counts if count >= _FEWEST_CELLS})
    levels = []
    for count in fit[:LEVELS]:
        cell = scene.domain.width / count
        levels.append(Level(changed(scene, {"numerics.cell": cell}), float(count) ** 3, cell))
    return levels


def _q_levels(scene: Scene) -> list[Level]:
    """The start box has three cells or more on the coarsest level; points have no size."""
    domain, start = scene.domain, scene.start
    box = min(start.x[1] - start.x[0], start.y[1] - start.y[0])
    box = box if start.points is None else domain.width
    coarsest = max(_FEWEST_Q_CELLS, int(np.ceil(_Q_CELLS_PER_START_BOX * domain.width / box)))
    coarsest += coarsest % 2
    levels = []
    for factor, angles in zip(_Q_FACTORS, _Q_ANGLES, strict=True):
        count = cells_across(domain, round(coarsest * factor))
        cell = domain.width / count
        values = {"numerics.cell": cell, "numerics.angle_cells": angles}
        levels.append(Level(changed(scene, values), float(count) ** 3 * angles, cell))
    return levels


def _steps_taken(scheme: SchemeName, factor: float) -> float:
    """The number of steps as a function of the factor on the time step or tolerance."""
    return float(factor ** (_STEPS_OF_TOLERANCE if scheme_named(scheme).adaptive else -1.0))


def _particle_levels(
    scene: Scene, scheme: SchemeName, ensembles: tuple[float, ...], steps: tuple[float, ...]
) -> list[Level]:
    """Ensembles and steps in units of the scene's own."""
    steps_by = scheme_named(scheme)
    key, own = f"numerics.{steps_by.step_key}", steps_by.step(scene.numerics)
    levels = []
    for part, step in zip(ensembles, steps, strict=True):
        realisations = max(1, round(scene.particles.realisations * part))
        values = {"particles.realisations": realisations, key: float(f"{own * step:.2g}")}
        cost = realisations * _steps_taken(scheme, step)
        levels.append(Level(changed(scene, values), cost, 0.0))
    return levels


def _with_harmonics(
    levels: list[Level], steps: tuple[float, ...], harmonics: tuple[float, ...], scheme: SchemeName
) -> list[Level]:
    """The levels with ever finer harmonics, whose tolerance is an error like that of the steps."""
    refined = []
    for level, step, factor in zip(levels, steps, harmonics, strict=True):
        scene = level.scene
        own = scene.numerics.harmonics_tolerance
        samples = scene.particles.number * scene.particles.realisations
        work = (_SAMPLES_OF_GRID + samples) * factor**_WORK_OF_HARMONICS
        tolerance = max(own * factor, LEAST_HARMONICS_TOLERANCE)
        finer = changed(scene, {"numerics.harmonics_tolerance": tolerance})
        refined.append(Level(finer, work * _steps_taken(scheme, step), 0.0))
    return refined
