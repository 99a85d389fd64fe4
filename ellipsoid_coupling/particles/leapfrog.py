"""Scheme `paper`: first-order leapfrog with Euler-Maruyama noise.

    v_{n+1} = v_n + dt (F(r_n, theta_n) - Gamma v_n) + A sqrt(dt) xi
    r_{n+1} = r_n + dt v_{n+1}

and the same for theta and omega. Explicit in the damping, so stable only for dt Gamma < 2; the
velocity's equilibrium variance is 1/(1 - dt Gamma/2) of the exact one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import for_each, kernel
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces
from ellipsoid_coupling.particles.frozen import freeze, frozen_row, places_before
from ellipsoid_coupling.particles.state import (
    Limits,
    ParticleState,
    Rates,
    all_finite,
    bounce,
    largest_forces,
    noise_rows,
    note_forces,
)
from ellipsoid_coupling.stepping.status import NOT_FINITE, RUNNING
from ellipsoid_coupling.stepping.step_control import (
    GIVEN,
    STATUS,
    TIME,
    accept,
    equal_steps,
)

Floats = NDArray[np.float64]

ORDER = 1
NOISE_PER_STEP = 1


@kernel
def _kick(velocity: Floats, force: Floats, rates: Rates, dt: float) -> None:
    for d in range(velocity.shape[0]):
        for i in range(velocity.shape[1]):
            velocity[d, i] += dt * (force[d, i] - rates.damping[d] * velocity[d, i])


@kernel
def _add_noise(velocity: Floats, noise: Floats | None, rates: Rates, dt: float) -> None:
    if noise is not None:
        for d in range(rates.first_noisy, rates.last_noisy):
            size = rates.amplitude[d] * math.sqrt(dt)
            for i in range(velocity.shape[1]):
                velocity[d, i] += size * noise[d - rates.first_noisy, i]


@kernel
def _drift(place: Floats, velocity: Floats, dt: float) -> None:
    for d in range(place.shape[0]):
        for i in range(place.shape[1]):
            place[d, i] += dt * velocity[d, i]


@kernel
def move(state: ParticleState, k: int, step: int, rates: Rates, limits: Limits, dt: float) -> None:
    """One step of realisation k in the drift `state.force`, noise row `step`, in place."""
    place, velocity = state.place[k], state.velocity[k]
    before = places_before(limits.mesh, place)
    _kick(velocity, state.force[k], rates, dt)
    _add_noise(velocity, noise_rows(state.noise, k, step), rates, dt)
    _drift(place, velocity, dt)
    bounce(limits.box, place, velocity)
    freeze(state, k, limits, before)


@kernel
def _step(
    state: ParticleState, k: int, step: int, drift: Drift, rates: Rates, limits: Limits, dt: float
) -> None:
    clock = state.clock[k]
    frozen = frozen_row(state.frozen, k)
    particle_forces(drift, clock[TIME], state.place[k], state.force[k], frozen)
    note_forces(clock, *largest_forces(state.force[k]))
    move(state, k, step, rates, limits, dt)
    if not all_finite(state.place[k]):
        clock[STATUS] = NOT_FINITE


@kernel
def _advance_one(
    state: ParticleState,
    k: int,
    drift: Drift,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    clock = state.clock[k]
    for step in range(steps):
        remaining = until - clock[TIME]
        if remaining <= 0.0 or clock[STATUS] != RUNNING:
            return
        dt = equal_steps(remaining, limits.step)
        _step(state, k, step, drift, rates, limits, dt)
        accept(clock, until, dt, limits.step, GIVEN)


def advance(
    state: ParticleState, drift: Drift, rates: Rates, limits: Limits, until: float, steps: int
) -> None:
    """Move every realisation by at most `steps` steps, in place and never beyond `until`."""
    for_each(
        state.place.shape[0],
        lambda k: _advance_one(state, k, drift, rates, limits, until, steps),
    )
