"""Edges in cells: every edge is found where it is, and the clearance never promises too much."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.flow.inside import enclosed_area, grid_in_fluid, in_fluid, windings
from ellipsoid_coupling.geometry.edge_grid import (
    EdgeGrid,
    Way,
    clearance_at,
    column_of,
    edge_ends,
    leaves_support,
    may_meet_edge,
    off_edges,
    row_of,
)
from ellipsoid_coupling.geometry.edge_sorting import Edges, edge_grid
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


def bent_ways(place: Floats, size: float, parts: Floats) -> tuple[list[Way], Floats]:
    """Ways of four random vectors from places (n, 2), and points on them (n, points, 2).

    parts : (n, points, 4), each of which grows from 0 to 1
    """
    rng = np.random.default_rng(3)
    vectors = size * rng.normal(size=(len(place), 4, 2)) * rng.integers(0, 2, (len(place), 4, 1))
    ways = [Way(*(tuple(vector) for vector in each)) for each in vectors.tolist()]
    return ways, place[:, None] + parts @ vectors


def crossed(ends: Floats, points: Floats) -> NDArray[np.bool_]:
    """(n, E), which edges the lines of points (n, points, 2) cross, from either side."""
    start, way = points[:, :-1, None], np.diff(points, axis=1)[:, :, None]
    along, to = ends[:, 1] - ends[:, 0], start - ends[:, 0]

    def cross(a: Floats, b: Floats) -> Floats:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    turn = cross(way, along)
    with np.errstate(divide="ignore", invalid="ignore"):
        part, place = -cross(to, along) / turn, cross(way, to) / turn
    met = (part >= 0.0) & (part <= 1.0) & (place >= 0.0) & (place <= 1.0)
    return np.asarray(met.any(axis=1))


SHAPES = {
    "few": (random_edges(12), 0.1),
    "many": (random_edges(60), 0.02),
    "channel": (channel_outline(solid(SQUARE)).ends, 0.05),
    "plate": (channel_outline(solid(PLATE)).ends, 0.01),
    "circle": (channel_outline(solid(circle(0.2, 60, (1.1, 0.5))[::-1])).ends, 0.01),
}


@pytest.mark.parametrize("name", SHAPES)
def test_a_way_that_is_let_pass_meets_no_edge(name: str) -> None:
    """3000 ways that bend, against all edges: those above their support cross none from either side.

    Those that the second look lets pass cross none from its own side, neither bent nor straight: the
    straight way is one of those that their vectors bound.
    """
    ends, size = SHAPES[name]
    grid = grid_of(ends, (0.0, 4.0), (0.0, 1.0))
    rng = np.random.default_rng(9)
    place = rng.uniform((0.0, 0.0), (4.0, 1.0), (3000, 2))
    growing = np.sort(rng.uniform(0.0, 1.0, (3000, 30, 4)), axis=1)
    growing[:, 0], growing[:, -1] = 0.0, 1.0
    ways, points = bent_ways(place, size, growing)
    met = crossed(ends, points).any(axis=1)
    flagged = np.array(
        [leaves_support(grid, x, y, way) for (x, y), way in zip(place, ways, strict=True)]
    )
    assert not (met & ~flagged).any()
    assert flagged.sum() > met.sum() > 10
    looked = np.array(
        [may_meet_edge(grid, x, y, way) for (x, y), way in zip(place, ways, strict=True)]
    )
    passed = flagged & ~looked
    assert passed.any()
    along, to = ends[:, 1] - ends[:, 0], place[:, None] - ends[:, 0]
    above = along[:, 0] * to[..., 1] - along[:, 1] * to[..., 0] > 0.0
    for line in (points, points[:, [0, -1]]):
        assert not (crossed(ends, line) & above)[passed].any()


@pytest.mark.parametrize("edges", [60, 2000])
def test_few_ways_beside_a_wall_are_looked_at_twice(edges: int) -> None:
    """Within a cell of a cylinder, half a cell along it: the support of a round wall is nearly the wall."""
    outline = channel_outline(solid(circle(0.2, edges, (1.1, 0.5))[::-1]))
    grid = grid_of(outline.ends, (0.0, 4.0), (0.0, 1.0))
    rng, cell = np.random.default_rng(1), 1.0 / grid.per_length
    turn, away = rng.uniform(0.0, 2.0 * np.pi, 2000), rng.uniform(0.0, 1.0, 2000) * cell
    place = np.column_stack((np.cos(turn), np.sin(turn))) * (0.2 + away)[:, None] + [1.1, 0.5]
    still = (0.0, 0.0)
    ways = [
        Way((-0.5 * cell * np.sin(t), 0.5 * cell * np.cos(t)), still, still, still) for t in turn
    ]
    flagged = [leaves_support(grid, x, y, way) for (x, y), way in zip(place, ways, strict=True)]
    looked = [may_meet_edge(grid, x, y, way) for (x, y), way in zip(place, ways, strict=True)]
    assert np.mean(flagged) < 0.25
    assert np.mean(looked) < 0.05


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


def test_the_nodes_of_a_grid_are_inside_as_places_are() -> None:
    """A channel with a square, a plate and a circle, and the circle alone: node by node."""
    round_one = circle(0.3, 50, (2.5, 0.5))
    outline = channel_outline(solid(SQUARE), ("plate", "wall", PLATE, True), solid(round_one[::-1]))
    x, y = np.linspace(-0.503, 4.507, 83), np.linspace(-0.201, 1.203, 41)
    places = np.meshgrid(x, y)
    for ends in (outline.ends, outline.ends[outline.patch == 6]):
        one_by_one = in_fluid(ends, *(axis.ravel() for axis in places)).reshape(41, 83)
        assert np.array_equal(grid_in_fluid(ends, x, y), one_by_one)
        assert 0 < one_by_one.sum() < one_by_one.size


def test_corners_at_the_height_of_a_place_count_once() -> None:
    """Places on the height of corners, and between collinear edges: no rounding decides."""
    diamond = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    ends = np.stack((diamond, np.roll(diamond, -1, axis=0)), axis=1)
    x, y = np.array([-2.0, -0.5, 0.5, 2.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 0.0, -1.5, 1.5])
    assert windings(ends, x, y).tolist() == [0, 1, 1, 0, 0, 0]
