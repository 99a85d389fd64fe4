"""The cubic B-spline against scipy's, compiled and plain."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from ellipsoid_coupling.compiled.jit import kernel, plain
from ellipsoid_coupling.physics.bspline import spline_slopes, spline_weights

POINTS = np.array([0.0, 0.125, 0.3, 0.5, 0.77, 1.0 - 2.0**-52])
NODES = np.arange(-1, 3)


@kernel
def compiled_weights(t: float) -> tuple[float, float, float, float]:
    return spline_weights(t)


@kernel
def compiled_slopes(t: float) -> tuple[float, float, float, float]:
    return spline_slopes(t)


def test_weights_and_slopes_are_those_of_the_b_spline() -> None:
    """To rounding of numbers below 1, against scipy's recursion."""
    spline = BSpline.basis_element([-2.0, -1.0, 0.0, 1.0, 2.0], extrapolate=False)
    away = POINTS[:, None] - NODES
    expected = np.nan_to_num(spline(away))
    np.testing.assert_allclose(np.array(plain(spline_weights)(POINTS)).T, expected, atol=4e-16)
    slopes = np.nan_to_num(spline.derivative()(away))
    np.testing.assert_allclose(np.array(plain(spline_slopes)(POINTS)).T, slopes, atol=4e-16)


def test_the_compiled_weights_are_the_plain_ones() -> None:
    """The same formula: they differ by fused multiply-adds only, one rounding each."""
    weights, slopes = plain(spline_weights)(POINTS), plain(spline_slopes)(POINTS)
    for k, t in enumerate(POINTS):
        expected = [part[k] for part in weights]
        np.testing.assert_allclose(compiled_weights(float(t)), expected, rtol=0, atol=4e-16)
        expected = [part[k] for part in slopes]
        np.testing.assert_allclose(compiled_slopes(float(t)), expected, rtol=0, atol=4e-16)
