"""Outlines have the size, the place and the turn of the particle."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.flow.inside import enclosed_area
from ellipsoid_coupling.output.outlines import (
    CORNERS,
    drawn_outline,
    ellipse_outlines,
    joined,
    square_outlines,
)
from ellipsoid_coupling.scenes import load_scene


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


@pytest.mark.parametrize(("boundary", "kind"), [("reflecting", "wall"), ("open", "patch")])
def test_without_a_case_the_sides_of_the_domain_bound_the_fluid(boundary: str, kind: str) -> None:
    """Counter-clockwise: the area that the edges enclose is the domain's, to rounding."""
    scene = load_scene("rotation", {"domain.boundary": boundary})
    outline = drawn_outline(scene, None)
    assert set(outline.types) == {kind}
    assert set(outline.names) == {"left", "right", "bottom", "top"}
    area = scene.domain.width * scene.domain.height
    assert enclosed_area(outline.ends) == pytest.approx(area, rel=1e-14)


def test_edges_in_any_order_become_lines() -> None:
    """A closed square, and an open way of three edges that begins where no edge stops."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    way = np.array([[5.0, 5.0], [6.0, 5.0], [6.0, 6.0], [7.0, 6.0]])
    edges = np.concatenate([np.stack((line[:-1], line[1:]), axis=1) for line in (square, way)])
    shuffled = edges[np.random.default_rng(3).permutation(len(edges))]
    first, second = joined(shuffled)
    np.testing.assert_array_equal(first, way)
    np.testing.assert_array_equal(second[0], second[-1])
    assert {tuple(corner) for corner in second.tolist()} == {tuple(c) for c in square.tolist()}
    sides = np.diff(second, axis=0)
    assert enclosed_area(np.stack((second[:-1], second[1:]), axis=1)) == 1.0
    np.testing.assert_array_equal(np.hypot(*sides.T), 1.0)
    assert joined(np.empty((0, 2, 2))) == []


def test_lines_meet_where_corners_differ_by_rounding() -> None:
    ends = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0 + 1e-15, 0.0], [1.0, 1.0]]])
    (line,) = joined(ends)
    np.testing.assert_allclose(line, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], atol=1e-14)
