"""Jeffery's term and the outer potentials against their definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.physics.external import harmonic_force, sine_torque
from ellipsoid_coupling.physics.jeffery import jeffery


@kernel
def turning(angle: float, xx: float, xy: float, yx: float, yy: float, factor: float) -> float:
    return jeffery(math.cos(2.0 * angle), math.sin(2.0 * angle), xx, xy, yx, yy, factor)


@kernel
def force(x: float, y: float) -> tuple[float, float]:
    return harmonic_force(x, y, 1.7)


@kernel
def torque(angle: float) -> float:
    return sine_torque(angle, 0.8)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 2.9])
def test_jeffery_equals_the_matrix_form(angle: float) -> None:
    """1/2 rot u + lambda n_perp . E n, exact to rounding."""
    gradient = np.array([[0.3, -1.1], [0.7, -0.3]])  # d u_i / d x_j
    across = np.array([-math.sin(angle), math.cos(angle)])
    along = np.array([math.cos(angle), math.sin(angle)])
    strain = 0.5 * (gradient + gradient.T)
    expected = 0.5 * (gradient[1, 0] - gradient[0, 1]) + 0.6 * across @ strain @ along
    assert turning(angle, 0.3, -1.1, 0.7, -0.3, 0.6) == pytest.approx(expected, abs=1e-15)


def test_a_circle_turns_with_the_fluid() -> None:
    assert turning(0.4, 0.3, -1.1, 0.7, -0.3, 0.0) == pytest.approx(0.9, abs=1e-15)


def test_outer_forces_are_minus_the_gradients() -> None:
    """Central differences of V1 = 1.7 r^2/2 and V2 = 0.8 sin(theta), error 1e-10."""
    step = 1e-5
    fx, fy = force(0.4, -0.9)
    v1 = [1.7 * ((0.4 + e) ** 2 + 0.81) / 2 for e in (-step, step)]
    v2 = [0.8 * math.sin(1.1 + e) for e in (-step, step)]
    assert fx == pytest.approx(-(v1[1] - v1[0]) / (2 * step), abs=1e-9)
    assert fy == pytest.approx(1.7 * 0.9, abs=1e-15)
    assert torque(1.1) == pytest.approx(-(v2[1] - v2[0]) / (2 * step), abs=1e-9)
