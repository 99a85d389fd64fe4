"""`harmonics_tolerance` is kept by the samples' forces: the norm of `sample_forces`, measured."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.nodes import most_harmonics, nodes_per_width
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape

Floats = NDArray[np.float64]
Interaction = SampleInteraction | SamplePairs

WIDTH = 0.05
# Places of the other sample, along each direction of the square within reach.
SIDE = 30
_pair: Any = pair_potential
exact_pair = np.vectorize(_pair.py_func, otypes=[float] * 4, excluded=["shape"])


def places(shape: PotentialShape) -> Floats:
    """One in each cell of a square lattice around the origin, at random: (2, SIDE^2)."""
    cells = (np.arange(SIDE) + 0.5) * 2.0 / SIDE - 1.0
    x, y = (a.ravel() for a in np.meshgrid(cells, cells))
    jitter = np.random.default_rng(0).uniform(-1.0, 1.0, (2, SIDE * SIDE)) / SIDE
    return np.asarray(1.02 * shape.reach * (np.array([x, y]) + jitter))


def kernel(interaction: Interaction, at: Floats, source: Floats, angles: Floats | None) -> Floats:
    """What one sample at `source` exerts on each at `at` (2, n): (2 or 3, n).

    Half of all samples lie at the source, or so far away that nothing acts: the difference of the
    two has nothing else in it.
    """
    degrees = 2 if angles is None else 3
    forces = []
    for away in (0.0, 1e3):
        place = np.zeros((2, degrees, at.shape[1]))
        place[0, :2], place[1, :2] = at, source[:, None] + away
        if angles is not None:
            place[:, 2] = angles[:, None]
        force = np.zeros_like(place)
        interaction.add_forces(place, (1.0, 1.0), force)
        forces.append(force[0])
    return np.asarray(2.0 * (forces[0] - forces[1]))


def errors_and_norms(interaction: Interaction, shape: PotentialShape, turns: int) -> Floats:
    """Integrals of max_angles |K~ - K| and max_angles |K| for force and torque, (2, 1 or 2)."""
    at, rng = places(shape), np.random.default_rng(1)
    circle = shape.shape_factor == 0.0
    grid = np.array(np.meshgrid(np.arange(turns), np.arange(turns))).reshape(2, -1) * np.pi / turns
    largest = np.zeros((2, 1 if circle else 2, at.shape[1]))
    for pair in grid.T[: 1 if circle else None]:
        angles = pair + 0.05
        source = rng.uniform(-0.5, 0.5, 2) * 0.02  # anywhere between the nodes
        found = kernel(interaction, at, source, None if circle else angles)
        c, s = np.cos(2.0 * angles), np.sin(2.0 * angles)
        _, *slopes = exact_pair(*(source[:, None] - at), c[0], s[0], c[1], s[1], shape=shape)
        exact = -np.array(slopes[: len(found)])
        for which, values in enumerate((found - exact, exact)):
            sizes = [np.hypot(values[0], values[1]), *np.abs(values[2:])]
            largest[which] = np.maximum(largest[which], sizes)
    return np.asarray(largest.sum(axis=2))


@pytest.mark.parametrize(
    ("aspect", "tolerance"),
    [
        *((aspect, 2e-2) for aspect in (1.0, 1.1, 1.5, 2.0, 3.0)),
        (1.0, 2e-4),
        (1.25, 2e-3),
        (2.0, 2e-3),
        pytest.param(1.25, 9e-5, marks=pytest.mark.heavy),
        pytest.param(2.0, 5e-4, marks=pytest.mark.heavy),
        pytest.param(5.0, 2e-2, marks=pytest.mark.heavy),
    ],
)
def test_force_and_torque_are_within_the_tolerance(aspect: float, tolerance: float) -> None:
    """In the norm that is promised; above a tenth of it, or nodes and harmonics would be wasted.

    Angles are tried at 4 x 4 places, in double precision from 1e-4 on.
    """
    shape = potential_shape(aspect * WIDTH, WIDTH)
    around = (-1.2 * shape.reach, 1.2 * shape.reach)
    interaction = SampleInteraction(Region(around, around), shape, WIDTH, 1.0, tolerance)
    errors, norms = errors_and_norms(interaction, shape, 4)
    assert np.all(errors <= tolerance * norms)
    assert np.all(errors >= 0.1 * tolerance * norms)


def test_largest_error_among_few_samples_is_within_the_tolerance() -> None:
    """60 samples at random, the largest error of all as a part of the largest force of all.

    Few scattered samples have no density, so that this is measured and not promised.
    """
    rng, shape = np.random.default_rng(3), potential_shape(0.1, WIDTH)
    unit = Region((0.0, 1.0), (0.0, 1.0))
    place = np.array([*rng.uniform(0.1, 0.9, (2, 60)), rng.uniform(0.0, 7.0, 60)])[None]
    exact = np.zeros_like(place)
    SamplePairs(unit, shape, 1.0).add_forces(place, (1.0, 1.0), exact)
    for tolerance in (2e-2, 2e-3):
        found = np.zeros_like(place)
        interaction = SampleInteraction(unit, shape, WIDTH, 1.0, tolerance)
        interaction.add_forces(place, (1.0, 1.0), found)
        miss = found - exact
        sizes = [[np.hypot(a[0, 0], a[0, 1]).max(), np.abs(a[0, 2]).max()] for a in (miss, exact)]
        assert np.all(np.array(sizes[0]) < tolerance * np.array(sizes[1]))


def test_nodes_follow_the_tolerance_and_end() -> None:
    """More for less error, like its power -1/3 beyond what was measured; never fewer than two."""
    shape = potential_shape(0.1, WIDTH)
    counts = [nodes_per_width(shape, WIDTH, 10.0**-k) for k in range(10)]
    assert np.all(np.diff(counts) > 0.0)
    assert counts[9] / counts[6] == pytest.approx(10.0)
    assert nodes_per_width(shape, WIDTH, 1e6) == 2.0
    slender = potential_shape(0.4, WIDTH)
    assert nodes_per_width(slender, WIDTH, 1e-2) < nodes_per_width(shape, WIDTH, 1e-2)
    assert most_harmonics(1e4, 30.0) == 60
    assert most_harmonics(float("inf"), 1e200) == -1
