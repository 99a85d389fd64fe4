"""Stepper `accurate`: second order, the linear part (drag, damping, noise) integrated exactly.

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
c = 0, which is velocity Verlet, time-reversible, and keeps the energy but for a ripple of order dt^2. Drag
so weak that z < 0.0003 takes out less than the correction would: there c = 1 - e^{-z} as well. Any change
of the step breaks that, so with so little drag and without noise the step is held: it halves and doubles
only when the tolerance asks for it and allows it, and ever more seldom (`held_step`). Over 1000
oscillations of V1 at a tolerance of 1e-4 the energy stays within 2.5e-3, which is the ripple, and its
mean moves by 1e-6. A swing into a wall of strength 1e6 and back at a tolerance of 1e-8 takes 2200 steps
and changes the energy by 2e-6 of 0.32: the changes on the way in and on the way out nearly cancel.

With noise no step is repeated for what came out of it: that would select the noise, and bias it. The
first step is chosen before: it is tried with all noise at plus or minus one standard deviation. The
correction would take out as much energy as weak damping puts in (at A = 0.1 and dt = 0.2 a variance of
0.88 instead of 1): with noise c = 1 - e^{-z}, and what is left, a variance off by dt^2/11 of the
curvature of the potential, is kept below 1 % by a second bound on the step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.jitable import jitable
from ellipsoid_coupling.particles.clocks import (
    Group,
    Stepper,
    Work,
    interact,
    note_block_finite,
    note_block_forces,
    note_outcome,
    over_blocks,
    set_block,
)
from ellipsoid_coupling.particles.collisions import Cloud, collision_step
from ellipsoid_coupling.particles.fates import part_inside
from ellipsoid_coupling.particles.forces import BlockForces, set_block_forces
from ellipsoid_coupling.particles.frozen import frozen_row
from ellipsoid_coupling.particles.linear import HARDLY_DAMPED
from ellipsoid_coupling.particles.local_error import largest_error, squared_errors
from ellipsoid_coupling.particles.own_clock import own_clock
from ellipsoid_coupling.particles.predict_correct import accept_step, predict_step
from ellipsoid_coupling.particles.state import (
    BlockStep,
    Limits,
    ParticleState,
    Rates,
    Trial,
    largest_forces,
    noise_rows,
    note_forces,
)
from ellipsoid_coupling.stepping.status import RUNNING
from ellipsoid_coupling.stepping.step_control import (
    COLLISION,
    NEXT_STEP,
    STATUS,
    STEPS,
    TIME,
    accept,
    equal_steps,
    halved_step,
    held_step,
    reject,
    shorten,
    step_factor,
)

Floats = NDArray[np.float64]


@kernel
def _trial_of(trial: Trial, k: int) -> Trial:
    return Trial(trial.position[k], trial.force[k])


@kernel
def step_block(
    k: int, work: Work, noise: Floats | None, step: int, dt: float, next_dt: float, t: float
) -> None:
    """Finish step number `step` of block k, dt long, and try the next one, which ends at the time t.

    Both in one pass, while the block is in cache. A length of 0 leaves its part out. The trial's errors
    are measured here as well, unless the drift still lacks what blocks do to each other.

    noise : (K, steps, components, B); row `step` finishes the step, the next one is for the trial.
    """
    state, rates, limits = work.state, work.rates, work.limits
    trial = _trial_of(work.trial, k)
    if dt > 0.0:
        taken = BlockStep(state, k, noise_rows(noise, k, step), rates, trial, dt)
        accept_step(taken, limits)
        note_block_forces(k, work)
        note_block_finite(k, work, state.velocity[k])
    if next_dt > 0.0:
        tried = BlockStep(state, k, noise_rows(noise, k, step + 1), rates, trial, next_dt)
        predict_step(tried, limits)
        frozen = frozen_row(state.frozen, k)
        set_block_forces(work.forces, t, trial.position, trial.force, frozen)
        if not work.interacts:
            # While force and later force of the block are in cache.
            measure_block(k, work, next_dt)


@kernel
def measure_block(k: int, work: Work, dt: float) -> None:
    """The squared errors of the trial of block k."""
    trial, squares = _trial_of(work.trial, k), work.outcome.squares[k]
    squared_errors(work.state, k, work.rates, work.limits, trial, dt, squares)


@jitable
def _examine(group: Group, t: float, dt: float) -> tuple[float, int]:
    """Complete the drift at the trial, at the time t; its error over the tolerance, and the kind."""
    if group.work.interacts:
        interact(group, t, group.work.trial.position, group.work.trial.force)
        over_blocks(group, measure_block, (dt,))
    # Those that have ended err by 0, which must not make the mean of the others smaller.
    part = part_inside(group.work.state.fates)
    return largest_error(group.work.outcome.squares, group.work.limits.tolerance, part)


@kernel
def _is_held(noise: Floats | None, rates: Rates, dt: float) -> bool:
    """Whether hardly anything but changes of the step changes the energy."""
    return noise is None and rates.damping.max() * dt < HARDLY_DAMPED


@kernel
def _next_step(clock: Floats, noise: Floats | None, rates: Rates, dt: float, error: float) -> float:
    """The step to plan after one of dt that was taken."""
    if _is_held(noise, rates, dt):
        return float(held_step(clock, dt, error))
    return float(dt * step_factor(error))


@kernel
def _shorter_step(rates: Rates, dt: float, error: float) -> float:
    """The step to plan after one of dt that was refused, which none with noise is."""
    if _is_held(None, rates, dt):
        return float(halved_step(dt, error))
    return float(dt * step_factor(error))


@kernel
def _step_to_try(clock: Floats, cloud: Cloud, rates: Rates, limits: Limits, until: float) -> float:
    """The length of the next step; 0 where the end is reached or the run has come to one.

    Shorter than planned where particles would pass one another unseen.
    """
    if until - clock[TIME] <= 0.0 or clock[STATUS] != RUNNING:
        return 0.0
    dt = min(clock[NEXT_STEP], until - clock[TIME])
    # Of the step as it would be taken, which the save time may have made shorter than planned.
    allowed = collision_step(cloud, rates, limits, dt)
    if allowed < dt:
        shorten(clock, until, allowed, COLLISION)
    return float(equal_steps(until - clock[TIME], clock[NEXT_STEP]))


@kernel
def _typical_noise(noise: Floats) -> Floats:
    """One step of noise (K, 1, components, B) of plus and minus one: standard deviations.

    It does not depend on the noise that will be drawn, so that choosing a step by it prefers no outcome.
    """
    blocks, _, components, size = noise.shape
    typical = np.empty((blocks, 1, components, size))
    for k in range(blocks):
        for row in range(components):
            for i in range(size):
                # Both numbers of a component have one sign: real displacements and velocities go
                # together, too. Neighbours have opposite ones, so that the cloud is not shifted.
                typical[k, 0, row, i] = 1.0 if (i + row // 2) % 2 == 0 else -1.0
    return typical


@kernel
def _note_start(clock: Floats, force: Floats) -> None:
    """Keep the largest forces (K, D, B) before the first step."""
    for k in range(force.shape[0]):
        force_size, torque = largest_forces(force[k])
        note_forces(clock, force_size, torque)


@jitable
def _start(group: Group) -> None:
    """The drift before the first step."""
    state = group.work.state
    clock = state.clock[0]
    over_blocks(group, set_block, (clock[TIME],))
    interact(group, clock[TIME], state.position, state.force)
    _note_start(clock, state.force)


@jitable
def _choose_first_step(noise: Floats | None, group: Group, until: float) -> None:
    """With noise: shorten the step that is planned until one with typical noise would be accepted."""
    if noise is not None:
        clock, typical = group.work.state.clock[0], _typical_noise(noise)
        while clock[STATUS] == RUNNING:
            dt = equal_steps(until - clock[TIME], clock[NEXT_STEP])
            t = clock[TIME] + dt
            # Row -1 + 1 is the only one of `typical`; a length of 0 finishes no step.
            over_blocks(group, step_block, (typical, -1, 0.0, dt, t))
            error, kind = _examine(group, t, dt)
            if error <= 1.0:
                return
            reject(clock, until, dt * step_factor(error), kind)


@jitable
def advance_clock(group: Group, until: float, steps: int) -> None:
    """See `clocks.Stepper`; trials that are refused count as steps."""
    state, rates, limits = group.work.state, group.work.rates, group.work.limits
    clock, noise, outcome = state.clock[0], state.noise, group.work.outcome
    cloud = Cloud(state.position, state.velocity, state.force, state.frozen, state.fates)
    # Later the force there is known from the step before, and after `restore` from the checkpoint.
    if clock[STEPS] == 0.0 and clock[TIME] < until:
        _start(group)
        _choose_first_step(noise, group, until)
    # The length of a trial that was made together with the end of the step before it; 0 if there is none.
    tried = 0.0
    for step in range(steps):
        dt = tried
        if tried == 0.0:
            dt = _step_to_try(clock, cloud, rates, limits, until)
        # A trial may be there although the run has failed meanwhile: in the pass that made it.
        if dt == 0.0 or clock[STATUS] != RUNNING:
            return
        if tried == 0.0:
            # A trial takes the row after the one that is named.
            over_blocks(group, step_block, (noise, step - 1, 0.0, dt, clock[TIME] + dt))
        error, kind = _examine(group, clock[TIME] + dt, dt)
        tried = 0.0
        # A noisy step is never repeated: that would select the noise by its outcome.
        if error <= 1.0 or noise is not None:
            # Time goes on first: who ends or is born in the step asks the clock for the step's end.
            accept(clock, until, dt, _next_step(clock, noise, rates, dt, error), kind)
            # Who may meet in the next step is seen from where this one ends, so that one pass over
            # memory can do both only where nobody meets.
            if limits.contact is None and step + 1 < steps:
                tried = _step_to_try(clock, cloud, rates, limits, until)
            over_blocks(group, step_block, (noise, step, dt, tried, clock[TIME] + tried))
            note_outcome(clock, outcome)
        else:
            reject(clock, until, _shorter_step(rates, dt, error), kind)


@kernel
def _advance_own(
    k: int,
    state: ParticleState,
    forces: BlockForces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    advance_clock(own_clock(k, state, forces, rates, limits, 1), until, steps)


STEPPER = Stepper(advance_clock, _advance_own, order=2, noise_per_step=2, tries=True)
