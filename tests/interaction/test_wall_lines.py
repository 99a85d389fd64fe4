"""Ghost particles along walls of any shape: those of straight walls, and even ones around a circle."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.wall_lines import ghosts_along, walls_of
from ellipsoid_coupling.interaction.walls import Walls
from ellipsoid_coupling.physics.potential import potential_shape
from tests.outlined_flows import circle, corners

Floats = NDArray[np.float64]


def cut(points: Floats, parts: int) -> Floats:
    """The edges of a closed line, each cut into equal parts."""
    way = np.roll(points, -1, axis=0) - points
    steps = np.arange(parts + 1)[:, None] / parts
    lines = [start + steps * along for start, along in zip(points, way, strict=True)]
    return np.concatenate([np.stack((line[:-1], line[1:]), axis=1) for line in lines])


@pytest.mark.parametrize("parts", [1, 7])
def test_a_rectangle_has_the_ghosts_of_its_sides(parts: int) -> None:
    """However its sides are cut into edges, in whatever order: to rounding."""
    edges = cut(corners((0.0, 1.3), (-0.2, 0.45)), parts)
    edges = edges[np.random.default_rng(0).permutation(len(edges))]
    walls = Walls(
        domain=((0.0, 1.3), (-0.2, 0.45)), sides=("left", "right", "bottom", "top"), length=0.1,
        shape=potential_shape(0.1, 0.05), strength=1.0, particles=10,
    )  # fmt: skip
    sides = np.array(walls.ghost_particles())
    found = np.array(ghosts_along(edges, 0.1))
    assert found.shape == sides.shape

    def ordered(ghosts: Floats) -> Floats:
        return ghosts[:, np.lexsort(np.round(ghosts, 9))]

    np.testing.assert_allclose(ordered(found), ordered(sides), atol=1e-14)


@pytest.mark.parametrize("direction", [1, -1])
def test_around_a_circle_they_stand_evenly(direction: int) -> None:
    """Distances alike to (spacing/R)^2/24, main axes along the wall, as many as fit best."""
    points = circle(0.5, 360)[::direction]
    (wall,) = walls_of(cut(points, 1))
    assert wall[1]
    ghosts = ghosts_along(cut(points, 1), 0.06)
    assert ghosts.x.size == round(np.pi / 0.06)
    place = np.column_stack((ghosts.x, ghosts.y))
    assert np.abs(np.hypot(ghosts.x, ghosts.y) - 0.5).max() < 5e-5
    step = np.hypot(*np.diff(np.vstack((place, place[:1])), axis=0).T)
    assert np.abs(step / step.mean() - 1.0).max() < 1e-3
    along = np.cos(ghosts.angle) * ghosts.x + np.sin(ghosts.angle) * ghosts.y
    assert np.abs(along).max() < 0.5 * np.pi / 360 * 1.01
    assert np.all((ghosts.angle >= 0.0) & (ghosts.angle < np.pi))


def test_a_sharp_corner_divides_walls_and_a_plate_has_two() -> None:
    """Front and back of a plate stand in one place, each with ghosts of its own."""
    plate = np.array([[[0.0, 0.0], [0.4, 0.0]], [[0.4, 0.0], [0.0, 0.0]]])
    assert [closed for _, closed in walls_of(plate)] == [False, False]
    ghosts = ghosts_along(plate, 0.1)
    assert sorted(ghosts.x) == pytest.approx(sorted([0.05, 0.15, 0.25, 0.35] * 2))
    gentle = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [1.9, 0.3]]])
    assert len(walls_of(gentle)) == 1
    sharp = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [1.5, 0.9]]])
    assert len(walls_of(sharp)) == 2
