"""Bounces inside a step: closed forms to rounding, and the scheme's order with a force across the wall."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from ellipsoid_coupling.interaction.particle_forces import Drift
from ellipsoid_coupling.particles import STEPPERS
from ellipsoid_coupling.particles.bounces import Flight, fly
from ellipsoid_coupling.particles.forces import BlockForces
from ellipsoid_coupling.particles.own_clock import advance_own_clocks
from ellipsoid_coupling.particles.state import Limits, ParticleState, Rates
from ellipsoid_coupling.physics.drift import External
from ellipsoid_coupling.physics.outer import Harmonic
from ellipsoid_coupling.stepping.step_control import GIVEN, TIME, new_clock

SPRING = BlockForces(Drift(External(outer=Harmonic(1.0))), None)


def ball(height: float, t: float) -> tuple[float, float]:
    """A ball that falls from rest with acceleration 1 on an elastic floor at 0."""
    fall = math.sqrt(2.0 * height)
    since = (t + fall) % (2.0 * fall) - fall  # since the last top
    return height - 0.5 * since * since, -since


@pytest.mark.parametrize("t", [0.3, 1.0, 1.9, 7.3, 23.45])
@pytest.mark.parametrize("ceiling", [False, True])
def test_a_bouncing_ball_is_exact(t: float, ceiling: bool) -> None:
    """Closed form, over up to 20 bounces in one step: to 1e-12, the rounding of some 20 searches."""
    height, speed = ball(0.32, t)
    way = -1.0 if ceiling else 1.0
    low, high = (-9.0, 0.0) if ceiling else (0.0, 9.0)
    place, velocity, sign, bounces = fly(Flight(way * 0.32, 0.0, -way, 0.0, 0.0, 0.0), t, low, high)
    assert (place, velocity) == pytest.approx((way * height, way * speed), abs=1e-12)
    assert bounces == math.floor((t / 0.8 + 1.0) / 2.0)
    assert sign == (-1.0) ** bounces


def test_a_wall_that_is_touched_on_the_way_counts() -> None:
    """Thrown at a ceiling from below, the force away from it: in before and after the step."""
    place, velocity, _, bounces = fly(Flight(-0.1, 1.0, -2.0, 0.0, 0.0, 0.0), 0.9, -9.0, 0.0)
    meets = 0.5 * (1.0 - math.sqrt(1.0 - 0.4))
    rest, speed = 0.9 - meets, -(1.0 - 2.0 * meets)
    assert bounces == 1
    assert (place, velocity) == pytest.approx(
        (speed * rest - rest * rest, speed - 2.0 * rest), abs=1e-13
    )


def test_what_is_pressed_against_a_wall_stays_there() -> None:
    """Without speed; with a little it hops along, and keeps its energy."""
    assert fly(Flight(0.0, 0.0, -1.0, 0.0, 0.0, 0.3), 5.0, 0.0, 1.0)[:2] == (0.0, 0.0)
    place, velocity, _, _ = fly(Flight(0.0, 1e-9, -1.0, 0.0, 0.0, 0.0), 5.0, 0.0, 1.0)
    assert 0.5 * velocity**2 + place == pytest.approx(0.5e-18, rel=1e-6)


def test_free_flights_fold_as_often_as_it_takes() -> None:
    """A million bounces: a triangle wave, to the rounding of the way."""
    place, velocity, sign, _ = fly(Flight(0.25, 1.0, 0.0, 0.0, 0.0, 0.0), 1e6 + 0.5, 0.0, 1.0)
    assert (place, velocity, sign) == pytest.approx((0.75, 1.0, 1.0), abs=1e-9)


def sprung(damping: float, t: float, wall: float) -> float:
    """X'' = -x - damping x' from rest at 1, elastic wall at `wall` > 0: closed form between bounces."""
    decay, w = damping / 2.0, math.sqrt(1.0 - damping * damping / 4.0)

    def path(x: float, v: float, s: float) -> float:
        wave = x * math.cos(w * s) + (v + decay * x) / w * math.sin(w * s)
        return math.exp(-decay * s) * wave

    def speed(x: float, v: float, s: float) -> float:
        wave = v * math.cos(w * s) - (x + decay * v) / w * math.sin(w * s)
        return math.exp(-decay * s) * wave

    x, v = 1.0, 0.0
    while True:
        below = [s for s in np.linspace(1e-6, t, 2000) if path(x, v, s) < wall]
        if not below:
            return path(x, v, t)
        hit = brentq(lambda s, x, v: path(x, v, s) - wall, 1e-9, below[0], (x, v), xtol=1e-15)
        x, v, t = wall, -speed(x, v, hit), t - hit


@pytest.mark.parametrize("damping", [0.0, 0.4])
def test_a_bounce_against_a_force_keeps_order_two(damping: float) -> None:
    """A spring that pulls against a wall, four bounces: errors fall at least by 3.4 a halving.

    Order 2 on average: how a bounce lies in its step makes the single ratio vary. With the force's
    jump spread over the step it was order 1.
    """
    box, errors = np.array([[0.3, 5.0], [-5.0, 5.0]]), []
    rates = Rates(np.full(2, damping), np.zeros(2), 2, 2)
    for dt in (0.1, 0.025):
        place = np.array([[[1.0], [0.0]]])
        state = ParticleState(place, 0 * place, 0 * place, new_clock(1, dt, GIVEN), None)
        found = []
        for end in (2.0, 4.0, 6.0, 8.0):
            while state.clock[0, TIME] < end:
                until = min(state.clock[0, TIME] + dt, end)
                until = end if end - until < 1e-9 else until
                limits = Limits(dt, 1e30, np.ones(2), box)
                advance_own_clocks(STEPPERS["accurate"], state, SPRING, rates, limits, until, 1)
            found.append(state.position[0, 0, 0] - sprung(damping, end, 0.3))
        errors.append(np.abs(found).max())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 3.4**2
