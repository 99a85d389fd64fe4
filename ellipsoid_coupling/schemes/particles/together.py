"""The particle schemes for samples of one density, which all take the same steps.

The force on a sample is that of all samples' density at the same time, so that blocks of samples (the
realisations of the microscopic model) cannot run ahead of one another. Each step is cut into the
parts of `leapfrog` and `exponential`, with one evaluation of the force on all samples in between.
Steps and noise are otherwise those of `microscopic`: one block without interaction gives its bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import for_each, kernel, shares
from ellipsoid_coupling.schemes.particles import exponential, leapfrog
from ellipsoid_coupling.schemes.particles.exponential import (
    Trial,
    accept_step,
    largest_error,
    predict_step,
    squared_errors,
    step_factor,
)
from ellipsoid_coupling.schemes.particles.state import Limits, ParticleState, Rates, noise_rows
from ellipsoid_coupling.schemes.status import NOT_FINITE, RUNNING
from ellipsoid_coupling.schemes.step_control import (
    GIVEN,
    NEXT_STEP,
    OUTSIDE,
    STATUS,
    STEPS,
    TIME,
    accept,
    equal_steps,
    reject,
)

Floats = NDArray[np.float64]
SetForces = Callable[[Floats, Floats], int]

# Blocks are handed to the threads in this many tasks at most, each of so many samples at least: fewer
# take no longer than handing them out does.
_TASKS = 32
_LEAST_PER_TASK = 4000


class Stepper(Protocol):
    """Moves all samples by at most `steps` steps, in place and never beyond `until`.

    `set_forces(place, force)` overwrites the drift (K, D, B) at `place` and returns how many samples
    lie outside the flow; the state's clock has one row.
    """

    def __call__(
        self,
        state: ParticleState,
        set_forces: SetForces,
        rates: Rates,
        limits: Limits,
        until: float,
        steps: int,
    ) -> None:
        """Step."""
        ...


class Together(NamedTuple):
    """A scheme: its stepper, its order and its Gaussian numbers a step and degree of freedom."""

    advance: Stepper
    order: int
    noise_per_step: int


def over_blocks(place: Floats, task: Callable[[int, int], None]) -> None:
    """Run task(first, end) on parts of the range of blocks of `place`, which together are all of it."""
    blocks, _, size = place.shape
    parts = shares(blocks, min(_TASKS, max(1, blocks * size // _LEAST_PER_TASK)))
    for_each(len(parts), lambda k: task(*parts[k]))


@kernel
def _move(
    state: ParticleState,
    blocks: tuple[int, int],
    step: int,
    rates: Rates,
    limits: Limits,
    dt: float,
) -> None:
    for k in range(blocks[0], blocks[1]):
        leapfrog.move(state, k, step, rates, limits, dt)


@kernel
def _trial_of(trial: Trial, k: int) -> Trial:
    return Trial(trial.place[k], trial.folded[k], trial.sign[k], trial.force[k])


@kernel
def _predict(
    state: ParticleState,
    blocks: tuple[int, int],
    step: int,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> None:
    for k in range(blocks[0], blocks[1]):
        noise = noise_rows(state.noise, k, step)
        predict_step(state, k, noise, rates, limits, _trial_of(trial, k), dt)


@kernel
def _measure(
    state: ParticleState,
    blocks: tuple[int, int],
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
    squares: Floats,
) -> None:
    for k in range(blocks[0], blocks[1]):
        squared_errors(state, k, rates, limits, _trial_of(trial, k), dt, squares[k])


@kernel
def _accept(
    state: ParticleState,
    blocks: tuple[int, int],
    step: int,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> None:
    for k in range(blocks[0], blocks[1]):
        noise = noise_rows(state.noise, k, step)
        accept_step(state, k, noise, rates, limits, _trial_of(trial, k), dt)


def _check_finite(state: ParticleState) -> None:
    if not np.isfinite(state.velocity).all():
        state.clock[0, STATUS] = NOT_FINITE


def _move_all(state: ParticleState, step: int, rates: Rates, limits: Limits, dt: float) -> None:
    """One leapfrog step of all blocks in the drift `state.force`."""

    def move(first: int, end: int) -> None:
        _move(state, (first, end), step, rates, limits, dt)

    over_blocks(state.place, move)


def advance_leapfrog(
    state: ParticleState,
    set_forces: SetForces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """`Stepper` of the scheme `paper`."""
    clock = state.clock[0]
    for step in range(steps):
        remaining = until - clock[TIME]
        if remaining <= 0.0 or clock[STATUS] != RUNNING:
            return
        dt = equal_steps(remaining, limits.step)
        clock[OUTSIDE] = set_forces(state.place, state.force)
        _move_all(state, step, rates, limits, dt)
        accept(clock, until, dt, limits.step, GIVEN)
        _check_finite(state)


class _Exponential:
    """One call of the scheme `accurate`: its work arrays and the parts of a step."""

    def __init__(
        self, state: ParticleState, set_forces: SetForces, rates: Rates, limits: Limits
    ) -> None:
        self.state, self.set_forces, self.rates, self.limits = state, set_forces, rates, limits
        shape = state.place.shape
        self.trial = Trial(np.empty(shape), np.empty(shape), np.ones(shape), np.empty(shape))
        self.squares = np.empty(shape[:2])

    def try_step(self, step: int, dt: float) -> tuple[float, int]:
        """Predict and evaluate; returns the error estimate over the tolerance, and its kind."""
        state, rates, limits, trial = self.state, self.rates, self.limits, self.trial
        place = state.place
        over_blocks(place, lambda a, b: _predict(state, (a, b), step, rates, limits, trial, dt))
        state.clock[0, OUTSIDE] = self.set_forces(trial.folded, trial.force)
        over_blocks(
            place,
            lambda a, b: _measure(state, (a, b), rates, limits, trial, dt, self.squares),
        )
        return largest_error(self.squares.mean(axis=0), limits.tolerance)

    def accept(self, step: int, dt: float) -> None:
        """Finish the step that was tried."""
        state, rates, limits, trial = self.state, self.rates, self.limits, self.trial
        over_blocks(
            state.place,
            lambda a, b: _accept(state, (a, b), step, rates, limits, trial, dt),
        )


def advance_exponential(
    state: ParticleState,
    set_forces: SetForces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """`Stepper` of the scheme `accurate`; the error estimate is the root mean square of all."""
    clock = state.clock[0]
    parts = _Exponential(state, set_forces, rates, limits)
    if clock[STEPS] == 0.0:
        clock[OUTSIDE] = set_forces(state.place, state.force)
    for step in range(steps):
        remaining = until - clock[TIME]
        if remaining <= 0.0 or clock[STATUS] != RUNNING:
            return
        dt = equal_steps(remaining, clock[NEXT_STEP])
        error, kind = parts.try_step(step, dt)
        planned = dt * step_factor(error)
        if not error <= 1.0 and state.noise is None:
            reject(clock, until, planned, kind)
            continue
        parts.accept(step, dt)
        accept(clock, until, dt, planned, kind)
        _check_finite(state)


TOGETHER = {
    "paper": Together(advance_leapfrog, leapfrog.ORDER, leapfrog.NOISE_PER_STEP),
    "accurate": Together(advance_exponential, exponential.ORDER, exponential.NOISE_PER_STEP),
}
