"""The integral on the (angle, y, x) grid against the direct sum over all pairs of cells."""

from __future__ import annotations

import functools
import math

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import fft

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.convolution import fft_lengths
from ellipsoid_coupling.interaction.convolution import q_kernel_spectra as spectra
from ellipsoid_coupling.interaction.q_grid import AngleForces, AngleGridInteraction
from ellipsoid_coupling.physics.potential import pair_potential, potential_shape

Array = NDArray[np.float64]

H, STRENGTH, LENGTH = 0.07, 2.0, 0.1


def sources(angles: int, seed: int = 1) -> Array:
    """Half-filled: density at random in a rectangle of 9 x 8 cells."""
    q = np.zeros((angles, 9, 8))
    q[:, 1:6, 2:7] = np.random.default_rng(seed).random((angles, 5, 5))
    return q


@functools.cache
def direct(angles: int, aspect: float) -> Array:
    """Potential, force x, force y and torque by the sum as it stands, (4, angles, 9, 8)."""
    q, shape, k = sources(angles), potential_shape(LENGTH, LENGTH / aspect), 2 * np.pi / angles
    out = np.zeros((4, *q.shape))
    for a, j, i in np.ndindex(*q.shape):
        for b, jb, ib in np.argwhere(q):
            double = 2 * k * a, 2 * k * b
            turned = np.cos(double[0]), np.sin(double[0]), np.cos(double[1]), np.sin(double[1])
            values = pair_potential((ib - i) * H, (jb - j) * H, *turned, shape)
            out[:, a, j, i] += STRENGTH * H**2 * k * q[b, jb, ib] * np.array(values)
    return np.asarray(out * np.array([1.0, -1.0, -1.0, -1.0])[:, None, None, None])


def interaction(
    angles: int, aspect: float, quantity: spectra.Quantity = "forces"
) -> AngleGridInteraction:
    shape = potential_shape(LENGTH, LENGTH / aspect)
    return AngleGridInteraction((angles, 9, 8), H, shape, STRENGTH, quantity)


def on_all_angles(field: NDArray[np.floating], angles: int) -> Array:
    return np.tile(np.asarray(field, np.float64), (angles // field.shape[0], 1, 1))


@pytest.mark.parametrize("aspect", [1.0, 2.0, 5.0])
@pytest.mark.parametrize("angles", [1, 5, 6])
def test_equals_the_direct_sum(angles: int, aspect: float) -> None:
    """Even, odd and single angles, circles and long ellipses: to 1e-12 of the largest value."""
    q, exact = sources(angles), direct(angles, aspect)
    forces = interaction(angles, aspect).forces(q)
    potential = interaction(angles, aspect, "potential").potential(q)
    found = [potential, forces.x, forces.y]
    if forces.torque is not None:
        found.append(forces.torque)
    assert (forces.torque is None) == (aspect == 1.0)
    held = q.any(axis=0)
    for field, expected in zip(found, exact, strict=False):
        miss = np.abs(on_all_angles(field, angles) - expected)[:, held].max()
        assert miss <= 1e-12 * np.abs(exact).max()


@pytest.mark.parametrize("aspect", [2.0, 5.0])
def test_single_precision_is_the_direct_sum_to_a_millionth(aspect: float) -> None:
    """Rounding of 2^-24 in transforms and products: below 1e-6 of the largest value."""
    q, exact = sources(6), direct(6, aspect)
    shape = potential_shape(LENGTH, LENGTH / aspect)
    forces = AngleGridInteraction((6, 9, 8), H, shape, STRENGTH, tolerance=1e-4).forces(q)
    held = q.any(axis=0)
    for field, expected in zip(forces, exact[1:], strict=True):
        assert field is not None
        assert field.dtype == np.float32
        miss = np.abs(on_all_angles(field, 6) - expected)[:, held].max()
        assert miss <= 1e-6 * np.abs(expected).max()


def test_even_angles_fold_to_half_and_circles_to_one() -> None:
    q = sources(6)
    assert interaction(6, 2.0).forces(q).x.shape == (3, 9, 8)
    assert interaction(6, 1.0).forces(q).x.shape == (1, 9, 8)
    turned = interaction(6, 2.0).forces(np.roll(q, 3, axis=0))
    np.testing.assert_allclose(turned.x, interaction(6, 2.0).forces(q).x, atol=1e-15)


def test_momentum_is_kept() -> None:
    """Action and reaction: the total force vanishes to rounding."""
    q = sources(6)
    forces = interaction(6, 2.0).forces(q)
    for force in (forces.x, forces.y):
        total = (q * on_all_angles(force, 6)).sum()
        assert abs(total) <= 1e-13 * np.abs(force).max() * q.sum()


def test_angles_and_cells_without_mass_are_left_out() -> None:
    """One angle with mass in a corner of a large grid: as in the small grid, to rounding."""
    shape = potential_shape(LENGTH, 0.05)
    small, large = np.zeros((12, 9, 8)), np.zeros((12, 40, 44))
    small[1], small[7] = sources(2)
    large[:, 31:, 36:] = small
    forces = AngleGridInteraction(small.shape, H, shape, STRENGTH).forces(small)
    wide = AngleGridInteraction(large.shape, H, shape, STRENGTH).forces(large)
    for near, far in zip(forces, wide, strict=True):
        assert near is not None
        assert far is not None
        np.testing.assert_allclose(far[:, 31:, 36:], near, atol=1e-12 * np.abs(near).max())
        assert np.all(far[:, :31] == 0.0)
        # Only the angle 1 and its mirror image 5 take part.
        assert np.flatnonzero(far.any(axis=(1, 2))).tolist() == [1, 5]


def test_an_empty_grid_has_no_forces() -> None:
    assert not interaction(6, 2.0).forces(np.zeros((6, 9, 8))).x.any()


def test_nothing_is_left_of_the_forces_before() -> None:
    """Mass that moves on and comes to nothing: the bits of an object that has seen none of it."""
    shape = potential_shape(LENGTH, 0.05)
    kept = AngleGridInteraction((6, 40, 44), H, shape, STRENGTH)
    for corner, width in ((0, 9), (25, 12), (3, 2), (0, 0), (30, 5)):
        q = np.zeros((6, 40, 44))
        q[:, corner : corner + width, corner : corner + width] = 1.0 + np.arange(width)
        fresh = AngleGridInteraction(q.shape, H, shape, STRENGTH).forces(q)
        for one, other in zip(kept.forces(q), fresh, strict=True):
            assert one is not None
            np.testing.assert_array_equal(one, other)


def test_same_bits_on_one_and_two_threads() -> None:
    results: list[AngleForces] = []
    before = numba.get_num_threads()
    for threads in (1, min(2, before)):
        numba.set_num_threads(threads)
        results.append(interaction(6, 2.0).forces(sources(6)))
    numba.set_num_threads(before)
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_turning_the_picture_turns_the_forces() -> None:
    """A quarter turn of 8 angles and 12 x 12 cells is exact on the grid: equal to rounding."""
    q = np.random.default_rng(3).random((8, 12, 12))
    turned = np.roll(np.rot90(q, -1, axes=(1, 2)), 2, axis=0).copy()
    shape = potential_shape(LENGTH, 0.05)
    both = AngleGridInteraction(q.shape, H, shape, STRENGTH)
    plain = both.forces(q).x.copy()
    expected = np.roll(np.rot90(plain, -1, axes=(1, 2)), 2, axis=0)
    np.testing.assert_allclose(both.forces(turned).y, expected, atol=1e-12 * np.abs(plain).max())


def test_bad_grids_and_densities_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"shape \(6, 9, 8\)"):
        interaction(6, 2.0).forces(np.zeros((6, 8, 9)))
    with pytest.raises(InputError, match="at least one cell"):
        AngleGridInteraction((0, 9, 8), H, potential_shape(LENGTH, 0.05), 1.0)
    monkeypatch.setattr(spectra, "MOST_BYTES", 1e3)
    with pytest.raises(InputError, match="fewer angle cells"):
        interaction(6, 2.0)


@pytest.mark.parametrize("flat", [1.0, 0.2])
def test_lengths_follow_the_mass_and_hold_it_with_the_reach(flat: float) -> None:
    """Short enough to gain, fast, even, never longer than the whole grid's; round and flat clouds.

    A rung is 0.8 of the next, and the next one's is taken where it is the fuller direction's: less
    than needed/0.8^2, rounded up to a fast length. The ladder ends at 0.8^10 of the longest.
    """

    def fast(length: float) -> int:
        return 2 * fft.next_fast_len(math.ceil(length / 2), real=True)

    longest = 180, 120
    for rows in range(1, 181):
        needed = rows, max(1, round(flat * min(rows, 120)))
        fitting = fft_lengths.fitting_lengths(needed, longest)
        for length, least, most in zip(fitting, needed, longest, strict=True):
            assert least <= length <= most
            assert length % 2 == 0
            assert length <= max(fast(least / 0.8**2), fast(most * 0.8**9))


def test_clouds_that_grow_alike_pass_each_rung_once() -> None:
    """From a point to all of the grid: eleven pairs of lengths, as many as there are rungs."""
    pairs = {fft_lengths.fitting_lengths((n, n + n // 20), (180, 190)) for n in range(1, 181)}
    assert len(pairs) == 11


def test_a_growing_cloud_changes_its_transforms_and_nothing_else() -> None:
    """One object through several lengths, back and forth: each the direct length's to rounding."""
    shape = potential_shape(LENGTH, 0.05)
    large = np.zeros((6, 40, 44))
    whole = AngleGridInteraction(large.shape, H, shape, STRENGTH)
    for width in (2, 9, 20, 38, 9):
        q = np.zeros_like(large)
        q[:, :width, :width] = np.random.default_rng(width).random((6, width, width))
        fresh = AngleGridInteraction(large.shape, H, shape, STRENGTH).forces(q)
        full = AngleGridInteraction(large.shape, H, shape, STRENGTH)
        everywhere = np.broadcast_to(np.array([0, 44]), (6, 40, 2))
        for one, other, third in zip(
            whole.forces(q), fresh, full.forces(q, everywhere), strict=True
        ):
            assert one is not None
            assert third is not None
            np.testing.assert_array_equal(one, other)
            miss = np.abs(one - third)[:, :width, :width].max()
            assert miss <= 1e-13 * np.abs(third).max()


def test_nothing_is_left_of_cells_or_angles_that_held_mass_before() -> None:
    """One object through boxes that grow, shrink and move, with all angles or some: fresh bits each."""
    shape, rng = potential_shape(LENGTH, 0.05), np.random.default_rng(3)
    kept = AngleGridInteraction((12, 20, 24), H, shape, STRENGTH)
    boxes = [
        (0, 9, 3, 11),
        (0, 9, 3, 11),
        (2, 18, 0, 20),
        (4, 7, 9, 12),
        (0, 20, 0, 24),
        (13, 14, 2, 4),
    ]
    for angles in (slice(None), slice(3, 5), slice(None), slice(0, 1)):
        for bottom, top, left, right in (*boxes, *boxes[::-1]):
            q = np.zeros((12, 20, 24))
            here = q[angles, bottom:top, left:right]
            here[:] = rng.random(here.shape)
            fresh = AngleGridInteraction(q.shape, H, shape, STRENGTH).forces(q)
            for one, other in zip(kept.forces(q), fresh, strict=True):
                assert one is not None
                np.testing.assert_array_equal(one, other)
    assert not any(np.any(part) for part in kept.forces(np.zeros((12, 20, 24))))
