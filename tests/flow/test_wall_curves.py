"""Points on walls: on the arc of a circle, on the edges of a square, with the wall's speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.wall_curves import PLACES, WallEdges, wall_points

Array = NDArray[np.float64]


def _closed(points: Array, speed: Array) -> WallEdges:
    number = np.arange(len(points))
    return WallEdges(number, number, np.roll(number, -1), np.zeros_like(number), speed)


def _circle(number: int) -> Array:
    angle = 2.0 * np.pi * np.arange(number) / number
    return np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def test_a_circle_is_met_to_sixth_order() -> None:
    """A cubic through both ends and the middle of the arc, with its tangents; its way is the tangent."""
    off, turned = [], []
    for number in (16, 32):
        found = wall_points(_circle(number), _closed(_circle(number), np.ones(number)))
        off.append(np.abs(np.hypot(*found.at.T) - 1.0).max())
        turned.append(np.abs(np.sum(found.way * found.at, axis=1)).max())
        np.testing.assert_allclose(np.hypot(*found.way.T), 1.0, rtol=1e-14)
        np.testing.assert_array_equal(found.speed, 1.0)
    assert off[0] < 1e-6
    assert 5.7 < np.log2(off[0] / off[1]) < 6.3
    assert 4.7 < np.log2(turned[0] / turned[1]) < 5.3


def test_a_square_keeps_its_corners() -> None:
    """Three edges a side: all points lie on the sides, also where a side is straight at its points."""
    along = np.linspace(-1.0, 1.0, 4)[:-1]
    side = np.stack((along, np.full(3, -1.0)), axis=-1)
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    square = np.concatenate([side @ np.linalg.matrix_power(turn, k) for k in range(4)])
    found = wall_points(square, _closed(square, np.zeros(12)))
    np.testing.assert_allclose(np.abs(found.at).max(axis=1), 1.0, atol=1e-15)


def test_a_kink_between_straight_lines_is_a_corner() -> None:
    """It turns by 20 degrees, less than a coarse circle does at each point, but the lines do not."""
    after = np.array([np.cos(np.radians(20.0)), np.sin(np.radians(20.0))])
    line = np.concatenate((
        np.stack((np.arange(-3.0, 1.0), np.zeros(4)), axis=-1),
        np.arange(1.0, 4.0)[:, None] * after,
    ))  # fmt: skip
    number = np.arange(6)
    walls = WallEdges(number, number, number + 1, np.zeros_like(number), np.zeros(6))
    found = wall_points(line, walls)
    first = found.at[: 3 * PLACES.size]
    np.testing.assert_allclose(first[:, 1], 0.0, atol=1e-15)
    rest = found.at[3 * PLACES.size :]
    np.testing.assert_allclose(rest[:, 0] * after[1] - rest[:, 1] * after[0], 0.0, atol=1e-15)


def test_speeds_go_on_linearly() -> None:
    """Along a wall and up to its ends; an edge alone keeps its own, one without any has none."""
    line = np.stack((np.arange(4.0), np.zeros(4)), axis=-1)
    number = np.arange(3)
    walls = WallEdges(number, number, number + 1, np.zeros_like(number), 1.0 + 2.0 * np.arange(3.0))
    found = wall_points(line, walls)
    np.testing.assert_allclose(found.speed, 2.0 * found.at[:, 0], atol=1e-14)
    single = wall_points(line, walls._replace(patch=number))
    np.testing.assert_array_equal(single.speed, np.repeat(2.0 * number + 1.0, PLACES.size))
    none = wall_points(line, walls._replace(speed=np.full(3, np.nan)))
    assert np.isnan(none.speed).all()


def test_both_sides_of_a_plate_are_straight() -> None:
    """To the tip and back: there the wall turns by 180 degrees."""
    line = np.stack((np.arange(3.0), np.zeros(3)), axis=-1)
    walls = WallEdges(
        np.arange(4), np.array([0, 1, 2, 1]), np.array([1, 2, 1, 0]), np.zeros(4, int), np.zeros(4)
    )
    np.testing.assert_allclose(wall_points(line, walls).at[:, 1], 0.0, atol=1e-15)
