"""Cells of the fluid and what closes them: exact at centres, whatever the outline looks like."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.flow.outline import Outline, polygon_outline
from ellipsoid_coupling.geometry.fluid_cells import NONE, SIDE, FluidCells, fluid_cells
from tests.staircase_flows import box, circle

Floats = NDArray[np.float64]

N, H = 20, 0.1
# Centres -0.95, -0.85, .. 0.95.
X: Floats = np.asarray(-1.0 + H * (np.arange(N) + 0.5), np.float64)


def cells_of(*parts: tuple[str, str, Floats, bool]) -> FluidCells:
    return fluid_cells(polygon_outline(parts), X, X, H)


def square(half: float, turn: int = 1) -> Floats:
    return box(half, half)[::turn]


def test_without_an_outline_all_is_fluid_up_to_the_sides() -> None:
    cells = fluid_cells(None, X, X, H)
    assert cells.inside.all()
    assert (cells.x.lower[:, 0] == SIDE).all()
    assert (cells.x.lower[:, 1:] == NONE).all()
    assert cells.y.is_open[1:-1].all()


@pytest.mark.parametrize("outer", [[], [("far", "patch", square(1.0), True)]])
def test_a_circle_is_cut_out_by_centres(outer: list[tuple[str, str, Floats, bool]]) -> None:
    """With an outline of the solid alone, and with one all around: the same cells."""
    cells = cells_of(*outer, ("solid", "wall", circle(0.42, 400, -1), True))
    x, y = np.meshgrid(X, X)
    np.testing.assert_array_equal(cells.inside, np.hypot(x, y) > 0.42)


def test_a_ring_lies_between_its_circles() -> None:
    cells = cells_of(
        ("outer", "wall", circle(0.91, 400, 1), True),
        ("inner", "wall", circle(0.42, 400, -1), True),
    )
    r = np.hypot(*np.meshgrid(X, X))
    np.testing.assert_array_equal(cells.inside, (r > 0.42) & (r < 0.91))
    # Every closed face belongs to the circle that it is at.
    for faces in (cells.x, cells.y):
        for owner in (faces.lower, faces.upper):
            inner = r < 0.65
            assert (owner[(owner != NONE) & inner] >= 400).all()
            assert (owner[(owner != NONE) & ~inner] < 400).all()


def test_a_thin_plate_closes_faces_between_cells_of_the_fluid() -> None:
    """Both of its edges lie in one place, x = 0, from y = -0.5 to 0.5; each faces its own side."""
    there = np.array([[0.0, -0.5], [0.0, 0.5]])
    cells = cells_of(
        ("far", "wall", square(1.0), True),
        ("west", "wall", there, False),
        ("east", "wall", there[::-1], False),
    )
    assert cells.inside.all()
    closed = ~cells.x.is_open[:, 1:-1]
    expected = np.zeros_like(closed)
    expected[5:15, 9] = True
    np.testing.assert_array_equal(closed, expected)
    # The fluid of an edge that goes up lies on its left, in the west.
    assert (cells.x.upper[5:15, 9] == 4).all()
    assert (cells.x.lower[5:15, 10] == 5).all()
    assert cells.y.is_open[1:-1].all()


def test_a_solid_thinner_than_a_cell_closes_the_way_through_it() -> None:
    """A bar between two rows of centres, 0.04 thick: no cell is solid, and no way leads through it."""
    bar = np.array([[-0.52, -0.02], [0.52, -0.02], [0.52, 0.02], [-0.52, 0.02]])[::-1]
    cells = cells_of(("far", "wall", square(1.0), True), ("bar", "wall", bar, True))
    assert cells.inside.all()
    closed = ~cells.y.is_open[1:-1]
    expected = np.zeros_like(closed)
    expected[9, 5:15] = True
    np.testing.assert_array_equal(closed, expected)


def test_sides_that_the_outline_follows_are_its_patches() -> None:
    """A channel from wall to wall whose ends cut the fluid: left and right are the domain's own."""
    walls = [
        ("low", "wall", np.array([[-2.0, -1.0], [2.0, -1.0]]), False),
        ("end", "patch", np.array([[2.0, -1.0], [2.0, 1.0]]), False),
        ("high", "wall", np.array([[2.0, 1.0], [-2.0, 1.0]]), False),
        ("begin", "patch", np.array([[-2.0, 1.0], [-2.0, -1.0]]), False),
    ]
    cells = cells_of(*walls)
    assert cells.inside.all()
    assert (cells.y.lower[0] == 0).all()
    assert (cells.y.upper[-1] == 2).all()
    assert (cells.x.lower[:, 0] == SIDE).all()
    assert (cells.x.upper[:, -1] == SIDE).all()


def test_cells_beyond_the_mesh_are_solid() -> None:
    cells = cells_of(("far", "wall", square(0.5), True))
    x, y = np.meshgrid(X, X)
    np.testing.assert_array_equal(cells.inside, (abs(x) < 0.5) & (abs(y) < 0.5))


@pytest.mark.parametrize("seed", range(5))
def test_random_polygons_mirrored_and_turned_give_mirrored_and_turned_cells(seed: int) -> None:
    """No centre lies on an edge, so the cells are those of geometry, not of an order of edges."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, 11))
    points = rng.uniform(0.3, 0.95, 11)[:, None] * np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    cells = cells_of(("wall", "wall", points, True))
    mirrored = cells_of(("wall", "wall", (points * [-1.0, 1.0])[::-1], True))
    turned = cells_of(("wall", "wall", points[:, ::-1][::-1], True))
    np.testing.assert_array_equal(mirrored.inside, cells.inside[:, ::-1])
    np.testing.assert_array_equal(mirrored.x.is_open, cells.x.is_open[:, ::-1])
    np.testing.assert_array_equal(turned.inside, cells.inside.T)
    np.testing.assert_array_equal(turned.y.is_open, cells.x.is_open.T)


def test_far_from_the_origin_the_cells_are_the_same() -> None:
    parts = [("wall", "wall", circle(0.77, 90, 1), True)]
    near = fluid_cells(polygon_outline(parts), X, X, H)
    away = polygon_outline([(name, kind, line + 1e6, closed) for name, kind, line, closed in parts])
    far = fluid_cells(away, X + 1e6, X + 1e6, H)
    np.testing.assert_array_equal(far.inside, near.inside)
    np.testing.assert_array_equal(far.x.lower, near.x.lower)


def test_an_outline_may_be_empty() -> None:
    nothing = Outline(np.empty((0, 2, 2)), np.empty(0, np.int64), np.empty(0), (), ())
    assert fluid_cells(nothing, X, X, H).inside.all()
