"""The pair sum where sides are periodic, against a plain double loop over nearest images."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.interaction.pairs.cells import cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.ghost_forces import add_ghost_forces
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.interaction.pairs.threaded_pair_sum import PairSum, row_blocks
from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape

Floats = NDArray[np.float64]
Periods = tuple[bool, bool]

X, Y = (-0.3, 0.7), (0.2, 1.0)
WIDTHS = np.array([1.0, 0.8])
# A reach of 0.226, and one of half the smaller period: four cells in it, one of them met from both sides.
SMALL, LARGE = potential_shape(0.08, 0.03), potential_shape(0.4 / np.sqrt(8.0), 0.06)
SHAPES = pytest.mark.parametrize("shape", [SMALL, LARGE], ids=["reach 0.226", "half a period"])
# Of y and x, as in `cell_grid`.
EACH = pytest.mark.parametrize("periods", [(True, True), (False, True), (True, False)])


def cloud(n: int) -> tuple[Floats, Floats]:
    """Places (3, n) all over the domain, one on a lower side, and axes (2, n)."""
    place = np.random.default_rng(n).random((3, n))
    place[:, 0] = 0.0
    place *= np.array([*WIDTHS, 2.0 * np.pi])[:, None]
    place[:2] += np.array([X[0], Y[0]])[:, None]
    return place, np.array([np.cos(2 * place[2]), np.sin(2 * place[2])])


def pairs_of(shape: PotentialShape, periods: Periods) -> Pairs:
    return Pairs(cell_grid(X, Y, shape.reach, periods), shape, 0.2, 30.0, None, 0.0)


def nearest_images(place: Floats, axis: Floats, shape: PotentialShape, periods: Periods) -> Floats:
    """The plain sum: weights 0.2 and 30, as in `pairs_of`."""
    total, around = np.zeros_like(place), np.array(periods[::-1])
    for i in range(place.shape[1]):
        for j in range(place.shape[1]):
            if i != j:
                delta = place[:2, j] - place[:2, i]
                delta -= np.where(around, WIDTHS * np.round(delta / WIDTHS), 0.0)
                _, gx, gy, slope = plain(pair_potential)(
                    delta[0], delta[1], axis[0, i], axis[1, i], axis[0, j], axis[1, j], shape
                )
                total[:, i] -= [0.2 * gx, 0.2 * gy, 30.0 * slope]
    return total


@EACH
@SHAPES
def test_every_pair_of_nearest_images_is_found_once(
    shape: PotentialShape, periods: Periods
) -> None:
    """To rounding; and so by the sum of samples, which meets every pair from both sides."""
    place, axis = cloud(60)
    expected = nearest_images(place, axis, shape, periods)
    atol = 1e-13 * np.abs(expected).max()
    force, own = np.zeros_like(place), np.zeros((1, *place.shape))
    add_pair_forces(place, axis, pairs_of(shape, periods), force)
    np.testing.assert_allclose(force, expected, rtol=0.0, atol=atol)
    samples = SamplePairs(Region(X, Y, periods), shape, 60.0)
    samples.add_forces(place[None], (0.2, 30.0), own)
    np.testing.assert_allclose(own[0], expected, rtol=0.0, atol=atol)


def test_momentum_is_kept_to_rounding() -> None:
    place, axis = cloud(500)
    force = np.zeros_like(place)
    add_pair_forces(place, axis, pairs_of(SMALL, (True, True)), force)
    assert np.abs(force[:2].sum(axis=1)).max() < 1e-13 * np.abs(force[:2]).sum()


@SHAPES
def test_any_shift_is_none(shape: PotentialShape) -> None:
    """Forces follow their particles, to the rounding of the shifted places."""
    place, axis = cloud(200)
    pairs = pairs_of(shape, (True, True))
    moved = place.copy()
    for d, ((low, _), shift) in enumerate(zip((X, Y), (0.377, -1.311), strict=True)):
        moved[d] = low + np.mod(place[d] - low + shift, WIDTHS[d])
    forces = [np.zeros_like(place) for _ in range(2)]
    for at, force in zip((place, moved), forces, strict=True):
        add_pair_forces(at, axis, pairs, force)
    np.testing.assert_allclose(forces[0], forces[1], rtol=0.0, atol=1e-11 * np.abs(forces[0]).max())


@EACH
def test_all_threads_find_what_one_finds(periods: Periods) -> None:
    """Within 1e-12 of the largest force. Most particles are at the top, so that the last block is thin."""
    place, axis = cloud(12000)
    place[1] = Y[1] - (Y[1] - place[1]) ** 3 / WIDTHS[1] ** 2
    pairs = pairs_of(potential_shape(0.02, 0.008), periods)
    one, all_ = np.zeros_like(place), np.zeros_like(place)
    add_pair_forces(place, axis, pairs, one)
    PairSum(pairs, place.shape[1]).add(place, axis, all_)
    np.testing.assert_allclose(all_, one, rtol=0.0, atol=1e-12 * np.abs(one).max())
    cuts = row_blocks(sort_by_cell(place[0], place[1], axis[0], axis[1], pairs.grid)[0], pairs.grid)
    assert len(cuts) > 2
    assert cuts[-1] - cuts[-2] >= (2 if periods[0] else 1)


@pytest.mark.parametrize("shift", [0.0, 0.35])
def test_ghosts_of_walls_reach_over_a_seam(shift: float) -> None:
    """A particle feels one beyond the seam as it would in the middle, in the pair sum and alone."""
    pairs = pairs_of(SMALL, (False, True))
    one = np.array([1.0]), np.array([0.0])
    ghost = np.array([X[1] - 0.02 - shift]), np.array([0.2])
    sources, _ = sort_by_cell(ghost[0], ghost[1], one[0], one[1], pairs.grid)
    pairs = pairs._replace(ghosts=sources, ghost_factor=10.0)
    place = np.array([[X[0] + 0.03 + (1.0 - shift if shift else 0.0)], [0.24], [0.3]])
    axis = np.array([[np.cos(0.6)], [np.sin(0.6)]])
    _, gx, gy, slope = plain(pair_potential)(-0.05, -0.04, axis[0, 0], axis[1, 0], 1.0, 0.0, SMALL)
    together, alone = np.zeros((3, 1)), np.zeros((3, 1))
    add_pair_forces(place, axis, pairs, together)
    add_ghost_forces(place, sources, pairs, alone)
    expected = -10.0 * np.array([[0.2 * gx], [0.2 * gy], [30.0 * slope]])
    np.testing.assert_allclose(together, expected, rtol=1e-11)
    np.testing.assert_allclose(alone, expected, rtol=1e-11)
