"""Walls of any shape: straight ones along the grid are the table's, and others turn with the wall."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.interaction import CurvedWalls, Forces, Walls
from ellipsoid_coupling.physics.potential import potential_shape
from tests.staircase_flows import box, circle

H, N = 0.02, 40
X = np.asarray(H * (np.arange(N) + 0.5) - 0.4, np.float64)
SHAPE = potential_shape(0.1, 0.05)
ALL = np.ones((N, N), bool)


def walls(sides: tuple[str, ...]) -> Walls:
    box_of = ((-0.4, 0.4), (-0.4, 0.4))
    return Walls(box_of, sides, 0.1, SHAPE, 1.0, 100)  # type: ignore[arg-type]


def edges(points: np.ndarray) -> np.ndarray:
    return np.stack((points, np.roll(points, -1, axis=0)), axis=1)


def forces_of(part: object, density: np.ndarray, angle: np.ndarray) -> Forces:
    forces = Forces(*np.zeros((3, N, N)))
    part.add_to(forces, density, angle)  # type: ignore[attr-defined]
    return forces


@pytest.mark.parametrize("k", range(4))
def test_a_straight_wall_on_a_side_is_that_of_the_table(k: int) -> None:
    """To rounding, in cells that hold mass; all four sides, so that each normal and angle is met."""
    side = ("bottom", "right", "top", "left")[k]
    rng = np.random.default_rng(k)
    density, angle = rng.integers(0, 2, (N, N)).astype(float), rng.uniform(-4.0, 4.0, (N, N))
    straight = walls((side,)).table(H)
    curved = CurvedWalls(edges(box(0.4, 0.4))[k : k + 1], straight.entries, (X, X), ALL, H)
    found, expected = (forces_of(one, density, angle) for one in (curved, straight))
    size = abs(straight.entries).max()
    for one, other in zip(found, expected, strict=True):
        assert one is not None
        assert other is not None
        np.testing.assert_allclose(one, other, atol=1e-12 * size)


def test_a_round_wall_pushes_outwards_alike_all_around() -> None:
    """Of circles, so that no angle matters: along the normal, and the more the nearer."""
    table = Walls(
        ((-0.4, 0.4), (-0.4, 0.4)), ("left",), 0.1, potential_shape(0.1, 0.1), 1.0, 100
    ).table(H)
    x, y = np.meshgrid(X, X)
    r = np.hypot(x, y)
    curved = CurvedWalls(edges(circle(0.2, 720, -1)), table.entries, (X, X), r > 0.2, H)
    forces = forces_of(curved, np.ones((N, N)), np.zeros((N, N)))
    felt = r < 0.2 + 0.9 * table.depth * H
    outwards = (forces.x * x + forces.y * y) / r
    along = (forces.y * x - forces.x * y) / r
    near = felt & (r > 0.21)
    assert (outwards[near] > 0.0).all()
    # The normal is an edge's: off by half an edge's angle, 0.25 degrees.
    assert (abs(along[near]) <= 5e-3 * outwards[near]).all()
    assert not forces.x[r < 0.2].any()
    order = np.argsort(r[near])
    assert (np.diff(outwards[near][order]) < 0.05 * outwards.max()).all()


def test_all_angles_of_a_q_grid_are_those_of_single_ones() -> None:
    table = walls(("left",)).table(H)
    curved = CurvedWalls(edges(circle(0.35, 90, 1)), table.entries, (X, X), ALL, H)
    angles = np.array([0.0, 0.7, 2.0])
    by_angle = curved.on_angles(angles, (N, N))
    for a, angle in enumerate(angles):
        forces = forces_of(curved, np.ones((N, N)), np.full((N, N), angle))
        for one, other in zip(by_angle, forces, strict=True):
            np.testing.assert_array_equal(one[a], other)
