"""Outlines have the size, the place and the turn of the particle."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.output.outlines import CORNERS, ellipse_outlines, square_outlines


def polygon_area(corners: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    x, y = corners.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def test_full_length_lies_along_the_angle_and_full_width_across() -> None:
    outline = ellipse_outlines(np.array([2.0]), np.array([3.0]), np.array([0.5]), (0.4, 0.1))[0]
    offset = outline - [2.0, 3.0]
    along = offset @ [np.cos(0.5), np.sin(0.5)]
    across = offset @ [-np.sin(0.5), np.cos(0.5)]
    # Corners lie on both axes: equal to rounding.
    assert np.isclose(np.ptp(along), 0.4, rtol=1e-14)
    assert np.isclose(np.ptp(across), 0.1, rtol=1e-14)
    np.testing.assert_allclose((along / 0.2) ** 2 + (across / 0.05) ** 2, 1.0, rtol=1e-12)


def test_area_is_the_ellipses_up_to_the_polygon() -> None:
    outline = ellipse_outlines(np.zeros(1), np.zeros(1), np.array([1.1]), (0.4, 0.1))[0]
    # An inscribed n-gon has n/(2 pi) sin(2 pi/n) of the area; anticlockwise is positive.
    part = CORNERS / (2 * np.pi) * np.sin(2 * np.pi / CORNERS)
    assert np.isclose(polygon_area(outline), part * np.pi / 4 * 0.4 * 0.1, rtol=1e-12)
    assert part > 0.993


def test_squares_surround_their_centres() -> None:
    squares = square_outlines(np.array([1.0, 2.0]), np.array([5.0, 6.0]), 0.5)
    np.testing.assert_allclose(squares.mean(axis=1), [[1.0, 5.0], [2.0, 6.0]])
    assert [polygon_area(square) for square in squares] == [0.25, 0.25]
