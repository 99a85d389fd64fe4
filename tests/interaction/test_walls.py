"""The walls' ghosts and their table against sums over the ghost cells themselves."""

from __future__ import annotations

import math
from typing import Literal, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction import WALL_FRAMES, DirectInteraction, Forces, Walls
from ellipsoid_coupling.physics.potential import pair_potential, potential_shape
from ellipsoid_coupling.scenes.sides import SideName

Array = NDArray[np.float64]

LENGTH = 0.05
H = 0.02
ALL: tuple[SideName, ...] = ("left", "right", "bottom", "top")


def make_walls(
    sides: tuple[SideName, ...] = ALL,
    aspect: float = 2.0,
    domain: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 1.0), (0.0, 0.6)),
) -> Walls:
    return Walls(domain, sides, LENGTH, potential_shape(LENGTH, LENGTH / aspect), 1.5, 1000)


def summed(walls: Walls, x: float, y: float, theta: float) -> Array:
    """Potential, force x, force y and torque of all ghost cells at a point, one by one."""
    ghosts = walls.ghost_cells(H)
    total = np.zeros(4)
    for gx, gy, angle, density in zip(*ghosts, strict=True):
        angles = math.cos(2 * theta), math.sin(2 * theta), math.cos(2 * angle), math.sin(2 * angle)
        values = np.array(pair_potential(gx - x, gy - y, *angles, walls.shape))
        total += walls.strength_factor * walls.strength * H**2 * density * values
    total[1:] *= -1.0
    return total


@pytest.mark.parametrize("aspect", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("side", ALL)
def test_table_equals_the_sum_over_ghost_cells(side: SideName, aspect: float) -> None:
    # 1e-6 of the largest force and torque: the table's promise about interpolation.
    walls = make_walls((side,), aspect)
    table = walls.table(H)
    frame = WALL_FRAMES[side]
    largest = np.abs(table.entries).max(axis=(1, 2))
    rng = np.random.default_rng(1)
    for index in (0, 2, table.depth - 2):
        theta = rng.uniform(-4.0, 4.0)
        away = (index + 0.5) * H
        start = {"left": 0.0, "right": 1.0, "bottom": 0.0, "top": 0.6}[side]
        x = start + away * frame.normal_x if frame.normal_x else 0.51
        y = start + away * frame.normal_y if frame.normal_y else 0.31
        _, force_x, force_y, torque = summed(walls, x, y, theta)
        normal, turning = table.force(np.array(index), np.array(theta - frame.angle))
        across = force_x * frame.normal_x + force_y * frame.normal_y
        along = force_x * frame.normal_y + force_y * frame.normal_x
        assert normal == pytest.approx(across, abs=1e-6 * largest[0])
        assert turning == pytest.approx(torque, abs=1e-6 * max(largest[1], 1e-12))
        # A lattice sum of a smooth derivative; measured 7e-3 at 7 cells per reach (1e-5 at 28).
        assert abs(along) < 1e-2 * largest[0]


def test_walls_push_inwards_and_opposite_ones_oppositely() -> None:
    cells = 30, 50
    density, angle = np.ones(cells), np.full(cells, 0.3)
    forces = Forces(np.zeros(cells), np.zeros(cells), np.zeros(cells))
    walls = make_walls()
    walls.table(H).add_to(forces, density, angle)
    depth = walls.table(H).depth
    # An ellipse that lies flat along a wall feels half of the reach.
    assert np.all(forces.x[:, : depth // 2] > 0.0)
    assert np.all(forces.y[: depth // 2] > 0.0)
    # The same numbers with opposite signs: a wall turned by 180 degrees is the same to an ellipse.
    np.testing.assert_array_equal(forces.x, -forces.x[:, ::-1])
    np.testing.assert_array_equal(forces.y, -forces.y[::-1])
    assert np.all(forces.x[depth:-depth, depth:-depth] == 0.0)


def test_add_to_equals_single_look_ups_and_skips_vacuum() -> None:
    cells = 30, 50
    rng = np.random.default_rng(2)
    density = np.where(rng.random(cells) < 0.5, 1.0, 0.0)
    angle = rng.uniform(-9.0, 9.0, cells)
    forces = Forces(np.full(cells, 2.0), np.full(cells, 3.0), np.zeros(cells))
    table = make_walls(("right", "bottom")).table(H)
    table.add_to(forces, density, angle)
    rows, columns = np.indices(cells)
    right, turn_right = table.force(49 - columns, angle - 0.5 * np.pi)
    bottom, turn_bottom = table.force(rows, angle)
    occupied = density != 0.0
    assert forces.torque is not None
    # The same formula in both: equal to rounding.
    np.testing.assert_allclose(forces.x, 2.0 - right * occupied, rtol=1e-12)
    np.testing.assert_allclose(forces.y, 3.0 + bottom * occupied, rtol=1e-12)
    expected = (turn_right + turn_bottom) * occupied
    np.testing.assert_allclose(forces.torque, expected, atol=1e-12 * np.abs(expected).max())


def test_force_along_the_wall_vanishes_with_the_spacing() -> None:
    # The lattice sum of a smooth compact function's derivative: faster than any power of h.
    walls = make_walls(("bottom",))
    largest = []
    for h in (0.02, 0.01, 0.005):
        j, d = np.meshgrid(np.arange(-30, 31), np.arange(1, 31))
        sums = [
            sum(
                pair_potential(x * h, -y * h, np.cos(turn), np.sin(turn), 1.0, 0.0, walls.shape)[1]
                for x, y in zip(j.ravel(), d.ravel(), strict=True)
            )
            for turn in (1.0, 2.0, 4.0)
        ]
        largest.append(np.abs(sums).max() * h**2)
    assert largest[1] < largest[0] / 4.0
    assert largest[2] < largest[1] / 16.0


def test_torque_is_minus_the_derivative_of_the_wall_potential() -> None:
    # Central differences of step 1e-4 on a function of scale 0.1: good to 1e-5.
    walls = make_walls(("bottom",))
    table = walls.table(H)
    for theta in (0.2, 1.1):
        high = summed(walls, 0.51, 0.5 * H, theta + 1e-4)[0]
        low = summed(walls, 0.51, 0.5 * H, theta - 1e-4)[0]
        _, torque = table.force(np.array(0), np.array(theta))
        assert torque == pytest.approx(-(high - low) / 2e-4, rel=1e-5)


def test_table_equals_the_direct_sum_over_a_grid_with_ghost_cells() -> None:
    # The ghost cells as rows of a longer grid; in the middle the ends are out of reach.
    walls = make_walls(("bottom",), domain=((0.0, 1.0), (0.0, 0.4)))
    ghosts = walls.ghost_cells(H)
    depth = walls.depth(H)
    cells = depth + 20, 50 + 2 * depth
    density, angle = np.zeros(cells), np.zeros(cells)
    density[:depth] = ghosts.density[0]
    rng = np.random.default_rng(3)
    angle[depth:] = rng.uniform(0.0, 3.0, (20, cells[1]))
    density[depth:] = 1e-14
    strength = walls.strength * walls.strength_factor
    exact = DirectInteraction(cells, H, walls.shape, strength)(density, angle)
    inner = slice(depth, None), slice(depth, -depth)
    strip = Forces(*np.zeros((3, 20, 50)))
    table = walls.table(H)
    table.add_to(strip, density[inner], angle[inner])
    largest = np.abs(table.entries).max(axis=(1, 2))
    np.testing.assert_allclose(strip.y, exact.y[inner], atol=1e-6 * largest[0])
    assert exact.torque is not None
    assert strip.torque is not None
    np.testing.assert_allclose(strip.torque, exact.torque[inner], atol=1e-6 * largest[1])


def test_circles_get_no_torque() -> None:
    walls = make_walls(aspect=1.0)
    table = walls.table(H)
    assert table.entries.shape[2] == 1
    forces = Forces(np.zeros((20, 20)), np.zeros((20, 20)), None)
    table.add_to(forces, np.ones((20, 20)), np.zeros((20, 20)))
    assert np.all(forces.x[10, :5] > 0.0)


def test_cells_larger_than_the_reach_feel_no_wall() -> None:
    table = make_walls().table(0.5)
    normal, torque = table.force(np.array([0, 1]), np.zeros(2)) if table.depth else (0.0, 0.0)
    assert table.depth == 0
    assert normal == torque == 0.0


def test_ghost_particles_lie_on_the_walls_along_them() -> None:
    ghosts = make_walls().ghost_particles()
    assert ghosts.x.size == 2 * 20 + 2 * 12
    left = ghosts.x == 0.0
    assert left.sum() == 12
    np.testing.assert_allclose(np.diff(ghosts.y[left]), LENGTH, rtol=1e-12)
    np.testing.assert_allclose(ghosts.y[left][[0, -1]], [0.025, 0.575], rtol=1e-12)
    np.testing.assert_allclose(ghosts.angle[left], 0.5 * np.pi)
    top = ghosts.y == 0.6
    assert top.sum() == 20
    assert np.all(ghosts.angle[top] == 0.0)
    assert make_walls(("top",)).ghost_particles().x.size == 20


def test_a_wall_that_is_no_multiple_of_the_length_is_centred() -> None:
    walls = make_walls(("bottom",), domain=((0.0, 0.27), (0.0, 1.0)))
    x = walls.ghost_particles().x
    np.testing.assert_allclose(x + x[::-1], 0.27, rtol=1e-12)
    np.testing.assert_allclose(np.diff(x), LENGTH, rtol=1e-12)
    assert x.size == 5


def test_matched_ghost_cells_carry_the_ghost_particles_strength() -> None:
    # Per wall length: N_ghost / N over the wall's length, exactly, for any spacing.
    walls = make_walls(("bottom",))
    per_length = walls.ghost_particles().x.size / walls.particles / 1.0
    for h in (0.02, 0.007):
        assert walls.density(h) * walls.depth(h) * h == pytest.approx(per_length, rel=1e-12)
        assert walls.depth(h) * h >= walls.shape.reach


def test_paper_density_is_one_particle_per_cell() -> None:
    shape = potential_shape(LENGTH, 0.025)
    walls = Walls(((0, 1), (0, 1)), ("top",), LENGTH, shape, 1.0, 10, ghost_density="paper")
    assert walls.density(H) == pytest.approx(2500.0)
    ghosts = walls.ghost_cells(H)
    assert ghosts.x.size == walls.depth(H) * (50 + 2 * walls.depth(H))
    assert ghosts.y.min() == pytest.approx(1.0 + 0.5 * H)


def test_bad_walls_are_refused() -> None:
    shape = potential_shape(LENGTH, 0.025)
    unit = (0.0, 1.0), (0.0, 1.0)
    with pytest.raises(InputError, match="some of left, right, bottom, top"):
        Walls(unit, (cast("SideName", "lid"),), LENGTH, shape, 1.0, 10)
    with pytest.raises(InputError, match="low < high"):
        Walls(((1.0, 0.0), (0.0, 1.0)), ALL, LENGTH, shape, 1.0, 10)
    with pytest.raises(InputError, match="particles"):
        Walls(unit, ALL, LENGTH, shape, 1.0, 0)
    with pytest.raises(InputError, match="matched or paper"):
        Walls(unit, ALL, LENGTH, shape, 1.0, 10, 10.0, cast("Literal['paper']", "none"))


def test_walls_out_of_reach_push_nothing() -> None:
    """Cells wider than the potential's reach: a table without rows, of which none is read."""
    table = make_walls(("left",)).table(1.0)
    assert table.depth == 0
    force, torque = table.force(np.zeros(3, np.int64), np.array([0.0, 1.0, 2.0]))
    assert not force.any()
    assert not torque.any()
