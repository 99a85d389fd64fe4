"""Common bins: mass is kept, layouts agree, angles are counted where they are."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.geometry import histograms


def test_particles_outside_the_domain_are_missing_mass() -> None:
    x = np.array([[0.1, 0.9, 1.5, 0.4]])
    density = histograms.particle_density(x, 0.5 * x, (0.0, 1.0), (0.0, 1.0), 5)
    assert density.sum() / 25 == pytest.approx(0.75)
    assert density[0, 0] == pytest.approx(25 / 4)  # axis order (y, x): (0.1, 0.05)
    assert density[2, 4] == pytest.approx(25 / 4)  # (0.9, 0.45)


@pytest.mark.parametrize("cells", [3, 7, 20, 50])
def test_regridding_keeps_mass_whatever_the_numbers(cells: int) -> None:
    density = np.random.default_rng(0).random((12, 20))
    bins = histograms.grid_density(density, (0.0, 2.0), (-1.0, 1.0), cells)
    assert bins.mean() == pytest.approx(density.mean(), rel=1e-13)


def test_regridding_to_the_same_cells_changes_nothing() -> None:
    density = np.random.default_rng(0).random((8, 8))
    assert np.allclose(histograms.grid_density(density, (0.0, 1.0), (0.0, 1.0), 8), density)


def test_particle_angles_wrap() -> None:
    angles = np.array([0.05, 2 * np.pi + 0.05, -0.05])
    found = histograms.particle_angles(angles, 60) * 2 * np.pi / 60
    assert found[0] == pytest.approx(2 / 3)
    assert found[59] == pytest.approx(1 / 3)


def test_field_angles_spread_a_cell_over_its_own_interval() -> None:
    """A linear field of angles with even mass is an even distribution, to the bins' rim effect."""
    angle = np.tile(np.linspace(0.0, 2 * np.pi, 30, endpoint=False), (30, 1))
    found = histograms.field_angles(angle, np.ones((30, 30)), 60)
    assert found.sum() * 2 * np.pi / 60 == pytest.approx(1.0)
    assert np.abs(found[2:-4] * 2 * np.pi - 1.0).max() < 0.3
    one = histograms.field_angles(np.full((4, 4), 1.0), np.ones((4, 4)), 60)
    assert one.argmax() == int(1.0 / (2 * np.pi) * 60)
    assert one.sum() == one.max()


def test_angle_cells_are_centred_on_multiples_of_their_width() -> None:
    """All mass in cell 0 of 60 lies half in the last and half in the first bin."""
    distribution = np.zeros(60)
    distribution[0] = 60 / (2 * np.pi)
    bins = histograms.regrid_angles(distribution, 60)
    assert bins[0] == pytest.approx(bins[59])
    assert bins.sum() * 2 * np.pi / 60 == pytest.approx(1.0)
