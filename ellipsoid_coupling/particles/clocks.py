"""Blocks of particles that take all steps together, on one clock; steppers are written for such a group.

    own clock       one realisation: the whole loop over its steps is one kernel, in one thread
    shared clock    blocks of samples whose force is that of all samples' density at the same time: the
                    loop runs in Python, each pass over the blocks by all threads, and the interaction,
                    which is no kernel, in between

A stepper's loop (`leapfrog.advance_clock`, `exponential.advance_clock`) is the same text for both: it
calls `over_blocks` and `interact`, which are chosen by the type of the group.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.dispatch import chosen_by_type
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.particles.forces import BlockForces, BlockInteraction, set_block_forces
from ellipsoid_coupling.particles.frozen import frozen_row
from ellipsoid_coupling.particles.state import (
    Limits,
    ParticleState,
    Rates,
    Trial,
    all_finite,
    largest_forces,
    note_forces,
)
from ellipsoid_coupling.stepping.status import NOT_FINITE
from ellipsoid_coupling.stepping.step_control import STATUS

Floats = NDArray[np.float64]


class Outcome(NamedTuple):
    """How the last step of each block turned out.

    Attributes
    ----------
    finite : (K,) bool
    forces : (K, 2) float64
        The largest force and torque.
    squares : (K, 2, D)
        Squared errors, as of `local_error.squared_errors`.
    """

    finite: NDArray[np.bool_]
    forces: Floats
    squares: Floats


class Work(NamedTuple):
    """What the kernels of a step take.

    Attributes
    ----------
    state : ParticleState
        Of K blocks, with one row of clock.
    forces : BlockForces or None
    interacts : bool
        Whether blocks act on each other.
    rates : Rates
    limits : Limits
    trial : Trial
        Of no block, where a stepper tries no step.
    outcome : Outcome
    """

    state: ParticleState
    forces: BlockForces | None
    interacts: bool
    rates: Rates
    limits: Limits
    trial: Trial
    outcome: Outcome


class OwnClock(NamedTuple):
    """The group of one realisation; its formulas are in `own_clock`."""

    work: Work


class SharedClock(NamedTuple):
    """The group of all blocks of samples; its formulas are in `shared_clock`.

    interaction : as in `forces.Forces`
    """

    work: Work
    interaction: BlockInteraction | None


Group = OwnClock | SharedClock


class OwnClockKernel(Protocol):
    """Moves realisation k by at most `steps` steps, in place and never beyond `until`."""

    def __call__(
        self,
        k: int,
        state: ParticleState,
        forces: BlockForces,
        rates: Rates,
        limits: Limits,
        until: float,
        steps: int,
    ) -> None:
        """Step."""
        ...


class Stepper(NamedTuple):
    """A particle stepper.

    Attributes
    ----------
    advance_clock : (group, until, steps) -> None
        Moves a group of blocks by at most `steps` steps, in place and never beyond `until`.
    advance_own : OwnClockKernel
        The same for a realisation on its own clock, as a kernel.
    order : int
        Of the global error, without noise.
    noise_per_step : int
        Gaussian numbers a step and noisy degree of freedom.
    tries : bool
        Whether a step is tried before it is taken, for which `Work.trial` is.
    """

    advance_clock: Callable[[Group, float, int], None]
    advance_own: OwnClockKernel
    order: int
    noise_per_step: int
    tries: bool


@chosen_by_type
def over_blocks(group: Group, task: Callable[..., None], arguments: tuple[object, ...]) -> None:
    """Run ``task(k, group.work, *arguments)`` for all blocks k.

    task : a kernel, by its name in the module
    """


@chosen_by_type
def interact(group: Group, t: float, position: Floats, force: Floats) -> None:
    """Add what blocks do to each other at the time t to the drift (K, D, B) at `position`."""


@kernel
def new_outcome(blocks: int, degrees: int) -> Outcome:
    """Of so many blocks, before anything went wrong."""
    return Outcome(np.ones(blocks, np.bool_), np.zeros((blocks, 2)), np.empty((blocks, 2, degrees)))


@kernel
def set_block(k: int, work: Work, t: float) -> None:
    """Set what acts within block k, at its position and the time t."""
    state = work.state
    set_block_forces(work.forces, t, state.position[k], state.force[k], frozen_row(state.frozen, k))


@kernel
def note_block_forces(k: int, work: Work) -> None:
    """Keep the largest force and torque of block k."""
    # By block, not in the clock: blocks of one clock are stepped at the same time.
    forces = work.outcome.forces
    forces[k, 0], forces[k, 1] = largest_forces(work.state.force[k])


@kernel
def note_block_finite(k: int, work: Work, values: Floats) -> None:
    """Keep whether these values (D, B) of block k are finite."""
    work.outcome.finite[k] = all_finite(values)


@kernel
def note_outcome(clock: Floats, outcome: Outcome) -> None:
    """Keep the largest forces of all blocks in their clock, and whether all is finite."""
    # By one thread, after the pass, and in the order of the blocks.
    for k in range(outcome.finite.size):
        note_forces(clock, outcome.forces[k, 0], outcome.forces[k, 1])
        if not outcome.finite[k]:
            clock[STATUS] = NOT_FINITE
