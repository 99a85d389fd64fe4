"""The interaction of a cloud of samples with its own density as a sum over all their pairs, exact.

    force_i = -eps0/S sum_j grad_r U(r_i, r_j, theta_i, theta_j),    torque_i with dU/dtheta

The work grows like S^2, but not with the steepness of the potential: for few samples, and for slender
particles, whose series in the angles never ends (`forces`).
"""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.interaction.pairs.cells import (
    C2,
    S2,
    CellGrid,
    Sources,
    X,
    Y,
    cell_grid,
    gather,
    sort_by_cell,
)
from ellipsoid_coupling.interaction.pairs.pair_sum import scratch, sum_over_sources
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.physics.potential import PotentialShape


class SamplePairs:
    """Forces among the samples of a density, pair by pair; the same bits for any number of threads.

    Parameters
    ----------
    region : Region
        Where the cells of the neighbour search lie; samples beyond interact as well.
    shape : PotentialShape
    strength : float
        eps0.

    Attributes
    ----------
    harmonics : int
    nodes_per_width : float
        0 both: there are neither a series nor nodes.
    """

    harmonics = 0
    nodes_per_width = 0.0

    def __init__(self, region: Region, shape: PotentialShape, strength: float) -> None:
        self._grid = cell_grid(region.x_range, region.y_range, shape.reach, region.periods)
        self._shape, self._strength = shape, strength

    def add_forces(self, position: Array, weights: tuple[float, float], force: Array) -> None:
        """Add the interaction to the drift of all samples, as `SampleInteraction.add_forces`."""
        blocks, degrees, size = position.shape
        # All blocks are one cloud: samples of one density know no blocks.
        x, y, *angle = (np.ascontiguousarray(position[:, d]).ravel() for d in range(degrees))
        double = 2.0 * angle[0] if angle else np.zeros_like(x)
        grid = self._grid
        own, rank = sort_by_cell(x, y, np.cos(double), np.sin(double), grid)
        sums = np.zeros((3, x.size))
        # A task is a row of cells, which writes the sums of its own samples only.
        for_each(grid.rows, lambda row: _sum_row(row, own, grid, self._shape, sums))
        # Back from the order of the cells to that of the samples.
        sums = sums[:, rank]
        # Each of S samples has the mass 1/S.
        scale = -self._strength / x.size
        for d in range(degrees):
            weight = scale * (weights[1] if d == 2 else weights[0])
            force[:, d] += weight * sums[d].reshape(blocks, size)


@kernel
def _sum_row(
    row: int,
    own: Sources,
    grid: CellGrid,
    shape: PotentialShape,
    sums: Array,
) -> None:
    """Gradients of U/eps0, summed over all sources, of the samples in one row of cells: (3, S)."""
    # Empty rows are many where the cells cover more than the cloud.
    begin = row * grid.columns
    if own.first[begin] == own.first[begin + grid.columns]:
        return
    buffer, given, runs = scratch(own, grid)
    for column in range(grid.columns):
        cell = begin + column
        if own.first[cell] == own.first[cell + 1]:
            continue
        count = gather(own, column, row, grid, runs, buffer)
        # Each pair is met from both sides: twice the work, and no sums of other rows to add up.
        for t in range(own.first[cell], own.first[cell + 1]):
            here = own.records[t]
            target = (here[X], here[Y], here[C2], here[S2])
            sums[0, t], sums[1, t], sums[2, t] = sum_over_sources(
                target, buffer, count, given, shape
            )
