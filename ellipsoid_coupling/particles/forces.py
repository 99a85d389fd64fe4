"""The drift of particles in blocks: what acts within each block, and what blocks do to each other.

A block is a realisation of the microscopic model, or some of the samples of one density. What acts
within it is evaluated block by block with the rest of a step, while the block is in cache. What blocks
do to each other comes in between.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.interaction.pairs.cells import Sources
from ellipsoid_coupling.interaction.pairs.ghost_forces import add_ghost_forces
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces, still_frozen

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]
# (t, position, force): adds what blocks do to each other to the drift (K, D, B).
BlockInteraction = Callable[[float, Floats, Floats], None]


class BlockForces(NamedTuple):
    """What acts within a block of particles.

    Attributes
    ----------
    drift : Drift
        With the pairs of the block's own particles, where these interact with nobody else.
    walls : Pairs or None
        Whose ghost particles act as well, where `drift` has no pairs; None without.
    """

    drift: Drift
    walls: Pairs | None


class Forces(NamedTuple):
    """The drift of all blocks.

    Attributes
    ----------
    block : BlockForces or None
    interaction : (t, position, force) -> None, or None
        Adds what blocks do to each other to the drift (K, D, B) at `position`. It overwrites the drift
        where `block` is None, and leaves frozen particles out. None without interaction.
    workspace : BufferPool
        Memory for a step's work arrays, kept from call to call.
    """

    block: BlockForces | None
    interaction: BlockInteraction | None
    workspace: BufferPool


@kernel
def set_block_forces(
    block: BlockForces | None, t: float, position: Floats, force: Floats, frozen: Flags | None
) -> None:
    """Overwrite the drift (D, B) of one block; without `block`, all of it comes from the interaction."""
    # Without walls the frozen ones are left out already, by the drift itself.
    if block is not None:
        particle_forces(block.drift, t, position, force, frozen)
        _add_walls(block.walls, position, force, frozen)


@kernel
def _add_walls(walls: Pairs | None, position: Floats, force: Floats, frozen: Flags | None) -> None:
    if walls is not None:
        # Ghosts push all particles alike, frozen ones too: their forces are cleared after it.
        _add_ghosts(walls.ghosts, walls, position, force)
        still_frozen(frozen, force)


@kernel
def _add_ghosts(ghosts: Sources | None, walls: Pairs, position: Floats, force: Floats) -> None:
    if ghosts is not None:
        add_ghost_forces(position, ghosts, walls, force)
