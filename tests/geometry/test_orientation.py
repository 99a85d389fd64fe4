"""Moments of axes: closed forms, heads and tails alike, and bins that share what lies across them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ellipsoid_coupling.geometry.orientation import (
    NOWHERE,
    as_axis,
    axis_moment,
    bins_of,
    cell_moment,
    mean_axis,
)


def test_two_axes_apart_by_delta_have_the_cosine_of_it() -> None:
    """M of theta and theta + delta in equal parts: e^{i (2 theta + delta)} cos(delta), to rounding."""
    theta, delta = 0.3, 0.7
    (moment,) = axis_moment([theta, theta + delta], 1.0, 0, 1)
    assert abs(moment) == pytest.approx(np.cos(delta), rel=1e-14)
    assert mean_axis(moment) == pytest.approx(theta + 0.5 * delta, rel=1e-14)


def test_weights_count_and_heads_do_not() -> None:
    """Three parts along 0, one along pi/2: S = 1/2; each may be turned by pi, to rounding."""
    angles = np.array([0.0, np.pi, -np.pi, 0.5 * np.pi])
    (moment,) = axis_moment(angles, 1.0, 0, 1)
    np.testing.assert_allclose(moment, 0.5, atol=1e-15)
    (weighted,) = axis_moment([0.0, 0.5 * np.pi], [3.0, 1.0], 0, 1)
    np.testing.assert_allclose(weighted, 0.5, atol=1e-15)


def test_evenly_spread_axes_have_no_order() -> None:
    (moment,) = axis_moment(np.arange(12) * np.pi / 12, 1.0, 0, 1)
    assert abs(moment) < 1e-15


def test_bins_are_separate_and_empty_ones_are_zero() -> None:
    moments = axis_moment([0.1, 0.2, 0.3], 1.0, [2, NOWHERE, 0], 4)
    np.testing.assert_allclose(moments, [np.exp(0.6j), 0.0, np.exp(0.2j), 0.0], rtol=1e-14)


@given(st.floats(-1e6, 1e6))
def test_an_axis_lies_in_half_a_turn_and_has_its_cosine(angle: float) -> None:
    """1e-9: the rounding of angles of a million."""
    axis = float(as_axis(np.array([angle]))[0])
    assert -0.5 * np.pi <= axis < 0.5 * np.pi
    assert np.exp(2j * axis) == pytest.approx(np.exp(2j * angle), abs=1e-9)


def test_positions_fall_into_the_bins_of_numpys_histogram() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-0.2, 2.2, 500), rng.uniform(0.8, 2.2, 500)
    x[:2], y[:2] = [0.0, 2.0], [1.0, 2.0]
    where = bins_of(x, y, (0.0, 2.0), (1.0, 2.0), (3, 5))
    counts = np.bincount(where[where >= 0], minlength=15).reshape(3, 5)
    expected, _, _ = np.histogram2d(y, x, bins=(3, 5), range=[[1.0, 2.0], [0.0, 2.0]])
    np.testing.assert_array_equal(counts, expected)
    assert bins_of(np.array([np.nan]), np.array([1.5]), (0.0, 2.0), (1.0, 2.0), (3, 5)) == NOWHERE


def test_cells_hand_on_their_mass_to_the_bins_that_they_overlap() -> None:
    """Three cells on two bins: the middle one counts half in each, to rounding."""
    angles, density = np.array([[0.0, 0.5, 1.0]]), np.array([[1.0, 4.0, 1.0]])
    left, right = cell_moment(angles, density, (1, 2))[0]
    np.testing.assert_allclose(left, (1.0 + 2.0 * np.exp(1j)) / 3.0, rtol=1e-14)
    np.testing.assert_allclose(right, (2.0 * np.exp(1j) + np.exp(2j)) / 3.0, rtol=1e-14)


def test_densities_over_angles_are_integrated() -> None:
    """cos^2 theta + 1/2 over the half circle has S = 1/4, exact for four angles and more."""
    angles = np.arange(16) * np.pi / 8
    density = (np.cos(angles) ** 2 + 0.5)[:, None, None] * np.ones((1, 2, 3))
    moment = cell_moment(angles[:, None, None], density, (2, 3))
    np.testing.assert_allclose(moment, 0.25, rtol=1e-13)
    assert not cell_moment(angles[:, None, None], np.zeros((16, 2, 3)), (2, 3)).any()
