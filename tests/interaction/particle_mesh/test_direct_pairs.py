"""Samples that interact pair by pair: against the pair sum of `microscopic`, and when they do."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.pairs.cells import cell_grid
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.interaction.particle_mesh import select
from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.interaction.particle_mesh.select import (
    Samples,
    affordable_harmonics,
    choose_samples,
)
from ellipsoid_coupling.interaction.select import Method
from ellipsoid_coupling.physics.potential import potential_shape

UNIT = (0.0, 1.0)
SQUARE = Region(UNIT, UNIT)
SHAPE = potential_shape(0.1, 0.05)


@pytest.mark.parametrize("degrees", [2, 3])
def test_blocks_of_samples_are_one_cloud(degrees: int) -> None:
    """3 blocks of 40 interact like 120 particles of one realisation, to rounding."""
    rng = np.random.default_rng(3)
    place = rng.random((3, degrees, 40))
    force = np.zeros_like(place)
    shape = SHAPE if degrees == 3 else potential_shape(0.1, 0.1)
    SamplePairs(SQUARE, shape, 2.0).add_forces(place, (0.5, 4.0), force)
    flat = np.ascontiguousarray(place.transpose(1, 0, 2).reshape(degrees, -1))
    double = 2.0 * flat[2] if degrees == 3 else np.zeros(flat.shape[1])
    axis = np.array([np.cos(double), np.sin(double)])
    grid = cell_grid(UNIT, UNIT, shape.reach)
    torque = 2.0 / 120 * 4.0 if degrees == 3 else None
    expected = np.zeros_like(flat)
    add_pair_forces(flat, axis, Pairs(grid, shape, 2.0 / 120 * 0.5, torque, None, 0.0), expected)
    found = force.transpose(1, 0, 2).reshape(degrees, -1)
    assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()


def cloud(samples: int, width: float, method: Method = "auto", tolerance: float = 0.2) -> Samples:
    """So many particles of length 0.1 all over the unit square."""
    shape = potential_shape(0.1, width)
    return Samples(SQUARE, (1.0, 1.0), shape, width, 1.0, samples, tolerance, method)


def test_few_and_slender_samples_interact_pair_by_pair() -> None:
    assert isinstance(choose_samples(cloud(80, 0.05)), SamplePairs)
    assert isinstance(choose_samples(cloud(10_000, 0.05)), SampleInteraction)
    assert isinstance(choose_samples(cloud(10_000, 0.05, "direct")), SamplePairs)
    assert isinstance(choose_samples(cloud(80, 0.05, "harmonics")), SampleInteraction)
    for width in (0.002, 1e-9):
        assert isinstance(choose_samples(cloud(10_000, width)), SamplePairs)
        with pytest.raises(InputError, match="direct"):
            choose_samples(cloud(10_000, width, "harmonics"))


@pytest.mark.parametrize("width", [1e-3, 1e-9])
def test_needles_take_pairs_however_many(width: float) -> None:
    """No series is looked for: on nodes a part of 1e-9 apart it would fill any memory."""
    assert affordable_harmonics(cloud(10**6, width, tolerance=2e-2)) == -1
    assert isinstance(choose_samples(cloud(10**6, width, tolerance=2e-2)), SamplePairs)


def test_a_finer_tolerance_takes_pairs_where_its_nodes_are_more_work() -> None:
    """The same cloud: by nodes at 0.2, pair by pair and hence to rounding at 1e-5 and 1e-12."""
    assert affordable_harmonics(cloud(3000, 0.05)) > 0
    for tolerance in (1e-5, 1e-12):
        assert isinstance(choose_samples(cloud(3000, 0.05, tolerance=tolerance)), SamplePairs)


def test_the_start_box_decides_as_well() -> None:
    """A small cloud has more pairs within reach, and needs shorter transforms."""
    shape = potential_shape(0.02, 0.01)
    wide = Samples(SQUARE, (1.0, 1.0), shape, 0.01, 1.0, 4000, 2e-2)
    assert affordable_harmonics(wide) == -1
    assert affordable_harmonics(wide._replace(start=(0.05, 0.05))) > 10


def test_spectra_that_do_not_fit_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(select, "memory_limit", lambda: 100_000)
    with pytest.raises(InputError, match="harmonics_tolerance"):
        choose_samples(cloud(10_000, 0.05))
