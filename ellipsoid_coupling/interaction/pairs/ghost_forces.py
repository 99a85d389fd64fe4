"""The walls' ghost particles alone, for samples that feel each other through their density."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.interaction.pairs.cells import Sources, cell_index, gather
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, scratch, sum_over_sources
from ellipsoid_coupling.physics.elementary import cos_sin

Floats = NDArray[np.float64]


@kernel
def _add_torque(force: Floats, i: int, slope: float, weight: float | None) -> None:
    # A function of its own: numba leaves out what stands behind `is not None` for arguments only.
    if weight is not None:
        force[2, i] -= weight * slope


@kernel
def add_ghost_forces(position: Floats, ghosts: Sources, pairs: Pairs, force: Floats) -> None:
    """Add the exact sums over -grad U of the ghosts to the drift of particles, in place.

    Parameters
    ----------
    position : (D, N) float64
        x, y and, with D = 3, the angle.
    ghosts : Sources
        On the cells of `pairs.grid`.
    pairs : Pairs
        Weights and shape; its particles' interaction with each other is not computed.
    force : (D, N)
        Per mass and per inertia.
    """
    grid = pairs.grid
    buffer, given, runs = scratch(ghosts, grid)
    gathered, count = -1, 0
    force_weight = pairs.force_weight * pairs.ghost_factor
    for i in range(position.shape[1]):
        cell = cell_index(position[0, i], position[1, i], grid)
        # Particles are not sorted here: what was gathered serves as long as the cell stays the same.
        if cell != gathered:
            column, row = cell % grid.columns, cell // grid.columns
            count = gather(ghosts, column, row, grid, runs, buffer)
            gathered = cell
        if count > 0:
            # Where nothing turns only circles interact, which have any axis.
            double = 2.0 * position[2, i] if position.shape[0] == 3 else 0.0
            c2, s2 = cos_sin(double)
            target = (position[0, i], position[1, i], c2, s2)
            gx, gy, slope = sum_over_sources(target, buffer, count, given, pairs.shape)
            force[0, i] -= force_weight * gx
            force[1, i] -= force_weight * gy
            _add_torque(force, i, pairs.ghost_factor * slope, pairs.torque_weight)
