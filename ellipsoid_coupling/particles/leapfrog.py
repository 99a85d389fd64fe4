"""Stepper `paper`: first-order leapfrog with Euler-Maruyama noise.

    v_{n+1} = v_n + dt (F(t_n, r_n, theta_n) - Gamma v_n) + A sqrt(dt) xi
    r_{n+1} = r_n + dt v_{n+1}

and the same for theta and omega. Explicit in the damping, so stable only for dt Gamma < 2; the
velocity's equilibrium variance is 1/(1 - dt Gamma/2) of the exact one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.jitable import jitable
from ellipsoid_coupling.particles.at_edges import feed, straight_at_edges
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
from ellipsoid_coupling.particles.forces import BlockForces
from ellipsoid_coupling.particles.frozen import freeze, positions_before
from ellipsoid_coupling.particles.own_clock import own_clock
from ellipsoid_coupling.particles.state import (
    Limits,
    ParticleState,
    Rates,
    bounce,
    noise_rows,
    wrap_positions,
)
from ellipsoid_coupling.stepping.status import RUNNING
from ellipsoid_coupling.stepping.step_control import GIVEN, STATUS, TIME, accept, equal_steps

Floats = NDArray[np.float64]


@kernel
def _kick(velocity: Floats, force: Floats, rates: Rates, dt: float) -> None:
    for d in range(velocity.shape[0]):
        for i in range(velocity.shape[1]):
            # Gamma v of the old velocity, as the paper has it; hence the bound on dt in the module.
            velocity[d, i] += dt * (force[d, i] - rates.damping[d] * velocity[d, i])


@kernel
def _add_noise(velocity: Floats, noise: Floats | None, rates: Rates, dt: float) -> None:
    if noise is not None:
        for d in range(rates.first_noisy, rates.last_noisy):
            # Noise has rows for noisy degrees of freedom only, from `first_noisy` on.
            size = rates.amplitude[d] * math.sqrt(dt)
            for i in range(velocity.shape[1]):
                velocity[d, i] += size * noise[d - rates.first_noisy, i]


@kernel
def _move(position: Floats, velocity: Floats, dt: float) -> None:
    for d in range(position.shape[0]):
        for i in range(position.shape[1]):
            # By the new velocity: both by old ones would be Euler's rule, which gains energy.
            position[d, i] += dt * velocity[d, i]


@kernel
def leap_block(k: int, work: Work, step: int, t: float, dt: float) -> None:
    """Step number `step` of block k, in place, from the time t.

    Sets the drift first, unless that of all blocks is there already, since they act on each other.
    """
    if not work.interacts:
        set_block(k, work, t)
    # Before particles are frozen, which sets their forces to 0.
    note_block_forces(k, work)
    state, rates, limits = work.state, work.rates, work.limits
    position, velocity = state.position[k], state.velocity[k]
    # The ways from here tell who leaves the mesh and who meets an edge.
    before = positions_before(limits.mesh, position)
    start = positions_before(limits.edges, position)
    _kick(velocity, state.force[k], rates, dt)
    _add_noise(velocity, noise_rows(state.noise, k, step), rates, dt)
    _move(position, velocity, dt)
    bounce(limits.box, position, velocity)
    straight_at_edges(limits.edges, state, k, start, (t, dt))
    # Those that are born within the step have moved with the fluid: not once more with the others.
    feed(state, k, limits, t + dt)
    # Before positions are wrapped, which breaks the straight way from `before`.
    freeze(state, k, limits, before)
    wrap_positions(limits.periods, position)
    # Of the position: it is not finite as soon as the velocity is not.
    note_block_finite(k, work, position)


@jitable
def advance_clock(group: Group, until: float, steps: int) -> None:
    """See `clocks.Stepper`."""
    work = group.work
    state, longest = work.state, work.limits.step
    clock = state.clock[0]
    for step in range(steps):
        t = clock[TIME]
        if until - t <= 0.0 or clock[STATUS] != RUNNING:
            return
        # Equal ones, so that no sliver is left before a save time.
        dt = equal_steps(until - t, longest)
        # Two passes only where blocks act on each other in between; else each block is in cache for both.
        if work.interacts:
            over_blocks(group, set_block, (t,))
            interact(group, t, state.position, state.force)
        over_blocks(group, leap_block, (step, t, dt))
        accept(clock, until, dt, longest, GIVEN)
        note_outcome(clock, work.outcome)


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
    advance_clock(own_clock(k, state, forces, rates, limits, 0), until, steps)


STEPPER = Stepper(advance_clock, _advance_own, order=1, noise_per_step=1, tries=False)
