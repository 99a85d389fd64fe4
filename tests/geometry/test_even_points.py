"""Even points are midpoints: a rule that is exact for linear functions."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.geometry.even_points import even_points


def test_even_points_lie_in_the_middle_of_equal_parts() -> None:
    x, y = even_points((-1.0, 2.0), (0.0, 0.5), 3, 2)
    np.testing.assert_array_equal(x, [[-0.5, 0.5, 1.5]] * 2)
    np.testing.assert_array_equal(y, [[0.125] * 3, [0.375] * 3])


def test_means_of_linear_functions_are_exact() -> None:
    """The mean over a box is the value in its middle, to rounding."""
    x, y = even_points((0.1, 0.7), (-0.3, 0.2), 7, 5)
    assert abs((2.0 * x - 3.0 * y + 1.0).mean() - (2.0 * 0.4 + 3.0 * 0.05 + 1.0)) < 1e-15
