"""The harmonics against the direct sum, within the tolerance that they promise."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.interaction import DirectInteraction, Forces, HarmonicInteraction
from ellipsoid_coupling.interaction.convolution import angular_series as angular_module
from ellipsoid_coupling.interaction.convolution.angular_series import (
    AngularSeries,
    angular_series,
    potential_coefficients,
)
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape

Array = NDArray[np.float64]

LENGTH = 0.05
H = 0.025
NY, NX = 20, 26
CELLS = (NY, NX)


@functools.cache
def series_of(aspect: float, tolerance: float, h: float = H) -> AngularSeries:
    series = angular_series(potential_shape(LENGTH, LENGTH / aspect), h, tolerance, 150)
    assert series is not None
    return series


def blob() -> tuple[Array, Array]:
    """A spread suspension with a smooth field of angles."""
    y, x = np.meshgrid(np.linspace(0, 1, NY), np.linspace(0, 1, NX), indexing="ij")
    density = 20.0 * np.exp(-((x - 0.6) ** 2 + (y - 0.4) ** 2) / 0.02)
    return np.where(density > 1e-3, density, 0.0), 3.0 * np.sin(4.0 * x) * np.cos(3.0 * y)


def box() -> tuple[Array, Array]:
    """The cavity's start: density 25 in the middle, all angles 0."""
    density = np.zeros(CELLS)
    density[8:12, 10:16] = 25.0
    return density, np.zeros(CELLS)


def scatter() -> tuple[Array, Array]:
    """The roughest: density and angles that jump from cell to cell."""
    rng = np.random.default_rng(6)
    return rng.random(CELLS), rng.uniform(-20.0, 20.0, CELLS)


def errors(found: Forces, exact: Forces) -> Array:
    """Largest errors of the force's length and of the torque."""
    force = float(np.hypot(found.x - exact.x, found.y - exact.y).max())
    if found.torque is None or exact.torque is None:
        return np.array([force])
    return np.array([force, np.abs(found.torque - exact.torque).max()])


@pytest.mark.parametrize("fields", [blob, box, scatter])
@pytest.mark.parametrize(
    ("aspect", "tolerance"),
    # Aspect ratio 5 at 1e-4 takes more than 100 harmonics, which never pays.
    [(1.0, 1e-2), (1.0, 1e-4), (2.0, 1e-2), (2.0, 1e-3), (2.0, 1e-4), (5.0, 1e-2), (5.0, 1e-3)],
)
def test_error_is_within_the_tolerance(
    aspect: float, tolerance: float, fields: Callable[[], tuple[Array, Array]]
) -> None:
    # The bound of `angular_series`, which holds for any fields.
    density, angle = fields()
    series = series_of(aspect, tolerance)
    exact = DirectInteraction(CELLS, H, series.shape, 2.0)(density, angle)
    found = HarmonicInteraction(CELLS, 2.0, series)(density, angle)
    bound = tolerance * density.max() * 2.0 * H**2 * series.norms
    assert np.all(errors(found, exact) <= bound)


def worst_angles(series: AngularSeries) -> tuple[Array, Array]:
    """Angles of all cells that make the series' error in the middle cell's x force largest.

    One source in the middle and dust elsewhere shows the error at all offsets; the kernel depends
    on the offset only, so the source of an offset seen from the middle is the dust's mirror image.
    Returns angles and errors (23, 23).
    """
    cells = 23, 23
    density = np.full(cells, 1e-12)
    density[11, 11] = 1.0
    lattice = np.pi * np.arange(48) / 48
    angle, largest = np.zeros(cells), np.full(cells, -np.inf)
    direct = DirectInteraction(cells, H, series.shape, 1.0)
    harmonic = HarmonicInteraction(cells, 1.0, series)
    for candidate in lattice:
        field = np.zeros(cells)
        field[11, 11] = candidate
        error = (harmonic(density, field).x - direct(density, field).x)[::-1, ::-1]
        angle = np.where(error > largest, candidate, angle)
        largest = np.maximum(error, largest)
    angle[11, 11] = 0.0
    largest[11, 11] = 0.0
    return angle, largest


def test_bound_is_not_absurdly_loose() -> None:
    # Angles chosen against the series come near the bound, which is a supremum over both angles and
    # over directions; here the target's angle is 0 and only x counts.
    series = series_of(2.0, 1e-2)
    angle, largest = worst_angles(series)
    density = np.ones(angle.shape)
    exact = DirectInteraction(angle.shape, H, series.shape, 1.0)(density, angle)
    found = HarmonicInteraction(angle.shape, 1.0, series)(density, angle)
    error = found.x[11, 11] - exact.x[11, 11]
    assert error == pytest.approx(largest.sum(), rel=1e-2)
    bound = H**2 * series.errors[0]
    assert bound / 6.0 < error <= bound


def test_series_length_falls_with_the_tolerance_and_is_shortest() -> None:
    lengths = [series_of(2.0, tolerance).harmonics for tolerance in (1e-1, 1e-2, 1e-3, 1e-4)]
    assert np.all(np.diff(lengths) > 0)
    series = series_of(2.0, 1e-2)
    assert np.all(series.errors <= 1e-2 * series.norms)
    assert angular_series(series.shape, H, 1e-2, series.harmonics - 1) is None


def test_coefficients_sum_to_the_gradients() -> None:
    # One pair, all of the series by hand: within the tolerance of the sum of all peaks.
    series = series_of(2.0, 1e-3)
    theta, theta_bar, k = 0.4, 1.3, 4
    distance = H * np.sqrt(series.squares[k])
    orders = 2.0 * np.arange(1, series.harmonics + 1)

    def basis(angle: float) -> Array:
        pairs = np.stack([np.cos(orders * angle), np.sin(orders * angle)], axis=1)
        return np.concatenate([[1.0], pairs.ravel()])

    found = basis(theta) @ series.coefficients[k] @ basis(theta_bar)
    angles = np.cos(0.8), np.sin(0.8), np.cos(2.6), np.sin(2.6)
    exact = pair_potential(float(distance), 0.0, *angles, series.shape)[1:]
    bound = 1e-3 * series.norms[[0, 0, 1]]
    assert np.all(np.abs(found - exact) <= bound)
    # The potential's own series: so near it is smooth, and all digits are there.
    potential = basis(theta) @ potential_coefficients(series)[k, 0] @ basis(theta_bar)
    assert potential == pytest.approx(
        pair_potential(float(distance), 0.0, *angles, series.shape)[0], abs=1e-9
    )


def test_circles_need_no_harmonics_and_have_no_torque() -> None:
    # One angle-free kernel; in double precision nothing but rounding is left.
    density, angle = scatter()
    series = series_of(1.0, 1e-12)
    assert series.harmonics == 0
    found = HarmonicInteraction(CELLS, 1.0, series)(density, angle)
    exact = DirectInteraction(CELLS, H, series.shape, 1.0)(density, angle)
    assert found.torque is None
    assert errors(found, exact)[0] < 1e-13 * H**2 * series.norms[0]


def test_converges_to_the_direct_sum() -> None:
    # Double precision below 1e-4: the sampled gradients are the direct sum's own.
    density, angle = scatter()
    series = series_of(1.5, 1e-8)
    found = HarmonicInteraction(CELLS, 1.0, series)(density, angle)
    exact = DirectInteraction(CELLS, H, series.shape, 1.0)(density, angle)
    assert np.all(errors(found, exact) <= 1e-8 * H**2 * series.norms)


def test_momentum_is_kept_within_the_tolerance() -> None:
    density, angle = blob()
    series = series_of(2.0, 1e-3)
    found = HarmonicInteraction(CELLS, 1.0, series)(density, angle)
    bound = 1e-3 * density.sum() * density.max() * H**2 * series.norms[0]
    assert abs(np.sum(density * found.x)) <= bound
    assert abs(np.sum(density * found.y)) <= bound


def test_moving_the_suspension_moves_its_forces() -> None:
    # Box 4 x 6 in a grid of 20 x 26: transforms thinned out, at any place the same numbers.
    density, angle = np.zeros(CELLS), np.zeros(CELLS)
    rng = np.random.default_rng(7)
    density[:4, :6], angle[:4, :6] = rng.random((4, 6)), rng.uniform(-4, 4, (4, 6))
    interaction = HarmonicInteraction(CELLS, 1.0, series_of(2.0, 1e-3))
    plain = interaction(density, angle)
    moved = interaction(np.roll(density, (9, 20), (0, 1)), np.roll(angle, (9, 20), (0, 1)))
    for one, two in zip(plain, moved, strict=True):
        assert one is not None
        np.testing.assert_array_equal(np.roll(one, (9, 20), (0, 1)), two)
    # The same with all frequencies, for a grain of dust in the corner spans the whole grid.
    density[-1, -1] = 1e-9
    whole = interaction(density, angle)
    np.testing.assert_allclose(whole.x[:4, :6], plain.x[:4, :6], atol=1e-5 * np.ptp(plain.x))


def test_turning_the_picture_turns_the_forces() -> None:
    # The series keeps the rotational symmetry: equal to rounding in single precision.
    rng = np.random.default_rng(8)
    density, angle = rng.random((18, 18)), rng.uniform(-4, 4, (18, 18))
    interaction = HarmonicInteraction((18, 18), 1.0, series_of(2.0, 1e-2))
    plain = interaction(density, angle)
    turned = interaction(np.rot90(density, -1).copy(), np.rot90(angle, -1) + 0.5 * np.pi)
    atol = 1e-5 * np.abs(plain.x).max()
    np.testing.assert_allclose(turned.x, -np.rot90(plain.y, -1), atol=atol)
    np.testing.assert_allclose(turned.y, np.rot90(plain.x, -1), atol=atol)


def test_same_bits_on_one_and_two_threads() -> None:
    density, angle = blob()
    interaction = HarmonicInteraction(CELLS, 1.0, series_of(2.0, 1e-2))
    before = numba.get_num_threads()
    results = []
    for threads in (1, min(2, before)):
        numba.set_num_threads(threads)
        results.append(interaction(density, angle))
    numba.set_num_threads(before)
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_what_was_computed_before_leaves_no_trace() -> None:
    """Arrays are kept from call to call: a small cloud after a large one is as if it were first."""
    small, large = box(), scatter()
    interaction = HarmonicInteraction(CELLS, 1.0, series_of(2.0, 1e-2))
    first = interaction(*small)
    interaction(*large)
    again = interaction(*small)
    for one, two in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, two)


def test_vacuum_feels_nothing() -> None:
    density, angle = box()
    interaction = HarmonicInteraction(CELLS, 1.0, series_of(2.0, 1e-2))
    density[9, 12] = 0.0
    for field in interaction(density, angle):
        assert field is not None
        assert np.all(field[density == 0.0] == 0.0)
    assert np.all(interaction(np.zeros(CELLS), angle).x == 0.0)


def test_reach_below_one_cell_gives_no_force() -> None:
    shape: PotentialShape = potential_shape(LENGTH, 0.025)
    series = series_of(2.0, 1e-2, h=0.5)
    found = HarmonicInteraction(CELLS, 1.0, series)(*scatter())
    exact = DirectInteraction(CELLS, 0.5, shape, 1.0)(*scatter())
    np.testing.assert_allclose(found.x, exact.x, atol=1e-12)


@pytest.mark.parametrize(("aspect", "tolerance"), [(1.2, 1e-4), (2.0, 2e-2), (4.0, 5e-2)])
def test_a_series_that_just_reaches_the_tolerance_is_found(aspect: float, tolerance: float) -> None:
    """The search gives up early only where there is nothing to find."""
    shape = potential_shape(LENGTH, LENGTH / aspect)
    series = series_of(aspect, tolerance)
    again = angular_series(shape, H, tolerance, series.harmonics)
    assert again is not None
    assert again.harmonics == series.harmonics


def test_a_tolerance_beyond_rounding_is_given_up_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """A series of 1000 harmonics would take minutes; 62 show that it reaches no 1e-16 either."""
    tried: list[int] = []

    def expand(*arguments: Any) -> Any:
        tried.append(arguments[2])
        return angular_expand(*arguments)

    angular_expand = angular_module._expand
    monkeypatch.setattr(angular_module, "_expand", expand)
    assert angular_series(potential_shape(LENGTH, LENGTH / 1.2), H, 1e-16, 1000) is None
    assert max(tried) <= 126
