"""Realisations on clocks of their own: each runs ahead by itself, in one thread, as one kernel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.dispatch import register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.particles.clocks import (
    OwnClock,
    Stepper,
    Work,
    interact,
    new_outcome,
    over_blocks,
)
from ellipsoid_coupling.particles.forces import BlockForces
from ellipsoid_coupling.particles.state import (
    Limits,
    ParticleState,
    Rates,
    Trial,
    realisation,
)

Floats = NDArray[np.float64]


@inline_kernel
def _in_this_thread(
    group: OwnClock, task: Callable[..., None], arguments: tuple[object, ...]
) -> None:
    task(0, group.work, *arguments)


@inline_kernel
def _nothing(group: OwnClock, t: float, position: Floats, force: Floats) -> None:
    """One block has no other block to interact with."""


register_formula(over_blocks, OwnClock, _in_this_thread)
register_formula(interact, OwnClock, _nothing)


@kernel
def own_clock(
    k: int, state: ParticleState, forces: BlockForces, rates: Rates, limits: Limits, tried: int
) -> OwnClock:
    """The group of realisation k; `tried` is 1 for a stepper that tries steps, else 0."""
    # Made within the kernel: Python hands over arrays one by one, which short calls would feel.
    one = realisation(state, k)
    _, degrees, number = one.position.shape
    shape = (tried, degrees, number)
    trial = Trial(np.empty(shape), np.empty(shape))
    # Pairs of a realisation are part of its own forces: no block acts on another one.
    return OwnClock(Work(one, forces, False, rates, limits, trial, new_outcome(1, degrees)))


def advance_own_clocks(
    stepper: Stepper,
    state: ParticleState,
    forces: BlockForces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """Move every realisation by at most `steps` steps, in place and never beyond `until`.

    state : with a row of clock for each realisation
    """
    # Realisations take different numbers of steps: each thread takes the next one when it is free.
    for_each(
        len(state.position),
        lambda k: stepper.advance_own(k, state, forces, rates, limits, until, steps),
    )
