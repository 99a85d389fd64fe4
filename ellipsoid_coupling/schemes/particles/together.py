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
from typing import Any, NamedTuple, Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.cells import Sources
from ellipsoid_coupling.interaction.drift import Drift, particle_forces, still_frozen
from ellipsoid_coupling.interaction.ghost_forces import add_ghost_forces
from ellipsoid_coupling.interaction.kept import KeptArrays
from ellipsoid_coupling.interaction.pairs import Pairs
from ellipsoid_coupling.kernels import for_each, kernel, one_by_one, parallel_kernel
from ellipsoid_coupling.schemes.particles import exponential, leapfrog
from ellipsoid_coupling.schemes.particles.exponential import (
    Trial,
    accept_step,
    largest_error,
    predict_step,
    squared_errors,
    step_factor,
)
from ellipsoid_coupling.schemes.particles.frozen import frozen_row
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
from ellipsoid_coupling.sharing import pack, signed, unpack

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.uint8]

# Fewer samples in a few blocks take no longer on one thread, for which nothing more is to be compiled.
_LEAST_SAMPLES, _FEW_BLOCKS = 2000, 8


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
        is None, and leaves frozen samples out. Returns how many samples it finds outside the flow.
        None without interaction.
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


@kernel
def _set_alone(alone: Alone | None, place: Floats, force: Floats, frozen: Flags | None) -> int:
    """Overwrite the drift (D, B) of one block; returns how many samples lie outside the flow."""
    if alone is None:
        return 0
    outside = particle_forces(alone.drift, place, force)
    _add_walls(alone.pairs, place, force)
    still_frozen(frozen, force)
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
def _set_block(k: int, alone: Alone | None, state: ParticleState, outside: Indices) -> None:
    frozen = frozen_row(state.frozen, k)
    outside[k] = _set_alone(alone, state.place[k], state.force[k], frozen)


def set_forces(forces: Forces, state: ParticleState) -> int:
    """Set the drift of all samples at their places; returns how many lie outside the flow."""
    outside = np.zeros(len(state.place), np.int64)
    for_each(len(outside), lambda k: _set_block(k, forces.alone, state, outside))
    return int(outside.sum()) + _add_together(forces, state.place, state.force)


def _add_together(forces: Forces, place: Floats, force: Floats) -> int:
    return 0 if forces.together is None else forces.together(place, force)


def _over_blocks(
    task: Callable[..., None],
    tasks: Callable[[int, tuple[Any, ...]], None],
    place: Floats,
    arguments: tuple[Any, ...],
) -> None:
    """Task(k, *arguments) for all blocks k of `place` (K, D, B): by all threads, if it is worth it."""
    blocks, _, size = place.shape
    if blocks == 1 or (blocks <= _FEW_BLOCKS and blocks * size < _LEAST_SAMPLES):
        for k in range(blocks):
            task(k, *arguments)
    else:
        with one_by_one():
            tasks(blocks, arguments)


@kernel
def _leap(
    k: int,
    state: ParticleState,
    step: int,
    rates: Rates,
    limits: Limits,
    dt: float,
    alone: Alone | None,
    found: tuple[Indices, NDArray[np.bool_]],
    parts: tuple[bool, bool],
) -> None:
    """The drift of each sample by itself, and a leapfrog step in the whole drift; `parts` of this.

    found : (K,) each, samples outside the flow, and whether all is finite after the step.
    """
    sets, moves = parts
    outside, finite = found
    if sets:
        frozen = frozen_row(state.frozen, k)
        outside[k] = _set_alone(alone, state.place[k], state.force[k], frozen)
    if moves:
        leapfrog.move(state, k, step, rates, limits, dt)
        finite[k] = all_finite(state.velocity[k])


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
    found = np.zeros(blocks, np.int64), np.ones(blocks, np.bool_)
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
                _over_blocks(_leap, _leap_blocks, state.place, (*here, (sets, moves)))
            if not moves:
                together = _add_together(forces, state.place, state.force)
        clock[OUTSIDE] = found[0].sum() + together
        accept(clock, until, dt, limits.step, GIVEN)
        if not found[1].all():
            clock[STATUS] = NOT_FINITE


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
    finite: NDArray[np.bool_],
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
        finite[k] = all_finite(state.velocity[k])
    if next_dt > 0.0:
        noise = noise_rows(state.noise, k, step + 1)
        predict_step(state, k, noise, rates, limits, here, next_dt)
        frozen = frozen_row(state.frozen, k)
        found.outside[k] = _set_alone(found.alone, here.folded, here.force, frozen)
        _measure_one(found.squares, state, k, rates, limits, here, next_dt)


@parallel_kernel
def _step_blocks(blocks: int, arguments: tuple[Any, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        _step(signed(k), *unpack(packed))


@kernel
def _worst_of(outside: Indices, squares: Floats, tolerance: float) -> tuple[int, float, int]:
    """Samples outside the flow; the error over the tolerance of all blocks' mean, and its kind."""
    mean = squares[0].copy()
    for k in range(1, squares.shape[0]):
        mean += squares[k]
    error, kind = largest_error(mean / squares.shape[0], tolerance)
    return outside.sum(), error, kind


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

    def step(self, step: int, dt: float, next_dt: float) -> None:
        """Finish step number `step`, dt long, and predict the next one; 0 for what is not to be done."""
        state, common = self.state, (self.rates, self.limits, self.trial)
        here = state, step, *common, (dt, next_dt), self.finite, self.found
        _over_blocks(_step, _step_blocks, state.place, here)
        if not self.finite.all():
            state.clock[0, STATUS] = NOT_FINITE

    def examine(self, dt: float) -> tuple[float, int]:
        """The drift at what is predicted; the error estimate over the tolerance, and its kind."""
        state, trial = self.state, self.trial
        outside = _add_together(self.forces, trial.folded, trial.force)
        if self.forces.together is not None:
            here = state, self.rates, self.limits, trial, dt, self.squares
            _over_blocks(_measure, _measure_blocks, state.place, here)
        seen, error, kind = _worst_of(self.found.outside, self.squares, self.limits.tolerance)
        state.clock[0, OUTSIDE] = outside + seen
        return error, kind


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
        clock[OUTSIDE] = set_forces(forces, state)
    dt, predicted = _next_step(clock, until), False
    for step in range(steps):
        if dt == 0.0 or clock[STATUS] != RUNNING:
            return
        if not predicted:
            parts.step(step - 1, 0.0, dt)
        error, kind = parts.examine(dt)
        planned = dt * step_factor(error)
        predicted = bool(error <= 1.0) or state.noise is not None
        if predicted:
            taken = dt
            accept(clock, until, dt, planned, kind)
            dt = _next_step(clock, until)
            predicted = step + 1 < steps
            parts.step(step, taken, dt if predicted else 0.0)
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
