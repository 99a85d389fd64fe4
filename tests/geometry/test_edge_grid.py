"""Edges in cells: every edge is found where it is, and the clearance never promises too much."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.geometry.edge_grid import (
    EdgeGrid,
    Edges,
    clearance_at,
    column_of,
    edge_ends,
    edge_grid,
    off_edges,
    row_of,
)
from ellipsoid_coupling.geometry.inside import enclosed_area, in_fluid, windings
from tests.outlined_flows import PLATE, SQUARE, channel_outline, circle, solid

Floats = NDArray[np.float64]


def grid_of(ends: Floats, x: tuple[float, float], y: tuple[float, float]) -> EdgeGrid:
    zeros = np.zeros(len(ends), np.int64)
    return edge_grid(Edges(ends, np.zeros((len(ends), 2)), zeros, zeros), x, y)


def random_edges(number: int) -> Floats:
    """Short and long ones in [0, 3] x [0, 1]."""
    rng = np.random.default_rng(2)
    start = rng.uniform((0.0, 0.0), (3.0, 1.0), (number, 2))
    size = 10.0 ** rng.uniform(-3.0, 0.0, (number, 1))
    end = np.clip(start + size * rng.normal(size=(number, 2)), 0.0, (3.0, 1.0))
    return np.stack((start, end), axis=1)


def distances(ends: Floats, place: Floats) -> Floats:
    """(n,), of places (n, 2) to the nearest edge."""
    way = ends[:, 1] - ends[:, 0]
    to = place[:, None] - ends[None, :, 0]
    part = np.clip((to * way).sum(axis=2) / (way**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.hypot(*np.moveaxis(to - part[..., None] * way, 2, 0)).min(axis=1))


@pytest.mark.parametrize("number", [3, 800])
def test_every_point_of_an_edge_is_in_a_cell_that_has_it(number: int) -> None:
    """Also places off it by rounding."""
    ends = random_edges(number)
    grid = grid_of(ends, (0.0, 3.0), (0.0, 1.0))
    rng = np.random.default_rng(1)
    for e in range(number):
        for part in rng.random(20):
            x, y = ends[e, 0] + part * (ends[e, 1] - ends[e, 0]) + rng.normal(size=2) * 1e-15
            if 0.0 <= x <= 3.0 and 0.0 <= y <= 1.0:
                cell = row_of(grid, y) * grid.columns + column_of(grid, x)
                assert e in grid.members[grid.first[cell] : grid.first[cell + 1]]
    np.testing.assert_allclose(edge_ends(grid), ends, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("number", [3, 40])
def test_the_clearance_is_a_bound_and_not_a_bad_one(number: int) -> None:
    """Never more than the distance; less by at most three diagonals of a cell."""
    ends = random_edges(number)
    grid = grid_of(ends, (0.0, 3.0), (0.0, 1.0))
    place = np.random.default_rng(5).uniform((0.0, 0.0), (3.0, 1.0), (3000, 2))
    clear = np.array([clearance_at(grid, x, y) for x, y in place])
    exact = distances(ends, place)
    assert np.all(clear <= exact)
    assert np.all(clear >= exact - 3.0 * np.sqrt(2.0) / grid.per_length)
    assert clear.max() > 0.0


def test_places_beyond_the_grid_and_those_that_are_no_numbers_have_a_cell() -> None:
    grid = grid_of(random_edges(3), (0.0, 3.0), (0.0, 1.0))
    for value in (np.nan, np.inf, -np.inf, 1e300):
        assert 0 <= column_of(grid, value) < grid.columns
        assert 0 <= row_of(grid, value) < grid.rows


def test_what_lies_on_an_edge_is_put_before_it() -> None:
    """By some roundings, on the fluid's side; nothing else moves."""
    outline = channel_outline(solid(SQUARE))
    grid = grid_of(outline.ends, (0.0, 4.0), (0.0, 1.0))
    x, y = np.array([1.0, 0.5, 1.1, 0.5]), np.array([0.5, 0.0, 0.6, 0.5])
    before = x.copy(), y.copy()
    off_edges(grid, x, y)
    assert x[0] < 1.0 and y[1] > 0.0 and y[2] > 0.6  # noqa: PT018
    assert max(np.abs(x - before[0]).max(), np.abs(y - before[1]).max()) < 2e-13
    assert (x[3], y[3]) == (0.5, 0.5)


def test_inside_is_what_the_outline_goes_around() -> None:
    """A channel with a square, a plate, a circle; and a circle alone, in a fluid without an end."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-0.5, 4.5, 4000), rng.uniform(-0.2, 1.2, 4000)
    round_one = circle(0.3, 50, (2.5, 0.5))
    outline = channel_outline(solid(SQUARE), ("plate", "wall", PLATE, True), solid(round_one[::-1]))
    in_square = (x > 1.0) & (x < 1.2) & (y > 0.4) & (y < 0.6)
    # In all half planes of the polygon.
    along = np.roll(round_one, -1, axis=0) - round_one
    side = along[:, 0] * (y[:, None] - round_one[:, 1]) - along[:, 1] * (
        x[:, None] - round_one[:, 0]
    )
    in_circle = (side > 0.0).all(axis=1)
    within = (x > 0.0) & (x < 4.0) & (y > 0.0) & (y < 1.0)
    assert np.array_equal(in_fluid(outline.ends, x, y), within & ~in_square & ~in_circle)
    alone = outline.ends[outline.patch == 6]
    assert np.array_equal(in_fluid(alone, x, y), ~in_circle)
    assert enclosed_area(alone) == pytest.approx(-0.5 * 50 * 0.09 * np.sin(2.0 * np.pi / 50))
    assert set(windings(alone, x, y)) == {0, -1}


def test_corners_at_the_height_of_a_place_count_once() -> None:
    """Places on the height of corners, and between collinear edges: no rounding decides."""
    diamond = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    ends = np.stack((diamond, np.roll(diamond, -1, axis=0)), axis=1)
    x, y = np.array([-2.0, -0.5, 0.5, 2.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 0.0, -1.5, 1.5])
    assert windings(ends, x, y).tolist() == [0, 1, 1, 0, 0, 0]
