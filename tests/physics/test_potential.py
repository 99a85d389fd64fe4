"""The reduced pair potential against the paper's matrix definition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.physics.potential import (
    PotentialShape,
    pair_potential,
    potential_shape,
)

Complexes = NDArray[np.complex128]


@kernel
def evaluate(
    dx: float, dy: float, theta: float, bar: float, shape: PotentialShape
) -> tuple[float, float, float, float]:
    c2, s2 = math.cos(2.0 * theta), math.sin(2.0 * theta)
    return pair_potential(dx, dy, c2, s2, math.cos(2.0 * bar), math.sin(2.0 * bar), shape)


def defined(arguments: Complexes, length: float, width: float) -> complex:
    """U/eps0 of the paper for (x, y, theta, thetabar), rbar = 0, complex arguments allowed."""
    x, y, theta, bar = arguments
    l2, d2 = (2 * length) ** 2, (2 * width) ** 2
    factor = (l2 - d2) / (l2 + d2)

    def gaussian(angle: complex) -> Complexes:
        axis = np.array([np.cos(angle), np.sin(angle)])
        return np.asarray((l2 - d2) * np.outer(axis, axis) + d2 * np.eye(2), np.complex128)

    delta = np.array([-x, -y])
    s = delta @ np.linalg.inv(gaussian(theta) + gaussian(bar)) @ delta
    strength = (1 - factor**2 * np.cos(theta - bar) ** 2) ** -0.5
    return complex(strength * np.exp(-s / (1 - s)))


def derivatives(arguments: NDArray[np.float64], length: float, width: float) -> list[float]:
    """By the complex step, exact to rounding: no difference of nearly equal numbers is taken."""
    step = 1e-30
    found: list[float] = []
    for i in range(3):
        shifted = arguments.astype(np.complex128)
        shifted[i] += 1j * step
        found.append(defined(shifted, length, width).imag / step)
    return found


@pytest.mark.parametrize("aspect", [1.0, 1.2, 2.0, 5.0, 20.0])
def test_potential_and_derivatives_equal_the_definition(aspect: float) -> None:
    """To 1e-9 of the largest value (rounding grows with the aspect ratio, 2e-13 at best)."""
    rng = np.random.default_rng(int(10 * aspect))
    length, width = 0.05, 0.05 / aspect
    shape = potential_shape(length, width)
    found: list[tuple[float, ...]] = []
    expected: list[tuple[float, ...]] = []
    while len(found) < 200:
        place = rng.uniform(-shape.reach, shape.reach, 2)
        angles = rng.uniform(0, 2 * math.pi, 2)
        got = evaluate(-place[0], -place[1], angles[0], angles[1], shape)
        if got[0] < 1e-12:
            continue
        arguments = np.concatenate([place, angles])
        value = defined(arguments.astype(np.complex128), length, width).real
        found.append(got)
        expected.append((value, *derivatives(arguments, length, width)))
    scale = np.abs(np.array(expected)).max(axis=0) + 1e-300
    assert np.max(np.abs(np.array(found) - np.array(expected)) / scale) < 1e-9


def test_nothing_beyond_the_reach_and_something_within() -> None:
    shape = potential_shape(0.05, 0.025)
    assert evaluate(shape.reach * 1.0001, 0.0, 0.0, 0.0, shape) == (0.0, 0.0, 0.0, 0.0)
    assert shape.reach == pytest.approx(math.sqrt(2.0) * 0.1)
    assert evaluate(shape.reach * 0.9, 0.0, 0.0, 0.0, shape)[0] > 0.0


def test_self_term_vanishes() -> None:
    shape = potential_shape(0.05, 0.025)
    _, *gradient = evaluate(0.0, 0.0, 0.7, 0.7, shape)
    assert np.max(np.abs(gradient)) < 1e-14


def test_force_is_antisymmetric_in_the_pair() -> None:
    shape = potential_shape(0.05, 0.02)
    one = evaluate(0.03, -0.02, 0.4, 1.9, shape)
    other = evaluate(-0.03, 0.02, 1.9, 0.4, shape)
    assert np.allclose(one[1:3], [-other[1], -other[2]], rtol=1e-14)
    assert abs(one[3] + other[3]) > 1e-3  # the torque is not


def test_circles_feel_no_torque() -> None:
    assert evaluate(0.03, 0.01, 0.3, 1.2, potential_shape(0.05, 0.05))[3] == 0.0


def test_aligned_particles_repel_at_long_and_cluster_at_short_waves() -> None:
    """The transform of U(delta, 0, 0) has a lobe of -6.4 % (grid of 0.002: to 1 %) at 2 pi/k = 0.057.

    A negative lobe makes an even density unstable, which is why solutions show stripes.
    """
    n, h = 256, 0.002
    shape = potential_shape(0.05, 0.025)
    offsets = (np.arange(n) - n // 2) * h
    values = np.array([[evaluate(x, y, 0.0, 0.0, shape)[0] for x in offsets] for y in offsets])
    transform = np.fft.fft2(np.fft.ifftshift(values)).real
    wave = 2.0 * np.pi * np.fft.fftfreq(n, h)
    growth = -(wave[:, None] ** 2 + wave[None, :] ** 2) * transform
    across, along = np.unravel_index(growth.argmax(), growth.shape)
    assert transform.min() / transform[0, 0] == pytest.approx(-0.0636, rel=0.01)
    assert along == 0
    assert 2.0 * np.pi / abs(wave[across]) == pytest.approx(0.057, abs=0.004)


@pytest.mark.parametrize("width", [0.05, 1e-3, 1e-6, 1e-10])
def test_parallel_needles_keep_all_digits(width: float) -> None:
    """Side by side and in line: U = S/(2 l d) e^(-s/(1-s)), s = dx^2/(2 l^2) + dy^2/(2 d^2).

    1 - lambda^2, of which no digit is left at a width of 1e-10, is never formed: exact to rounding.
    """
    shape = potential_shape(0.1, width)
    long_axis, short_axis = 0.2, 2.0 * width
    largest = (long_axis**2 + short_axis**2) / (2.0 * long_axis * short_axis)
    for dx, dy in ((0.07, 0.0), (0.0, 0.4 * width), (0.05, 0.9 * width)):
        s = dx**2 / (2.0 * long_axis**2) + dy**2 / (2.0 * short_axis**2)
        expected = largest * math.exp(-s / (1.0 - s))
        slope = expected / (1.0 - s) ** 2
        potential, along, across, _ = evaluate(dx, dy, 0.0, 0.0, shape)
        assert potential == pytest.approx(expected, rel=1e-13)
        assert along == pytest.approx(slope * dx / long_axis**2, rel=1e-13)
        assert across == pytest.approx(slope * dy / short_axis**2, rel=1e-13)


def test_needles_at_any_angle_stay_finite() -> None:
    rng = np.random.default_rng(5)
    shape = potential_shape(0.1, 1e-12)
    for dx, dy, theta, change in rng.random((1000, 4)):
        for bar in (theta, theta + 1e-9 * change, theta + change):
            assert np.isfinite(evaluate(0.1 * dx, 0.1 * dy, theta, bar, shape)).all()
