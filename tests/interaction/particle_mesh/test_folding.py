"""Samples' interaction where sides are periodic: folded nodes, their spacing, and the forces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.particle_mesh.folding import Folding, fitting_spacing
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.physics.potential import potential_shape

Floats = NDArray[np.float64]

WIDTH = 0.05
SHAPE = potential_shape(0.1, WIDTH)
X, Y = (-0.5, 0.5), (0.0, 0.75)


def forces_of(interaction: SampleInteraction | SamplePairs, place: Floats) -> Floats:
    force = np.zeros_like(place)
    interaction.add_forces(place, (1.0, 1.0), force)
    return force


def cloud(number: int) -> Floats:
    """All over the domain, (2, 3, number/2)."""
    unit = np.random.default_rng(5).random((2, 3, number // 2))
    low, size = np.array([X[0], Y[0], 0.0]), np.array([1.0, 0.75, 7.0])
    return np.asarray(low[:, None] + size[:, None] * unit)


@pytest.mark.parametrize("periods", [(True, True), (False, True), (True, False)])
@pytest.mark.parametrize("tolerance", [2e-2, 2e-3])
def test_forces_are_those_of_nearest_images(periods: tuple[bool, bool], tolerance: float) -> None:
    """The largest error of all samples as a part of the largest force, within the tolerance."""
    place = cloud(400)
    exact = forces_of(SamplePairs(Region(X, Y, periods), SHAPE, 1.0), place)
    mesh = SampleInteraction(Region(X, Y, periods), SHAPE, WIDTH, 1.0, tolerance)
    miss = forces_of(mesh, place) - exact
    for part in (slice(0, 2), slice(2, 3)):
        errors, sizes = (np.linalg.norm(a[:, part], axis=1).max() for a in (miss, exact))
        assert errors < tolerance * sizes


def test_a_cloud_at_the_seam_is_one_elsewhere() -> None:
    """Shifted by whole nodes: the same, to the rounding of single precision."""
    interaction = SampleInteraction(Region(X, Y, (True, True)), SHAPE, WIDTH, 1.0, 2e-2)
    h = WIDTH / interaction.nodes_per_width
    place = cloud(400)
    place[:, 0] = 0.2 * place[:, 0]
    place[:, 1] = 0.3 + 0.2 * place[:, 1]
    moved = place.copy()
    moved[:, 0] = X[0] + np.mod(place[:, 0] - X[0] + h * round(0.5 / h), 1.0)
    moved[:, 1] = Y[0] + np.mod(place[:, 1] - Y[0] + h * round(0.4 / h), 0.75)
    here, there = forces_of(interaction, place), forces_of(interaction, moved)
    assert not np.array_equal(place[:, 0] < 0.0, moved[:, 0] < 0.0)
    np.testing.assert_allclose(there, here, rtol=0.0, atol=2e-5 * np.abs(here).max())


def test_folding_adds_and_unfolding_copies() -> None:
    """Six rows in a period, of which the samples have 4 .. 9; columns are not periodic."""
    folding = Folding((10, 9), (True, False))
    assert folding.own == (6, 9)
    assert folding.extent((6, 5)) == (10, 5)
    assert folding.corner((4, 2)) == (0, 2)
    sources = np.arange(6.0)[None, :, None] * np.ones((1, 1, 5))
    folded = folding.fold(sources, (4, 2), BufferPool())
    np.testing.assert_array_equal(folded[0, :, 0], [2.0, 3.0, 4.0, 5.0, 0.0, 1.0])
    potential = np.zeros((10, 5, 8))
    potential[:6] = folded[0, :, :, None]
    folding.unfold(potential)
    np.testing.assert_array_equal(potential[6:, 0, 0], [2.0, 3.0, 4.0, 5.0])


def test_what_goes_around_more_than_once_is_added_up() -> None:
    """Ten rows of ones from row 3 on, in a period of four."""
    folding = Folding((8, 5), (True, False))
    folded = folding.fold(np.ones((1, 10, 1)), (3, 0), BufferPool())
    np.testing.assert_array_equal(folded[0, :, 0], [3.0, 2.0, 2.0, 3.0])


def test_one_spacing_divides_both_periods() -> None:
    found = fitting_spacing(1.0, 0.75, 0.011, (True, True))
    assert found is not None
    assert found <= 0.011
    for size in (1.0, 0.75):
        assert size / found == pytest.approx(2 * round(size / found / 2), rel=1e-12)
    assert fitting_spacing(1.0, 0.75, 0.011, (False, False)) == 0.011
    assert fitting_spacing(1.0, np.pi, 0.011, (True, True)) is None


def test_periods_without_a_common_divisor_are_refused() -> None:
    region = Region(X, (0.0, np.pi), (True, True))
    with pytest.raises(InputError, match="periods with a common divisor"):
        SampleInteraction(region, SHAPE, WIDTH, 1.0, 2e-2)
