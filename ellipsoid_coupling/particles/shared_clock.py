"""The particle schemes for samples of one density, which all take the same steps.

The force on a sample is that of all samples' density at the same time, so that blocks of samples (the
realisations of the microscopic model) cannot run ahead of one another. Each step is cut into the
parts of `leapfrog` and `exponential`, with one evaluation of the force on all samples in between
(`blocks`). Steps and noise are otherwise those of `microscopic`: one block without interaction
gives its bits.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.particles import exponential, leapfrog
from ellipsoid_coupling.particles.blocks import (
    Alone,
    Ended,
    Forces,
    add_together,
    all_ended,
    note_all,
    note_block,
    over_blocks,
    set_alone,
    set_forces,
)
from ellipsoid_coupling.particles.collisions import Cloud
from ellipsoid_coupling.particles.exponential import (
    next_step,
    see_collisions,
    typical_noise,
)
from ellipsoid_coupling.particles.frozen import frozen_row
from ellipsoid_coupling.particles.local_error import (
    LARGEST,
    MEAN,
    largest_error,
    squared_errors,
)
from ellipsoid_coupling.particles.predict_correct import Trial, accept_step, predict_step
from ellipsoid_coupling.particles.state import (
    Limits,
    ParticleState,
    Rates,
    largest_forces,
    noise_rows,
    note_forces,
)
from ellipsoid_coupling.stepping.status import RUNNING
from ellipsoid_coupling.stepping.step_control import (
    GIVEN,
    NEXT_STEP,
    OUTSIDE,
    STATUS,
    STEPS,
    TIME,
    accept,
    equal_steps,
    reject,
    step_factor,
)

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


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


@kernel
def _leap(
    k: int,
    state: ParticleState,
    step: int,
    rates: Rates,
    limits: Limits,
    dt: float,
    alone: Alone | None,
    found: tuple[Indices, Ended],
    parts: tuple[bool, bool],
) -> None:
    """The drift of each sample by itself, and a leapfrog step in the whole drift; `parts` of this.

    found : samples outside the flow (K,), and how the step turned out.
    """
    sets, moves = parts
    outside, ended = found
    if sets:
        frozen = frozen_row(state.frozen, k)
        t = state.clock[0, TIME]
        outside[k] = set_alone(alone, t, state.place[k], state.force[k], frozen)
    if moves:
        leapfrog.move(state, k, step, rates, limits, dt)
        note_block(ended, state, k)


@parallel_kernel
def _leap_blocks(blocks: int, arguments: tuple[Any, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        _leap(signed(k), *unpack(packed))


def advance_leapfrog(
    state: ParticleState,
    forces: Forces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """`Stepper` of the scheme `paper`."""
    clock, blocks = state.clock[0], len(state.place)
    found = np.zeros(blocks, np.int64), all_ended(blocks)
    # All at once, unless what samples do to each other comes in between.
    parts = ((True, True),) if forces.together is None else ((True, False), (False, True))
    for step in range(steps):
        remaining = until - clock[TIME]
        if remaining <= 0.0 or clock[STATUS] != RUNNING:
            return
        dt = equal_steps(remaining, limits.step)
        here = state, step, rates, limits, dt, forces.alone, found
        together = 0
        for sets, moves in parts:
            if moves or forces.alone is not None:
                over_blocks(_leap, _leap_blocks, state.place, (*here, (sets, moves)))
            if not moves:
                together = add_together(forces, clock[TIME], state.place, state.force)
        clock[OUTSIDE] = found[0].sum() + together
        accept(clock, until, dt, limits.step, GIVEN)
        note_all(clock, found[1])


@kernel
def _trial_of(trial: Trial, k: int) -> Trial:
    return Trial(trial.place[k], trial.force[k])


class _Found(NamedTuple):
    """What is evaluated at a prediction: `alone`, and where to write how it turned out.

    outside : (K,), samples outside the flow; squares : (K, 2, D) squared errors, None where more follows.
    """

    alone: Alone | None
    outside: Indices
    squares: Floats | None


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
    k: int,
    state: ParticleState,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    dt: float,
    squares: Floats,
) -> None:
    squared_errors(state, k, rates, limits, _trial_of(trial, k), dt, squares[k])


@parallel_kernel
def _measure_blocks(blocks: int, arguments: tuple[Any, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        _measure(signed(k), *unpack(packed))


@kernel
def _step(
    k: int,
    state: ParticleState,
    step: int,
    rates: Rates,
    limits: Limits,
    trial: Trial,
    steps: tuple[float, float],
    ended: Ended,
    found: _Found,
) -> None:
    """Finish step number `step`, and predict the next one.

    And look at what acts on each sample there by itself; errors too, if that is all.

    steps : how long both steps are; 0 for what is not to be done.
    """
    dt, next_dt = steps
    here = _trial_of(trial, k)
    if dt > 0.0:
        accept_step(state, k, noise_rows(state.noise, k, step), rates, limits, here, dt)
        note_block(ended, state, k)
    if next_dt > 0.0:
        noise = noise_rows(state.noise, k, step + 1)
        predict_step(state, k, noise, rates, limits, here, next_dt)
        frozen = frozen_row(state.frozen, k)
        t = state.clock[0, TIME] + next_dt
        found.outside[k] = set_alone(found.alone, t, here.place, here.force, frozen)
        _measure_one(found.squares, state, k, rates, limits, here, next_dt)


@parallel_kernel
def _step_blocks(blocks: int, arguments: tuple[Any, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        _step(signed(k), *unpack(packed))


@kernel
def _worst_of(outside: Indices, squares: Floats, tolerance: float) -> tuple[int, float, int]:
    """Samples outside the flow; the error over the tolerance of all blocks, and its kind."""
    whole = squares[0].copy()
    for k in range(1, squares.shape[0]):
        whole[MEAN] += squares[k, MEAN]
        whole[LARGEST] = np.maximum(whole[LARGEST], squares[k, LARGEST])
    whole[MEAN] /= squares.shape[0]
    error, kind = largest_error(whole, tolerance)
    return outside.sum(), error, kind


class _Exponential:
    """One call of the scheme `accurate`: its work arrays and the parts of a step."""

    def __init__(self, state: ParticleState, forces: Forces, rates: Rates, limits: Limits) -> None:
        self.state, self.forces, self.rates, self.limits = state, forces, rates, limits
        shape = state.place.shape
        work = forces.room.array("trial", (len(Trial._fields), *shape), np.float64)
        self.trial = Trial(*work)
        self.squares = np.empty((shape[0], 2, shape[1]))
        self.ended = all_ended(shape[0])
        squares = self.squares if forces.together is None else None
        self.found = _Found(forces.alone, np.zeros(shape[0], np.int64), squares)

    def start(self) -> None:
        """The drift at the start."""
        state = self.state
        state.clock[0, OUTSIDE] = set_forces(self.forces, state)
        for k in range(len(state.force)):
            note_forces(state.clock[0], *largest_forces(state.force[k]))

    def step(self, step: int, dt: float, next_dt: float) -> None:
        """Finish step number `step`, dt long, and predict the next one; 0 for what is not to be done."""
        state, common = self.state, (self.rates, self.limits, self.trial)
        here = state, step, *common, (dt, next_dt), self.ended, self.found
        over_blocks(_step, _step_blocks, state.place, here)
        if dt > 0.0:
            note_all(state.clock[0], self.ended)

    def examine(self, dt: float) -> tuple[float, int]:
        """The drift at what is predicted; the error estimate over the tolerance, and its kind."""
        state, trial = self.state, self.trial
        t = float(state.clock[0, TIME]) + dt
        outside = add_together(self.forces, t, trial.place, trial.force)
        if self.forces.together is not None:
            here = state, self.rates, self.limits, trial, dt, self.squares
            over_blocks(_measure, _measure_blocks, state.place, here)
        seen, error, kind = _worst_of(self.found.outside, self.squares, self.limits.tolerance)
        state.clock[0, OUTSIDE] = outside + seen
        return error, kind

    def next(self, until: float) -> float:
        """The step to try next; 0 where the end is reached or the run has come to one."""
        clock, state = self.state.clock[0], self.state
        if clock[TIME] >= until or clock[STATUS] != RUNNING:
            return 0.0
        cloud = Cloud(state.place, state.velocity, state.force, state.frozen)
        see_collisions(clock, cloud, self.rates, self.limits, until)
        return float(equal_steps(until - clock[TIME], clock[NEXT_STEP]))


def _choose_first_step(parts: _Exponential, until: float) -> None:
    """As in `exponential`: with noise, shorten the first step until typical noise would let it pass."""
    state, forces, rates, limits = parts.state, parts.forces, parts.rates, parts.limits
    if state.noise is None:
        return
    typical = np.empty((len(state.noise), 1, *state.noise.shape[2:]))
    for noise in typical:
        typical_noise(noise[0])
    clock = state.clock[0]
    trials = _Exponential(state._replace(noise=typical), forces, rates, limits)
    while clock[STATUS] == RUNNING:
        dt = float(equal_steps(until - clock[TIME], clock[NEXT_STEP]))
        trials.step(-1, 0.0, dt)
        error, kind = trials.examine(dt)
        if error <= 1.0:
            return
        reject(clock, until, dt * step_factor(error), kind)


def advance_exponential(
    state: ParticleState,
    forces: Forces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """`Stepper` of the scheme `accurate`; the error estimate is that of all samples.

    Finishing a step and predicting the next one is one pass over memory, unless who may meet in the
    next one is to be seen in between.
    """
    clock = state.clock[0]
    parts = _Exponential(state, forces, rates, limits)
    if clock[STEPS] == 0.0 and clock[TIME] < until:
        parts.start()
        _choose_first_step(parts, until)
    dt, predicted, at_once = parts.next(until), False, limits.contact is None
    for step in range(steps):
        if dt == 0.0 or clock[STATUS] != RUNNING:
            return
        if not predicted:
            parts.step(step - 1, 0.0, dt)
        error, kind = parts.examine(dt)
        predicted = bool(error <= 1.0) or state.noise is not None
        if predicted:
            taken = dt
            accept(clock, until, dt, next_step(clock, state.noise, rates, dt, error), kind)
            predicted = at_once and step + 1 < steps
            dt = parts.next(until) if predicted else 0.0
            parts.step(step, taken, dt)
            dt = dt if predicted else parts.next(until)
        else:
            reject(clock, until, dt * step_factor(error), kind)
            dt = parts.next(until)


TOGETHER = {
    "paper": Together(advance_leapfrog, leapfrog.ORDER, leapfrog.NOISE_PER_STEP),
    "accurate": Together(advance_exponential, exponential.ORDER, exponential.NOISE_PER_STEP),
}
