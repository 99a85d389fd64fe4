"""Scheme `accurate`: second order, the linear part (drag, damping, noise) integrated exactly.

With z = Gamma dt and the drift F (per mass) taken linear in time over the step, the exact solution
of r' = v, v' = F - Gamma v + A dW/dt is

    r_{n+1} = r_n + dt phi1 v_n + dt^2 [ phi2 F_n + c phi3 (F_{n+1} - F_n) ] + R_n          c = 1
    v_{n+1} = e^{-z} v_n + dt [ phi1 F_n + phi2 (F_{n+1} - F_n) ] + W_n

with phi1, phi2, phi3 of `linear` and (R_n, W_n) Gaussian of the exact covariance. F_{n+1} is evaluated
once, where the formula without phi3 leads (predict - evaluate - correct). For Gamma -> infinity this is
Heun's rule for r' = F/Gamma: stiff drag costs nothing. Walls are met inside a step (`bounces`).

The correction dt^2 phi3 (F_{n+1} - F_n) is the error estimate: its root mean square over all particles
is kept below the tolerance, the worst one below `local_error.WORST` times that. No step is so
long that particles pass one another unseen (`collisions`).

The position's correction takes energy out, dt^3/12 of it a step. Without drag nothing else does: there
c = 0, which is velocity Verlet, time-reversible, and keeps the energy but for a ripple of order dt^2. Any
change of the step breaks that, so without drag and noise the step is held: it grows ever more seldom
(`held_step`). Over 1000 oscillations of V1 at a tolerance of 1e-4 the energy stays within 1.3e-3, which
is the ripple, and two steps are refused. What remains: each collision that takes a shorter step than
all before changes the energy once, by the ripple's size, and the steps after it are as short.

With noise no step is repeated for what came out of it: that would select the noise, and bias it. The
first step is chosen before: it is tried with all noise at plus or minus one standard deviation. The
correction would take out as much energy as weak damping puts in (at A = 0.1 and dt = 0.2 a variance of
0.88 instead of 1): with noise c = 1 - e^{-z}, and what is left, a variance off by dt^2/11 of the
curvature of the potential, is kept below 1 % by a second bound on the step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import for_each, kernel
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces
from ellipsoid_coupling.particles.collisions import Cloud, collision_step
from ellipsoid_coupling.particles.frozen import frozen_block, frozen_row
from ellipsoid_coupling.particles.local_error import largest_error, squared_errors
from ellipsoid_coupling.particles.predict_correct import Trial, accept_step, predict_step
from ellipsoid_coupling.particles.state import (
    Limits,
    ParticleState,
    Rates,
    all_finite,
    largest_forces,
    noise_rows,
    note_forces,
)
from ellipsoid_coupling.stepping.status import NOT_FINITE, RUNNING
from ellipsoid_coupling.stepping.step_control import (
    COLLISION,
    NEXT_STEP,
    STATUS,
    STEPS,
    TIME,
    accept,
    equal_steps,
    held_step,
    reject,
    shorten,
    step_factor,
)

Floats = NDArray[np.float64]

ORDER = 2
NOISE_PER_STEP = 2


@kernel
def _try_step(
    state: ParticleState,
    k: int,
    noise: Floats | None,
    drift: Drift,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> tuple[float, int]:
    """Predict and evaluate; returns the error estimate over the tolerance, and its kind."""
    predict_step(state, k, noise, rates, limits, trial, dt)
    frozen = frozen_row(state.frozen, k)
    particle_forces(drift, state.clock[k, TIME] + dt, trial.place, trial.force, frozen)
    squares = np.empty((2, state.place.shape[1]))
    squared_errors(state, k, rates, limits, trial, dt, squares)
    return largest_error(squares, limits.tolerance)


@kernel
def _may_repeat(noise: Floats | None) -> bool:
    """Repeating a noisy step would select the noise by its outcome."""
    return noise is None


@kernel
def next_step(clock: Floats, noise: Floats | None, rates: Rates, dt: float, error: float) -> float:
    """The step to plan after one of dt: held where there is neither noise nor damping."""
    if noise is None and rates.damping.max() == 0.0:
        return float(held_step(clock, dt, error))
    return float(dt * step_factor(error))


@kernel
def see_collisions(clock: Floats, cloud: Cloud, rates: Rates, limits: Limits, until: float) -> None:
    """Plan a shorter step where particles would pass one another unseen."""
    dt = min(clock[NEXT_STEP], until - clock[TIME])
    allowed = collision_step(cloud, rates, limits, dt)
    if allowed < dt:
        shorten(clock, until, allowed, COLLISION)


@kernel
def typical_noise(noise: Floats) -> None:
    """Fill noise (2 n, N) with plus and minus one: standard deviations, whatever will be drawn."""
    for row in range(noise.shape[0]):
        for i in range(noise.shape[1]):
            noise[row, i] = 1.0 if (i + row // 2) % 2 == 0 else -1.0


@kernel
def _choose_first_step(
    noise: Floats | None,
    state: ParticleState,
    k: int,
    drift: Drift,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    until: float,
) -> None:
    """With noise: shorten the step that is planned until one with typical noise would be accepted."""
    if noise is not None:
        clock, typical = state.clock[k], np.empty(noise.shape[2:])
        typical_noise(typical)
        while clock[STATUS] == RUNNING:
            dt = equal_steps(until - clock[TIME], clock[NEXT_STEP])
            error, kind = _try_step(state, k, typical, drift, rates, limits, trial, dt)
            if error <= 1.0:
                return
            reject(clock, until, dt * step_factor(error), kind)


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
    one = slice(k, k + 1)
    cloud = Cloud(
        state.place[one], state.velocity[one], state.force[one], frozen_block(state.frozen, k)
    )
    trial = Trial(np.empty(state.place[k].shape), np.empty(state.place[k].shape))
    if clock[STEPS] == 0.0 and clock[TIME] < until:
        frozen = frozen_row(state.frozen, k)
        particle_forces(drift, clock[TIME], state.place[k], state.force[k], frozen)
        note_forces(clock, *largest_forces(state.force[k]))
        _choose_first_step(state.noise, state, k, drift, rates, limits, trial, until)
    for step in range(steps):
        if until - clock[TIME] <= 0.0 or clock[STATUS] != RUNNING:
            return
        see_collisions(clock, cloud, rates, limits, until)
        if clock[STATUS] != RUNNING:
            return
        dt = equal_steps(until - clock[TIME], clock[NEXT_STEP])
        noise = noise_rows(state.noise, k, step)
        error, kind = _try_step(state, k, noise, drift, rates, limits, trial, dt)
        if not error <= 1.0 and _may_repeat(state.noise):
            reject(clock, until, dt * step_factor(error), kind)
            continue
        accept_step(state, k, noise, rates, limits, trial, dt)
        accept(clock, until, dt, next_step(clock, noise, rates, dt, error), kind)
        note_forces(clock, *largest_forces(state.force[k]))
        if not all_finite(state.velocity[k]):
            clock[STATUS] = NOT_FINITE


def advance(
    state: ParticleState, drift: Drift, rates: Rates, limits: Limits, until: float, steps: int
) -> None:
    """Move every realisation by at most `steps` trial steps, in place and never beyond `until`."""
    for_each(
        state.place.shape[0],
        lambda k: _advance_one(state, k, drift, rates, limits, until, steps),
    )
