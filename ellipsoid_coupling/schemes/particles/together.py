"""The particle schemes for samples of one density, which all take the same steps.

The force on a sample is that of all samples' density at the same time, so that blocks of samples (the
realisations of the microscopic model) cannot run ahead of one another. Each step is cut into the
parts of `leapfrog` and `exponential`, with one evaluation of the force on all samples in between;
what acts on each sample by itself is evaluated block by block with the rest of the step, while the
block is in cache. Steps and noise are otherwise those of `microscopic`: one block without interaction
gives its bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.cells import Sources
from ellipsoid_coupling.interaction.drift import Drift, particle_forces
from ellipsoid_coupling.interaction.ghost_forces import add_ghost_forces
from ellipsoid_coupling.interaction.kept import KeptArrays
from ellipsoid_coupling.interaction.pairs import Pairs
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
from ellipsoid_coupling.schemes.particles.state import (
    Limits,
    ParticleState,
    Rates,
    all_finite,
    noise_rows,
)
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
Indices = NDArray[np.int64]

# Blocks are handed to the threads in this many tasks at most, each of so many samples at least: fewer
# take no longer than handing them out does. Steps in a drift that is known take less than drifts do.
_TASKS = 32
_LEAST_DRIFTS, _LEAST_STEPS = 4000, 16_000


class Alone(NamedTuple):
    """What acts on each sample by itself.

    drift : without pairs; pairs : of samples with ghost particles of walls, where there are any.
    """

    drift: Drift
    pairs: Pairs | None


class Forces(NamedTuple):
    """The drift of all samples.

    Attributes
    ----------
    alone : Alone or None
    together : (place, force) -> int, or None
        Adds what they do to each other to the drift (K, D, B) at `place`; overwrites it where `alone`
        is None. Returns how many samples it finds outside the flow. None without interaction.
    room : KeptArrays
        Memory for a step's work arrays, kept from call to call.
    """

    alone: Alone | None
    together: Callable[[Floats, Floats], int] | None
    room: KeptArrays


class Stepper(Protocol):
    """Moves all samples by at most `steps` steps, in place and never beyond `until`.

    The state's clock has one row.
    """

    def __call__(
        self,
        state: ParticleState,
        forces: Forces,
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


def over_blocks(
    place: Floats, task: Callable[[int, int], None], least: int = _LEAST_DRIFTS
) -> None:
    """Run task(first, end) on parts of the range of blocks of `place`, which together are all of it.

    Parts hold `least` samples at least.
    """
    blocks, _, size = place.shape
    parts = shares(blocks, min(_TASKS, max(1, blocks * size // least)))
    for_each(len(parts), lambda k: task(*parts[k]))


@kernel
def _set_alone(alone: Alone | None, place: Floats, force: Floats) -> int:
    """Overwrite the drift (D, B) of one block; returns how many samples lie outside the flow."""
    if alone is None:
        return 0
    outside = particle_forces(alone.drift, place, force)
    _add_walls(alone.pairs, place, force)
    return outside


@kernel
def _add_walls(pairs: Pairs | None, place: Floats, force: Floats) -> None:
    if pairs is not None:
        _add_ghosts(pairs.ghosts, pairs, place, force)


@kernel
def _add_ghosts(ghosts: Sources | None, pairs: Pairs, place: Floats, force: Floats) -> None:
    if ghosts is not None:
        add_ghost_forces(place, ghosts, pairs, force)


@kernel
def _set_blocks(
    alone: Alone | None, place: Floats, force: Floats, outside: Indices, blocks: tuple[int, int]
) -> None:
    for k in range(blocks[0], blocks[1]):
        outside[k] = _set_alone(alone, place[k], force[k])


def set_forces(forces: Forces, place: Floats, force: Floats) -> int:
    """Set the drift (K, D, B) at `place`; returns how many samples lie outside the flow."""
    outside = np.zeros(place.shape[0], np.int64)
    if forces.alone is not None:
        over_blocks(place, lambda a, b: _set_blocks(forces.alone, place, force, outside, (a, b)))
    shared = 0 if forces.together is None else forces.together(place, force)
    return int(outside.sum()) + shared


@kernel
def _move(
    state: ParticleState,
    blocks: tuple[int, int],
    step: int,
    rates: Rates,
    limits: Limits,
    dt: float,
    finite: NDArray[np.bool_],
) -> None:
    for k in range(blocks[0], blocks[1]):
        leapfrog.move(state, k, step, rates, limits, dt)
        finite[k] = all_finite(state.velocity[k])


@kernel
def _trial_of(trial: Trial, k: int) -> Trial:
    return Trial(trial.place[k], trial.folded[k], trial.sign[k], trial.force[k])


class _Found(NamedTuple):
    """What is evaluated at a prediction: `alone`, and where to write how it turned out.

    outside : (K,), samples outside the flow; squares : (K, D) squared errors, None where more follows.
    """

    alone: Alone | None
    outside: Indices
    squares: Floats | None


@kernel
def _predict(
    state: ParticleState,
    blocks: tuple[int, int],
    step: int,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
    found: _Found,
) -> None:
    """Predictions and what acts on each sample there by itself; errors too, if that is all."""
    for k in range(blocks[0], blocks[1]):
        _predict_block(state, k, step, rates, limits, trial, dt, found)


@kernel
def _predict_block(
    state: ParticleState,
    k: int,
    step: int,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
    found: _Found | None,
) -> None:
    if found is not None:
        noise, here = noise_rows(state.noise, k, step), _trial_of(trial, k)
        predict_step(state, k, noise, rates, limits, here, dt)
        found.outside[k] = _set_alone(found.alone, here.folded, here.force)
        _measure_one(found.squares, state, k, rates, limits, here, dt)


@kernel
def _measure_one(
    squares: Floats | None,
    state: ParticleState,
    k: int,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
) -> None:
    if squares is not None:
        squared_errors(state, k, rates, limits, trial, dt, squares[k])


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
    steps: tuple[float, float],
    finite: NDArray[np.bool_],
    ahead: _Found | None,
) -> None:
    """Finish a step and, with `ahead`, predict the next one, block by block: both are `steps` long."""
    dt, next_dt = steps
    for k in range(blocks[0], blocks[1]):
        noise = noise_rows(state.noise, k, step)
        accept_step(state, k, noise, rates, limits, _trial_of(trial, k), dt)
        finite[k] = all_finite(state.velocity[k])
        _predict_block(state, k, step + 1, rates, limits, trial, next_dt, ahead)


def _move_all(state: ParticleState, step: int, rates: Rates, limits: Limits, dt: float) -> bool:
    """One leapfrog step of all blocks in the drift `state.force`; whether all is finite then."""
    finite = np.ones(state.place.shape[0], np.bool_)

    def move(first: int, end: int) -> None:
        _move(state, (first, end), step, rates, limits, dt, finite)

    over_blocks(state.place, move, _LEAST_STEPS)
    return bool(finite.all())


def advance_leapfrog(
    state: ParticleState,
    forces: Forces,
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
        clock[OUTSIDE] = set_forces(forces, state.place, state.force)
        finite = _move_all(state, step, rates, limits, dt)
        accept(clock, until, dt, limits.step, GIVEN)
        if not finite:
            clock[STATUS] = NOT_FINITE


class _Exponential:
    """One call of the scheme `accurate`: its work arrays and the parts of a step."""

    def __init__(self, state: ParticleState, forces: Forces, rates: Rates, limits: Limits) -> None:
        self.state, self.forces, self.rates, self.limits = state, forces, rates, limits
        shape = state.place.shape
        work = forces.room.array("trial", (len(Trial._fields), *shape), np.float64)
        self.trial = Trial(*work)
        # Where no wall is, nothing else is written there.
        self.trial.sign[:] = 1.0
        self.squares = np.empty(shape[:2])
        self.finite = np.ones(shape[0], np.bool_)
        squares = self.squares if forces.together is None else None
        self.found = _Found(forces.alone, np.zeros(shape[0], np.int64), squares)

    def predict(self, step: int, dt: float) -> None:
        """Where the step leads for a constant drift, and the drift of each sample by itself there."""
        state, common = self.state, (self.rates, self.limits, self.trial, dt)
        over_blocks(state.place, lambda a, b: _predict(state, (a, b), step, *common, self.found))

    def examine(self, dt: float) -> tuple[float, int]:
        """The drift at what is predicted; the error estimate over the tolerance, and its kind."""
        state, trial, squares = self.state, self.trial, self.squares
        outside = int(self.found.outside.sum())
        if self.forces.together is not None:
            common = self.rates, self.limits, trial, dt
            outside += self.forces.together(trial.folded, trial.force)
            over_blocks(
                state.place, lambda a, b: _measure(state, (a, b), *common, squares), _LEAST_STEPS
            )
        state.clock[0, OUTSIDE] = outside
        return largest_error(squares.mean(axis=0), self.limits.tolerance)

    def accept(self, step: int, dt: float, next_dt: float) -> None:
        """Finish the step that was examined; predict the next one, unless `next_dt` is 0."""
        state, common = self.state, (self.rates, self.limits, self.trial)
        ahead = self.found if next_dt > 0.0 else None
        over_blocks(
            state.place,
            lambda a, b: _accept(state, (a, b), step, *common, (dt, next_dt), self.finite, ahead),
            _LEAST_STEPS if ahead is None else _LEAST_DRIFTS,
        )
        if not self.finite.all():
            state.clock[0, STATUS] = NOT_FINITE


def advance_exponential(
    state: ParticleState,
    forces: Forces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """`Stepper` of the scheme `accurate`; the error estimate is the root mean square of all.

    Finishing a step and predicting the next one is one pass over memory.
    """
    clock = state.clock[0]
    parts = _Exponential(state, forces, rates, limits)
    if clock[STEPS] == 0.0:
        clock[OUTSIDE] = set_forces(forces, state.place, state.force)
    dt, predicted = _next_step(clock, until), False
    for step in range(steps):
        if dt == 0.0 or clock[STATUS] != RUNNING:
            return
        if not predicted:
            parts.predict(step, dt)
        error, kind = parts.examine(dt)
        planned = dt * step_factor(error)
        predicted = bool(error <= 1.0) or state.noise is not None
        if predicted:
            taken = dt
            accept(clock, until, dt, planned, kind)
            dt = _next_step(clock, until)
            predicted = step + 1 < steps
            parts.accept(step, taken, dt if predicted else 0.0)
        else:
            reject(clock, until, planned, kind)
            dt = _next_step(clock, until)


def _next_step(clock: Floats, until: float) -> float:
    """The step to try next; 0 where the end is reached."""
    remaining = float(until - clock[TIME])
    return float(equal_steps(remaining, clock[NEXT_STEP])) if remaining > 0.0 else 0.0


TOGETHER = {
    "paper": Together(advance_leapfrog, leapfrog.ORDER, leapfrog.NOISE_PER_STEP),
    "accurate": Together(advance_exponential, exponential.ORDER, exponential.NOISE_PER_STEP),
}
