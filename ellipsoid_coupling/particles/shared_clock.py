"""Samples of one density on one clock: all threads go over their blocks, step by step.

The force on a sample is that of all samples' density at the same time, so that blocks of samples (the
realisations of the microscopic model) cannot run ahead of one another. Steps and noise are those of
`own_clock`: one block without interaction gives its bits. The error estimate is that of all samples.
"""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.dispatch import register_formula
from ellipsoid_coupling.compiled.jit import parallel_kernel
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.threads import single_task_chunks
from ellipsoid_coupling.compiled.tuning import FEW_BLOCKS, FEW_SAMPLES
from ellipsoid_coupling.particles.clocks import (
    SharedClock,
    Stepper,
    Work,
    interact,
    new_outcome,
    over_blocks,
    set_block,
)
from ellipsoid_coupling.particles.exponential import measure_block, step_block
from ellipsoid_coupling.particles.forces import Forces
from ellipsoid_coupling.particles.leapfrog import leap_block
from ellipsoid_coupling.particles.state import Limits, ParticleState, Rates, Trial

Floats = NDArray[np.float64]


@parallel_kernel
def _set_blocks(blocks: int, arguments: tuple[object, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        set_block(signed(k), *unpack(packed))


@parallel_kernel
def _leap_blocks(blocks: int, arguments: tuple[object, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        leap_block(signed(k), *unpack(packed))


@parallel_kernel
def _step_blocks(blocks: int, arguments: tuple[object, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        step_block(signed(k), *unpack(packed))


@parallel_kernel
def _measure_blocks(blocks: int, arguments: tuple[object, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(blocks):
        measure_block(signed(k), *unpack(packed))


# For each task, the kernel that runs it for all blocks.
_IN_THREADS: dict[Callable[..., None], Callable[[int, tuple[object, ...]], None]] = {
    set_block: _set_blocks,
    leap_block: _leap_blocks,
    step_block: _step_blocks,
    measure_block: _measure_blocks,
}


def _by_all_threads(
    group: SharedClock, task: Callable[..., None], arguments: tuple[object, ...]
) -> None:
    """Or by one, for which nothing more is to be compiled, if there is too little to share."""
    blocks, _, size = group.work.state.position.shape
    if blocks == 1 or (blocks <= FEW_BLOCKS and blocks * size < FEW_SAMPLES):
        for k in range(blocks):
            task(k, group.work, *arguments)
    else:
        with single_task_chunks():
            _IN_THREADS[task](blocks, (group.work, *arguments))


def _interact(group: SharedClock, t: float, position: Floats, force: Floats) -> None:
    if group.interaction is not None:
        group.interaction(t, position, force)


register_formula(over_blocks, SharedClock, _by_all_threads)
register_formula(interact, SharedClock, _interact)


def advance_shared_clock(
    stepper: Stepper,
    state: ParticleState,
    forces: Forces,
    rates: Rates,
    limits: Limits,
    until: float,
    steps: int,
) -> None:
    """Move all blocks by at most `steps` steps, in place and never beyond `until`.

    state : with one row of clock
    """
    blocks, degrees, size = state.position.shape
    # As large as the state: none for a stepper that tries nothing.
    shape = (len(Trial._fields), blocks if stepper.tries else 0, degrees, size)
    # A new array of this size would be given to the process page by page, in each call.
    trial = Trial(*forces.workspace.array("trial", shape, np.float64))
    outcome, interacts = new_outcome(blocks, degrees), forces.interaction is not None
    work = Work(state, forces.block, interacts, rates, limits, trial, outcome)
    stepper.advance_clock(SharedClock(work, forces.interaction), until, steps)
