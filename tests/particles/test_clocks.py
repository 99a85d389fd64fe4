"""The loops over steps with a force of time alone: when it is asked for, and the order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.particles import STEPPERS
from ellipsoid_coupling.particles.clocks import Stepper
from ellipsoid_coupling.particles.forces import Forces
from ellipsoid_coupling.particles.shared_clock import advance_shared_clock
from ellipsoid_coupling.particles.state import Limits, ParticleState, Rates
from ellipsoid_coupling.stepping.step_control import GIVEN, new_clock

Floats = NDArray[np.float64]
BOTH = pytest.mark.parametrize("scheme", list(STEPPERS.values()), ids=list(STEPPERS))
DAMPING = 0.5


def driven(scheme: Stepper, dt: float, end: float) -> tuple[ParticleState, list[float]]:
    """Two blocks of three particles, v' = cos t - v/2 from rest, fixed steps; the times asked for."""
    place, asked = np.zeros((2, 2, 3)), []

    def force_of_time(t: float, place: Floats, force: Floats) -> None:
        asked.append(t)
        force[...] = np.full_like(place, math.cos(t))

    clock = new_clock(1, dt, GIVEN)
    state = ParticleState(place, 0.0 * place, 0.0 * place, clock, None)
    forces = Forces(None, force_of_time, BufferPool())
    rates, limits = (
        Rates(np.full(2, DAMPING), np.zeros(2), 2, 2),
        Limits(dt, 1e30, np.ones(2), None),
    )
    for n in range(round(end / dt)):
        advance_shared_clock(scheme, state, forces, rates, limits, (n + 1) * dt, 1)
    return state, asked


@BOTH
def test_forces_are_asked_for_at_the_time_of_their_evaluation(scheme: Stepper) -> None:
    """`paper` at the start of each step; `accurate` at the start, then at the end of each step."""
    _, asked = driven(scheme, 0.25, 1.0)
    expected = [0.0, 0.25, 0.5, 0.75] + ([1.0] if scheme.order == 2 else [])
    assert asked == expected


@BOTH
def test_a_force_of_time_is_met_in_the_order_of_the_scheme(scheme: Stepper) -> None:
    """V' = cos t - v/2 has v = (c cos t + sin t - c e^{-ct})/(1 + c^2), c = 1/2; slopes within 0.1."""
    c, end, errors = DAMPING, 2.0, []
    wave = c * math.cos(end) + math.sin(end) - c * math.exp(-c * end)
    for dt in (0.02, 0.01):
        state, _ = driven(scheme, dt, end)
        assert np.ptp(state.velocity) == 0.0
        errors.append(abs(state.velocity[0, 0, 0] - wave / (1.0 + c * c)))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(scheme.order, abs=0.1)
