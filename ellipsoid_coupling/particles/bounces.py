"""Bounces off walls inside a step: one coordinate of one particle, from wall to wall.

Between walls the force is linear in time, v' = f + s t - Gamma v, and the path has a closed form
(`linear`). At a wall the velocity changes its sign and the path begins anew. The force keeps its sign
and goes on in time, so that a step over a wall is as exact as any other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.reflection import reflect
from ellipsoid_coupling.particles.linear import phi_functions

# Bounces that are followed one by one in a step.
_MOST_BOUNCES = 64
# Iterations of the search for the time of a bounce; it takes some eight, and two for a parabola.
_MOST_ITERATIONS = 80
_ROUNDING = 4e-16


class Flight(NamedTuple):
    """One coordinate of a particle on its way.

    Attributes
    ----------
    position, velocity : float
        At the start.
    force, slope : float
        The force then, and how it changes in a unit of time.
    noise : float
        What noise adds to the velocity at which the position moves.
    damping : float
    """

    position: float
    velocity: float
    force: float
    slope: float
    noise: float
    damping: float


@kernel
def mean_velocity(flight: Flight, t: float) -> float:
    """(r(t) - r(0))/t."""
    phi1, phi2, phi3 = phi_functions(flight.damping * t)
    pushed = t * (phi2 * flight.force + phi3 * t * flight.slope)
    return phi1 * flight.velocity + pushed + flight.noise


@kernel
def velocity_at(flight: Flight, t: float) -> float:
    """v(t), without noise."""
    z = flight.damping * t
    phi1, phi2, _ = phi_functions(z)
    pushed = t * (phi1 * flight.force + phi2 * t * flight.slope)
    return math.exp(-z) * flight.velocity + pushed


@kernel
def _beyond(flight: Flight, wall: float, t: float) -> float:
    """How far beyond a wall the path is at t; over t if it begins at the wall."""
    # A path that begins at the wall has a root at 0, which is not the one that is looked for.
    gap, mean = flight.position - wall, mean_velocity(flight, t)
    return mean if gap == 0.0 else gap + t * mean


@kernel
def time_of(flight: Flight, wall: float, turning: bool, end: float) -> float:
    """The time before `end` when the path is at a wall, or where it turns round: regula falsi (Illinois).

    Halving the value at the end that stays keeps the bracket and makes the order 1.44, without derivatives.
    """
    a, b = 0.0, end
    at_a = velocity_at(flight, a) + flight.noise if turning else _beyond(flight, wall, a)
    at_b = velocity_at(flight, b) + flight.noise if turning else _beyond(flight, wall, b)
    for _ in range(_MOST_ITERATIONS):
        # A root to the bit, or a secant that is level and meets nothing.
        if at_b == 0.0 or at_a == at_b:
            break
        c = b - at_b * (b - a) / (at_b - at_a)
        at_c = velocity_at(flight, c) + flight.noise if turning else _beyond(flight, wall, c)
        if at_c * at_b < 0.0:
            a, at_a = b, at_b
        else:
            at_a *= 0.5
        moved = abs(c - b)
        b, at_b = c, at_c
        if moved <= _ROUNDING * end:
            break
    # Rounding may lead out of the bracket.
    return min(max(b, 0.0), end)


@kernel
def first_exit(flight: Flight, left: float, low: float, high: float) -> tuple[float, float]:
    """The wall that the path crosses first, and a time when it is beyond; 0 if it crosses none."""
    started, ended = flight.velocity + flight.noise, velocity_at(flight, left) + flight.noise
    # The end alone does not show a wall that was crossed and left again.
    if started * ended < 0.0:
        # It turns round on the way: it may have crossed a wall and come back.
        t = time_of(flight, 0.0, True, left)
        top = flight.position + t * mean_velocity(flight, t)
        if t > 0.0 and (top < low or top > high):
            return low if top < low else high, t
    end = flight.position + left * mean_velocity(flight, left)
    if end < low or end > high:
        return low if end < low else high, left
    return 0.0, 0.0


@kernel
def fly(flight: Flight, time: float, low: float, high: float) -> tuple[float, float, float, int]:
    """Where a coordinate within low .. high is after `time`.

    Returns
    -------
    (position, velocity, sign, bounces); the velocity is without noise, sign is -1 after an odd number of
    bounces.
    """
    sign, left, resting = 1.0, time, False
    for bounces in range(_MOST_BOUNCES):
        wall, beyond = first_exit(flight, left, low, high)
        if beyond == 0.0:
            end = flight.position + left * mean_velocity(flight, left)
            return min(max(end, low), high), velocity_at(flight, left), sign, bounces
        # At the wall, from the bounce before or from the start, and pressed on: the bounce is now.
        outwards = 1.0 if wall == high else -1.0
        at_once = flight.position == wall and (flight.velocity + flight.noise) * outwards >= 0.0
        if at_once and resting:
            # The force presses it against the wall, and the bounce before left it no speed.
            return wall, flight.velocity, sign, bounces
        t = 0.0 if at_once else time_of(flight, wall, False, beyond)
        # Force and slope go on in time; velocity and noise turn round.
        force = flight.force + t * flight.slope
        speed = -velocity_at(flight, t)
        flight = Flight(wall, speed, force, flight.slope, -flight.noise, flight.damping)
        sign, left, resting = -sign, left - t, at_once
    position = flight.position + left * (flight.velocity + flight.noise)
    if low <= position <= high:
        # Many tiny hops along one wall. To stop at the wall with the present speed keeps the energy.
        return flight.position, flight.velocity, sign, _MOST_BOUNCES
    # Many crossings of the box: the force matters little, and the free path is folded back.
    position, turned = reflect(position, low, high)
    return position, turned * flight.velocity, turned * sign, _MOST_BOUNCES
