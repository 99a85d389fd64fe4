"""Samples in blocks that all take the same steps: what acts on them, block by block, and all at once.

What acts on each sample by itself is evaluated block by block with the rest of a step, while the block
is in cache; what samples do to each other comes in between.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import KeptArrays
from ellipsoid_coupling.compiled.jit import for_each, kernel, one_by_one
from ellipsoid_coupling.interaction.pairs.cells import Sources
from ellipsoid_coupling.interaction.pairs.ghost_forces import add_ghost_forces
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces, still_frozen
from ellipsoid_coupling.particles.frozen import frozen_row
from ellipsoid_coupling.particles.state import (
    ParticleState,
    all_finite,
    largest_forces,
    note_forces,
)
from ellipsoid_coupling.stepping.status import NOT_FINITE
from ellipsoid_coupling.stepping.step_control import STATUS, TIME

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
    together : (t, place, force) -> None, or None
        Adds what they do to each other to the drift (K, D, B) at `place`; overwrites it where `alone`
        is None, and leaves frozen samples out.
        None without interaction.
    room : KeptArrays
        Memory for a step's work arrays, kept from call to call.
    """

    alone: Alone | None
    together: Callable[[float, Floats, Floats], object] | None
    room: KeptArrays


@kernel
def set_alone(
    alone: Alone | None, t: float, place: Floats, force: Floats, frozen: Flags | None
) -> int:
    """Overwrite the drift (D, B) of one block at time t; returns 0."""
    if alone is None:
        return 0
    particle_forces(alone.drift, t, place, force)
    _add_walls(alone.pairs, place, force)
    still_frozen(frozen, force)
    return 0


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
    t = state.clock[0, TIME]
    outside[k] = set_alone(alone, t, state.place[k], state.force[k], frozen)


def set_forces(forces: Forces, state: ParticleState) -> int:
    """Set the drift of all samples at their places; returns how many lie outside the flow."""
    outside = np.zeros(len(state.place), np.int64)
    for_each(len(outside), lambda k: _set_block(k, forces.alone, state, outside))
    t = float(state.clock[0, TIME])
    return int(outside.sum()) + add_together(forces, t, state.place, state.force)


def add_together(forces: Forces, t: float, place: Floats, force: Floats) -> int:
    """Add what samples (K, D, B) do to each other at time t; returns 0."""
    if forces.together is not None:
        forces.together(t, place, force)
    return 0


def over_blocks(
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


class Ended(NamedTuple):
    """How a step turned out, block by block: all finite (K,), the largest force and torque (K, 2)."""

    finite: NDArray[np.bool_]
    forces: Floats


def all_ended(blocks: int) -> Ended:
    """Of so many blocks, before anything went wrong."""
    return Ended(np.ones(blocks, np.bool_), np.zeros((blocks, 2)))


@kernel
def note_block(ended: Ended, state: ParticleState, k: int) -> None:
    """How the step of block k turned out."""
    ended.finite[k] = all_finite(state.velocity[k])
    ended.forces[k, 0], ended.forces[k, 1] = largest_forces(state.force[k])


def note_all(clock: Floats, ended: Ended) -> None:
    """Keep the largest forces of all blocks in their clock, and whether all is finite."""
    note_forces(clock, *ended.forces.max(axis=0))
    if not ended.finite.all():
        clock[STATUS] = NOT_FINITE
