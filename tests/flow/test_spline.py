"""The clamped spline's coefficients: against scipy's own spline, to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline, CubicSpline

from ellipsoid_coupling.flow.spline import clamped_coefficients, stream_coefficients


def test_coefficients_are_scipys_clamped_spline() -> None:
    """Both solve the same equations: equal to rounding."""
    values = np.random.default_rng(0).random((9, 3))
    first, last = np.array([1.0, -2.0, 0.5]), np.array([0.0, 3.0, -1.0])
    h = 0.25
    coefficients = clamped_coefficients(values, first, last, h)
    knots = h * np.arange(-3.0, 12.0)
    at = np.linspace(0.0, 2.0, 41)
    theirs = CubicSpline(h * np.arange(9.0), values, bc_type=((1, first), (1, last)))(at)
    np.testing.assert_allclose(BSpline(knots, coefficients, 3)(at), theirs, atol=1e-13)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_cubic_is_its_own_spline(degree: int) -> None:
    """Slopes and corners by fourth-order differences are exact for cubics: equal to rounding."""
    x, y = np.linspace(0.0, 2.0, 9), np.linspace(-1.0, 0.5, 7)
    psi = np.add.outer(y**degree, x) * np.add.outer(y, x)
    coefficients = stream_coefficients(psi, 0.25, 0.25, None)
    assert coefficients.shape == (9, 11)
    inner = BSpline(np.arange(-3.0, 10.0), coefficients, 3)(np.array([0.0, 1.5, 6.0]))
    rows = BSpline(np.arange(-3.0, 12.0), inner.T, 3)(np.array([0.5, 7.5])).T
    at_y, at_x = np.array([-1.0, -0.625, 0.5]), np.array([0.125, 1.875])
    expected = np.add.outer(at_y**degree, at_x) * np.add.outer(at_y, at_x)
    np.testing.assert_allclose(rows, expected, atol=1e-12)
