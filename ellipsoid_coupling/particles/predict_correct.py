"""One step of the scheme `accurate`: predict with a constant drift, correct with its change.

The formulas are those of `exponential`; between the two a caller evaluates the drift. All particles take
the plain formula in a loop that vectorises. Those that may come to a wall within the step, few as a rule,
are then done again with their bounces, off a box or off edges of any shape (`at_edges`). Both ends are
wrapped where sides are periodic: the drift is known in the domain only.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.reflection import reflect
from ellipsoid_coupling.particles.at_edges import (
    ends_at_edges,
    feed,
    predict_at_edges,
    settle,
)
from ellipsoid_coupling.particles.bounces import Flight, fly
from ellipsoid_coupling.particles.frozen import freeze, places_before
from ellipsoid_coupling.particles.linear import LinearStep, linear_step, noise_of
from ellipsoid_coupling.particles.state import Limits, ParticleState, Rates, Trial, wrap_places
from ellipsoid_coupling.stepping.step_control import TIME

Floats = NDArray[np.float64]


@kernel
def _predict(state: ParticleState, k: int, d: int, linear: LinearStep, trial: Trial) -> None:
    """The position at the step's end for a constant drift, before noise."""
    place, velocity, force = state.place[k, d], state.velocity[k, d], state.force[k, d]
    for i in range(place.size):
        trial.place[d, i] = (
            place[i] + linear.place_velocity * velocity[i] + linear.place_force * force[i]
        )


@kernel
def _add_place_noise(
    noise: Floats | None, d: int, rates: Rates, linear: LinearStep, place: Floats
) -> None:
    if noise is not None and rates.first_noisy <= d < rates.last_noisy:
        for i in range(place.size):
            place[i] += noise_of(noise, d, rates, linear, i)[0]


@kernel
def _add_velocity_noise(
    noise: Floats | None, d: int, rates: Rates, linear: LinearStep, velocity: Floats
) -> None:
    if noise is not None and rates.first_noisy <= d < rates.last_noisy:
        for i in range(velocity.size):
            velocity[i] += noise_of(noise, d, rates, linear, i)[1]


@kernel
def _may_bounce(flight: Flight, linear: LinearStep, dt: float, low: float, high: float) -> bool:
    """Whether the path may come to a wall within the step."""
    # A bound: a particle that it takes in needlessly is flown without a bounce, which differs by rounding.
    way = linear.place_velocity * abs(flight.velocity) + linear.place_force * abs(flight.force)
    way += linear.place_missed * abs(flight.slope) * dt + abs(flight.noise) * dt
    return not low + way <= flight.place <= high - way


@kernel
def _predict_at_walls(
    state: ParticleState,
    k: int,
    d: int,
    noise: Floats | None,
    rates: Rates,
    walls: Floats,
    trial: Trial,
    dt: float,
) -> None:
    """Predict anew what may come to one of two walls."""
    low, high = walls
    linear = linear_step(rates.damping[d], rates.amplitude[d], dt)
    place, velocity, force = state.place[k, d], state.velocity[k, d], state.force[k, d]
    for i in range(place.size):
        moved = noise_of(noise, d, rates, linear, i)[0]
        # The noise of the whole step is spread evenly over it: how it came about is not known.
        flight = Flight(place[i], velocity[i], force[i], 0.0, moved / dt, rates.damping[d])
        if _may_bounce(flight, linear, dt, low, high):
            trial.place[d, i] = fly(flight, dt, low, high)[0]


@kernel
def _correct(state: ParticleState, k: int, d: int, linear: LinearStep, trial: Trial) -> None:
    """Finish the step of one degree of freedom, but for noise and walls."""
    place, velocity, force = state.place[k, d], state.velocity[k, d], state.force[k, d]
    for i in range(place.size):
        change = trial.force[d, i] - force[i]
        # The trial has the noise in it already; the correction is linear in the drift's change.
        place[i] = trial.place[d, i] + linear.place_change * change
        velocity[i] = (
            linear.decay * velocity[i]
            + linear.velocity_force * force[i]
            + linear.velocity_change * change
        )
        force[i] = trial.force[d, i]


@kernel
def _correct_at_walls(
    state: ParticleState,
    k: int,
    d: int,
    noise: Floats | None,
    rates: Rates,
    walls: Floats,
    trial: Trial,
    dt: float,
) -> None:
    """Finish the step of one coordinate between two walls."""
    low, high = walls
    linear = linear_step(rates.damping[d], rates.amplitude[d], dt)
    place, velocity, force = state.place[k, d], state.velocity[k, d], state.force[k, d]
    for i in range(place.size):
        change = trial.force[d, i] - force[i]
        moved, kicked = noise_of(noise, d, rates, linear, i)
        flight = Flight(place[i], velocity[i], force[i], change / dt, moved / dt, rates.damping[d])
        end, speed = trial.place[d, i] + linear.place_change * change, linear.decay * velocity[i]
        speed += linear.velocity_force * force[i] + linear.velocity_change * change
        if _may_bounce(flight, linear, dt, low, high):
            there, after, sign, bounces = fly(flight, dt, low, high)
            if bounces > 0:
                # A bounce turns round the velocity's noise of the step as well: it keeps its law.
                end, speed, kicked = there, after, sign * kicked
        # Rounding, and the correction of a path that `_may_bounce` let pass, may end just outside.
        place[i], sign = reflect(end, low, high)
        velocity[i] = sign * (speed + kicked)
        force[i] = trial.force[d, i]


@kernel
def predict_step(
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> None:
    """Where a step of realisation k leads for a constant drift: `trial` but for its force."""
    for d in range(state.place.shape[1]):
        linear = linear_step(rates.damping[d], rates.amplitude[d], dt)
        _predict(state, k, d, linear, trial)
        _add_place_noise(noise, d, rates, linear, trial.place[d])
    _predict_in_box(limits.box, state, k, noise, rates, trial, dt)
    predict_at_edges(limits.edges, state, k, noise, rates, trial, dt)
    wrap_places(limits.periods, trial.place)


@kernel
def _predict_in_box(
    box: Floats | None,
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    trial: Trial,
    dt: float,
) -> None:
    # A function of its own: numba leaves out what stands behind `if x is not None` for arguments only.
    if box is not None:
        for d in range(2):
            _predict_at_walls(state, k, d, noise, rates, box[d], trial, dt)


@kernel
def accept_step(
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> None:
    """Finish the step of realisation k that `trial` predicts, in place; its clock is at the step's end."""
    before = places_before(limits.mesh, state.place[k])
    _unwrap(limits.periods, before, state, k, noise, rates, trial, dt)
    ends = ends_at_edges(limits.edges, state, k, noise, rates, trial, dt)
    done = _correct_in_box(limits.box, state, k, noise, rates, trial, dt)
    for d in range(done, len(trial.place)):
        linear = linear_step(rates.damping[d], rates.amplitude[d], dt)
        _correct(state, k, d, linear, trial)
        _add_velocity_noise(noise, d, rates, linear, state.velocity[k, d])
    t = state.clock[0, TIME]
    settle(limits.edges, ends, state, k, t - dt)
    feed(state, k, limits, t)
    freeze(state, k, limits, before)
    wrap_places(limits.periods, state.place[k])


@kernel
def _unwrap(
    periods: Floats | None,
    before: Floats | None,
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    trial: Trial,
    dt: float,
) -> None:
    """Shift the places before a step by whole periods to where the straight way to the trial began."""
    if periods is not None and before is not None:
        for d in range(2):
            if math.isinf(periods[d, 1]):
                continue
            linear = linear_step(rates.damping[d], rates.amplitude[d], dt)
            velocity, force = state.velocity[k, d], state.force[k, d]
            for i in range(before.shape[1]):
                moved = linear.place_velocity * velocity[i] + linear.place_force * force[i]
                moved += noise_of(noise, d, rates, linear, i)[0]
                before[d, i] = trial.place[d, i] - moved


@kernel
def _correct_in_box(
    box: Floats | None,
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    trial: Trial,
    dt: float,
) -> int:
    """Finish the step of the coordinates that walls bound; returns how many those are."""
    if box is None:
        return 0
    for d in range(2):
        _correct_at_walls(state, k, d, noise, rates, box[d], trial, dt)
    return 2
