"""The particles' pair sum with cell lists against the plain double loop."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.interaction.pairs.cells import cell_grid, cell_index, sort_by_cell
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape

Floats = NDArray[np.float64]
SQUARE = ((0.0, 1.0), (0.0, 1.0))


def particles(n: int, spread: float = 1.0) -> tuple[Floats, Floats]:
    """Places (3, n) and axes (2, n) in a square of side `spread` about the domain's middle."""
    rng = np.random.default_rng(n)
    place = rng.random((3, n))
    place[:2] = 0.5 + spread * (place[:2] - 0.5)
    place[2] *= 2 * np.pi
    return place, np.array([np.cos(2 * place[2]), np.sin(2 * place[2])])


def pairs_of(shape: PotentialShape, torque_weight: float | None = 30.0) -> Pairs:
    return Pairs(cell_grid(*SQUARE, shape.reach), shape, 0.2, torque_weight, None, 0.0)


def double_loop(place: Floats, axis: Floats, shape: PotentialShape) -> Floats:
    """The plain sum: weights 0.2 and 30, as in `pairs_of`."""
    total = np.zeros((3, place.shape[1]))
    for i in range(place.shape[1]):
        for j in range(place.shape[1]):
            if i != j:
                delta = place[:2, j] - place[:2, i]
                _, gx, gy, slope = plain(pair_potential)(
                    delta[0], delta[1], axis[0, i], axis[1, i], axis[0, j], axis[1, j], shape
                )
                total[:, i] -= [0.2 * gx, 0.2 * gy, 30.0 * slope]
    return total


@pytest.mark.parametrize("spread", [1.0, 0.15, 3.0])
def test_cells_find_every_pair(spread: float) -> None:
    """To rounding; spread 3 puts particles outside the cells' rectangle, where they count too."""
    shape = potential_shape(0.08, 0.03)
    place, axis = particles(60, spread)
    force = np.zeros((3, 60))
    add_pair_forces(place, axis, pairs_of(shape), force)
    expected = double_loop(place, axis, shape)
    assert np.max(np.abs(force - expected)) < 1e-13 * np.abs(expected).max()
    assert np.abs(expected).max() > 0


def test_momentum_is_kept_to_rounding() -> None:
    place, axis = particles(500)
    force = np.zeros((3, 500))
    add_pair_forces(place, axis, pairs_of(potential_shape(0.05, 0.025)), force)
    assert np.abs(force[:2].sum(axis=1)).max() < 1e-13 * np.abs(force[:2]).sum()


def test_circles_leave_the_torque_alone() -> None:
    """The torque array is not even touched: there need not be one."""
    place, axis = particles(100)
    force = np.zeros((2, 100))
    add_pair_forces(place, axis, pairs_of(potential_shape(0.05, 0.05), None), force)
    assert np.abs(force).max() > 0


def test_ghosts_act_like_particles_with_their_factor() -> None:
    shape = potential_shape(0.08, 0.03)
    place, axis = particles(40)
    ghost_place, ghost_axis = particles(7)
    pairs = pairs_of(shape)
    ghosts, _ = sort_by_cell(
        ghost_place[0], ghost_place[1], ghost_axis[0], ghost_axis[1], pairs.grid
    )
    force, plain = np.zeros((3, 40)), np.zeros((3, 40))
    add_pair_forces(place, axis, pairs._replace(ghosts=ghosts, ghost_factor=10.0), force)
    add_pair_forces(place, axis, pairs, plain)
    both_place = np.hstack([place, ghost_place])
    both_axis = np.hstack([axis, ghost_axis])
    from_ghosts = double_loop(both_place, both_axis, shape)[:, :40] - plain
    assert np.allclose(force - plain, 10.0 * from_ghosts, atol=1e-12 * np.abs(force).max())


@pytest.mark.parametrize(
    ("x", "column"),
    [
        (-1.0, 0),
        (0.1, 0),
        (0.25, 1),
        (0.999, 3),
        (1.0, 3),
        (1e300, 3),
        (np.inf, 3),
        (-np.inf, 0),
        (np.nan, 0),
    ],
)
def test_every_number_has_a_cell(x: float, column: int) -> None:
    """Four columns of a quarter; what is beyond the rim or no number at all is no foreign memory."""
    grid = cell_grid((0.0, 1.0), (0.0, 0.5), 0.5)
    for index in (cell_index, plain(cell_index)):
        assert index(x, 0.3, grid) == grid.columns + column
        assert index(0.1, x, grid) % grid.columns == 0
