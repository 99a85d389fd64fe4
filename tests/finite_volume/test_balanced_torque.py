"""The torque of V2 whose trapezoidal sums are the differences of V2."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.finite_volume.well_balanced import balanced_torque
from ellipsoid_coupling.physics.angular import Axis, Sine, angular_energy
from ellipsoid_coupling.scenes.kinds import Record


@pytest.mark.parametrize("number", [7, 8, 60])
@pytest.mark.parametrize("potential", [Sine(0.8), Axis(0.8, 0.3)])
def test_its_work_is_the_difference_of_the_potential(potential: Record, number: int) -> None:
    """To rounding: equilibria are kept on the very cells."""
    angles = 2.0 * np.pi * np.arange(number) / number
    torque = balanced_torque(potential, angles)
    energy = np.array([angular_energy(potential, float(angle)) for angle in angles])
    work = np.pi / number * (torque + np.roll(torque, -1))
    np.testing.assert_allclose(work, energy - np.roll(energy, -1), atol=1e-14)


def test_of_a_sine_it_is_the_torque_raised_by_a_factor() -> None:
    """tan(k/2)/(k/2), k the width of a cell."""
    angles = 2.0 * np.pi * np.arange(8) / 8
    half = np.pi / 8
    expected = -0.8 * np.cos(angles) * np.tan(half) / half
    np.testing.assert_allclose(balanced_torque(Sine(0.8), angles), expected, atol=1e-14)


@pytest.mark.parametrize("number", [1, 2])
def test_one_and_two_angles_have_none(number: int) -> None:
    """A sine at 0 and pi has no differences."""
    angles = 2.0 * np.pi * np.arange(number) / number
    np.testing.assert_allclose(balanced_torque(Sine(0.8), angles), 0.0, atol=1e-15)
