"""Moments of angles: closed forms, heads and tails alike, and bins that share what lies across them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from ellipsoid_coupling.geometry.orientation import (
    Shape,
    as_axis,
    grid_moments,
    mean_axis,
    particle_moments,
    summed_over_angles,
)

RANGES = ((0.0, 2.0), (1.0, 2.0))


def mean_of(angles: ArrayLike, order: int = 2) -> complex:
    angle = np.asarray(angles, np.float64)
    at = np.ones(angle.shape)
    return complex(particle_moments((at, at, angle), order, RANGES, None).mean())


def test_two_axes_apart_by_delta_have_the_cosine_of_it() -> None:
    """M of theta and theta + delta in equal parts: e^{i (2 theta + delta)} cos(delta), to rounding."""
    theta, delta = 0.3, 0.7
    moment = mean_of([theta, theta + delta])
    assert abs(moment) == pytest.approx(np.cos(delta), rel=1e-14)
    assert mean_axis(np.array(moment)) == pytest.approx(theta + 0.5 * delta, rel=1e-14)


def test_heads_do_not_count_for_axes_and_do_for_directions() -> None:
    """Three parts along 0, one along pi/2: S = 1/2; each may be turned by pi, to rounding."""
    angles = np.array([0.0, np.pi, -np.pi, 0.5 * np.pi])
    assert mean_of(angles) == pytest.approx(0.5, abs=1e-15)
    assert mean_of(angles, order=1) == pytest.approx(-0.25 + 0.25j, abs=1e-15)


def test_evenly_spread_axes_have_no_order() -> None:
    assert abs(mean_of(np.arange(12) * np.pi / 12)) < 1e-15


@given(st.floats(-1e6, 1e6))
def test_an_axis_lies_in_half_a_turn_and_has_its_cosine(angle: float) -> None:
    """1e-9: the rounding of angles of a million."""
    axis = float(as_axis(np.array([angle]))[0])
    assert -0.5 * np.pi <= axis < 0.5 * np.pi
    assert np.exp(2j * axis) == pytest.approx(np.exp(2j * angle), abs=1e-9)


def test_particles_fall_into_the_bins_of_numpys_histogram_and_others_into_none() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-0.2, 2.2, 500), rng.uniform(0.8, 2.2, 500)
    angle, gone = rng.normal(size=500), rng.random(500) < 0.2
    found = particle_moments((x, y, angle), 2, RANGES, (3, 5), gone)
    expected, _, _ = np.histogram2d(y[~gone], x[~gone], bins=(3, 5), range=[[1.0, 2.0], [0.0, 2.0]])
    np.testing.assert_array_equal(found.mass, expected)
    assert np.all(np.abs(found.mean()[expected > 0.0]) <= 1.0 + 1e-12)


@pytest.mark.parametrize("shape", [(1, 2), (3, 1)])
def test_cells_hand_on_their_mass_to_the_bins_that_they_overlap(shape: Shape) -> None:
    """Mass stays, to rounding; of three cells on two bins the middle one counts half in each."""
    density, angles = np.array([[1.0, 4.0, 1.0]]), np.array([[0.0, 0.5, 1.0]])
    found = grid_moments(density, density * np.exp(2j * angles), shape)
    assert found.mass.sum() == pytest.approx(6.0, rel=1e-14)
    if shape == (1, 2):
        left, right = found.mean()[0]
        assert left == pytest.approx((1.0 + 2.0 * np.exp(1j)) / 3.0, rel=1e-14)
        assert right == pytest.approx((2.0 * np.exp(1j) + np.exp(2j)) / 3.0, rel=1e-14)


def test_empty_bins_have_no_moment() -> None:
    found = grid_moments(np.zeros((2, 3)), np.zeros((2, 3), np.complex128), (2, 3))
    assert np.isnan(found.mean()).all()


def test_densities_over_angles_are_integrated() -> None:
    """cos^2 theta + 1/2 over the circle has S = 1/4, exact for four angles and more."""
    angles = np.arange(16) * np.pi / 8
    density = (np.cos(angles) ** 2 + 0.5)[:, None, None] * np.ones((1, 2, 3))
    mass = summed_over_angles(density, angles, 0)
    np.testing.assert_allclose(mass, 2.0 * np.pi, rtol=1e-14)
    moment = summed_over_angles(density, angles, 2) / mass
    np.testing.assert_allclose(moment, 0.25, rtol=1e-13)
