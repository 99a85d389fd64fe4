"""One step of the scheme `accurate`: predict with a constant drift, correct with its change.

The formulas are those of `exponential`; between the two a caller evaluates the drift. All particles take
the plain formula in loops that vectorise. Those that may come to a wall within the step, few as a rule,
are then done again with their bounces, off a box (`in_box`) or off edges of any shape (`at_edges`). Both
ends are wrapped where sides are periodic: the drift is known in the domain only.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.particles.at_edges import (
    ends_at_edges,
    feed,
    predict_at_edges,
    settle,
)
from ellipsoid_coupling.particles.frozen import freeze, positions_before
from ellipsoid_coupling.particles.in_box import bounces_in_box, predict_in_box, settle_in_box
from ellipsoid_coupling.particles.linear import LinearStep, linear_step, noise_of
from ellipsoid_coupling.particles.state import BlockStep, Limits, Rates, wrap_positions
from ellipsoid_coupling.stepping.step_control import TIME

Floats = NDArray[np.float64]


@kernel
def _predict(step: BlockStep, d: int, linear: LinearStep) -> None:
    """The position at the step's end for a constant drift, before noise."""
    k, trial = step.k, step.trial.position[d]
    position, velocity, force = (
        step.state.position[k, d],
        step.state.velocity[k, d],
        step.state.force[k, d],
    )
    for i in range(position.size):
        # One degree of freedom at a time: its row is contiguous, and its coefficients are the same for all.
        trial[i] = (
            position[i] + linear.position_velocity * velocity[i] + linear.position_force * force[i]
        )


@kernel
def _add_position_noise(
    noise: Floats | None, d: int, rates: Rates, linear: LinearStep, position: Floats
) -> None:
    if noise is not None and rates.first_noisy <= d < rates.last_noisy:
        for i in range(position.size):
            # The drift is wanted where the step leads, noise and all.
            position[i] += noise_of(noise, d, rates, linear, i)[0]


@kernel
def _add_velocity_noise(
    noise: Floats | None, d: int, rates: Rates, linear: LinearStep, velocity: Floats
) -> None:
    if noise is not None and rates.first_noisy <= d < rates.last_noisy:
        for i in range(velocity.size):
            velocity[i] += noise_of(noise, d, rates, linear, i)[1]


@kernel
def _correct(step: BlockStep, d: int, linear: LinearStep) -> None:
    """Finish the step of one degree of freedom, but for noise and walls."""
    k, trial, later = step.k, step.trial.position[d], step.trial.force[d]
    position, velocity, force = (
        step.state.position[k, d],
        step.state.velocity[k, d],
        step.state.force[k, d],
    )
    for i in range(position.size):
        change = later[i] - force[i]
        # The trial has the noise in it already; the correction is linear in the drift's change.
        position[i] = trial[i] + linear.position_change * change
        velocity[i] = (
            linear.decay * velocity[i]
            + linear.velocity_force * force[i]
            + linear.velocity_change * change
        )
        # The drift at the trial stands for that at the new position: one evaluation a step.
        force[i] = later[i]


@kernel
def predict_step(step: BlockStep, limits: Limits) -> None:
    """Where a step of a block leads for a constant drift: its trial but for the force."""
    trial, rates = step.trial, step.rates
    for d in range(len(trial.position)):
        linear = linear_step(rates.damping[d], rates.amplitude[d], step.dt)
        _predict(step, d, linear)
        _add_position_noise(step.noise, d, rates, linear, trial.position[d])
    # After the plain formula, of which those at walls overwrite their own.
    predict_in_box(limits.box, step)
    predict_at_edges(limits.edges, step)
    # Last: edges and walls are met on ways that no side has cut.
    wrap_positions(limits.periods, trial.position)


@kernel
def accept_step(step: BlockStep, limits: Limits) -> None:
    """Finish the step of a block that its trial predicts, in place; its clock is at the step's end."""
    state, k, rates = step.state, step.k, step.rates
    before = positions_before(limits.mesh, state.position[k])
    # The trial is wrapped, the position before is in the domain: the way between them may cross a side.
    _unwrap(limits.periods, before, step)
    # Paths begin with the old position, velocity and force, which `_correct` overwrites.
    ends = ends_at_edges(limits.edges, step)
    for d in range(len(step.trial.position)):
        linear = linear_step(rates.damping[d], rates.amplitude[d], step.dt)
        # Likewise.
        bounces = bounces_in_box(limits.box, step, d, linear)
        _correct(step, d, linear)
        # Not before, for the correction damps the velocity, and W_n is damped already.
        _add_velocity_noise(step.noise, d, rates, linear, state.velocity[k, d])
        # After the noise, which a bounced velocity has in it already, turned round.
        settle_in_box(limits.box, bounces, step, d)
    t = state.clock[0, TIME]
    settle(limits.edges, ends, state, k, t - step.dt)
    feed(state, k, limits, t)
    freeze(state, k, limits, before)
    wrap_positions(limits.periods, state.position[k])


@kernel
def _unwrap(periods: Floats | None, before: Floats | None, step: BlockStep) -> None:
    """Shift the positions before a step by whole periods to where the straight way to the trial began."""
    if periods is not None and before is not None:
        rates = step.rates
        for d in range(2):
            if math.isinf(periods[d, 1]):
                continue
            linear = linear_step(rates.damping[d], rates.amplitude[d], step.dt)
            velocity, force = step.state.velocity[step.k, d], step.state.force[step.k, d]
            for i in range(before.shape[1]):
                moved = linear.position_velocity * velocity[i] + linear.position_force * force[i]
                moved += noise_of(step.noise, d, rates, linear, i)[0]
                before[d, i] = step.trial.position[d, i] - moved
