"""The pair sum over particles with a cell list: every particle feels every source within reach.

The plane is cut into square cells of half the reach; particles are sorted by cell, so that the five
cells of a row that can hold neighbours are one contiguous run:

        +---+---+---+---+---+
        |   |   |   |   |   |     for all targets t of one cell the sources of these 25 cells are
        +---+---+---+---+---+     copied to one buffer; the sum over it is a straight loop over
        |   |   |   |   |   |     contiguous arrays, which vectorises
        +---+---+---+---+---+
        |   |   | t |   |   |
        +---+---+---+---+---+
        |   |   |   |   |   |
        +---+---+---+---+---+
        |   |   |   |   |   |
        +---+---+---+---+---+

Each ordered pair is computed on its own: no scatter, hence a fixed order of summation. A source
that coincides with its target adds nothing (force and torque vanish at delta = 0, Delta = 0), so a
particle needs no exclusion of itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import kernel
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# A cell of reach/2 needs two cells to each side.
CELLS_PER_REACH = 2


class CellGrid(NamedTuple):
    """The cells of the neighbour search; positions beyond the rim count to the rim's cells."""

    x_low: float
    y_low: float
    inverse_size: float
    columns: int
    rows: int


class Sources(NamedTuple):
    """Particles sorted by cell: the ones of cell c are ``first[c] : first[c + 1]``.

    x, y, c2, s2 : (n,) float64, positions and cos, sin of 2 theta; first : (cells + 1,) int64.
    """

    x: Floats
    y: Floats
    c2: Floats
    s2: Floats
    first: Integers


class Pairs(NamedTuple):
    """What the particles' sum needs: force per mass and torque per inertia are `*_weight` times U's.

    `torque_weight` is None for circles, `ghosts` is None without walls: neither is then compiled.
    """

    grid: CellGrid
    shape: PotentialShape
    force_weight: float
    torque_weight: float | None
    ghosts: Sources | None
    ghost_factor: float


def cell_grid(x_range: tuple[float, float], y_range: tuple[float, float], reach: float) -> CellGrid:
    """The cells of size reach/2 that cover a rectangle."""
    size = reach / CELLS_PER_REACH
    columns = max(1, int(np.ceil((x_range[1] - x_range[0]) / size)))
    rows = max(1, int(np.ceil((y_range[1] - y_range[0]) / size)))
    return CellGrid(x_range[0], y_range[0], 1.0 / size, columns, rows)


@kernel
def cell_index(x: float, y: float, grid: CellGrid) -> int:
    """The cell of a position; clamping keeps neighbours neighbours, since it never stretches."""
    column = min(max((x - grid.x_low) * grid.inverse_size, 0.0), grid.columns - 1.0)
    row = min(max((y - grid.y_low) * grid.inverse_size, 0.0), grid.rows - 1.0)
    return int(row) * grid.columns + int(column)


@kernel
def sort_by_cell(
    x: Floats, y: Floats, c2: Floats, s2: Floats, grid: CellGrid
) -> tuple[Sources, Integers]:
    """Counting sort by cell, stable; returns the sorted particles and where each came from (n,)."""
    n = x.size
    cells = np.empty(n, np.int64)
    first = np.zeros(grid.columns * grid.rows + 1, np.int64)
    for i in range(n):
        cells[i] = cell_index(x[i], y[i], grid)
        first[cells[i] + 1] += 1
    for c in range(grid.columns * grid.rows):
        first[c + 1] += first[c]
    place = first[:-1].copy()
    came_from = np.empty(n, np.int64)
    for i in range(n):
        came_from[place[cells[i]]] = i
        place[cells[i]] += 1
    return Sources(x[came_from], y[came_from], c2[came_from], s2[came_from], first), came_from


@kernel
def gather(sources: Sources, column: int, row: int, grid: CellGrid, buffer: Floats) -> int:
    """Copy all sources that can reach a cell to buffer (4, n); returns how many."""
    low = max(column - CELLS_PER_REACH, 0)
    high = min(column + CELLS_PER_REACH, grid.columns - 1)
    count = 0
    for r in range(max(row - CELLS_PER_REACH, 0), min(row + CELLS_PER_REACH, grid.rows - 1) + 1):
        begin = sources.first[r * grid.columns + low]
        end = sources.first[r * grid.columns + high + 1]
        for j in range(begin, end):
            buffer[0, count + j - begin] = sources.x[j]
            buffer[1, count + j - begin] = sources.y[j]
            buffer[2, count + j - begin] = sources.c2[j]
            buffer[3, count + j - begin] = sources.s2[j]
        count += end - begin
    return count


@kernel
def sum_over_sources(
    target: tuple[float, float, float, float], buffer: Floats, count: int, shape: PotentialShape
) -> tuple[float, float, float]:
    """Sum of dU/dx, dU/dy, dU/dtheta (over eps0) of one target (x, y, c2, s2) with the buffer."""
    x, y, c2, s2 = target
    sum_x = 0.0
    sum_y = 0.0
    sum_theta = 0.0
    for j in range(count):
        _, gradient_x, gradient_y, slope = pair_potential(
            buffer[0, j] - x, buffer[1, j] - y, c2, s2, buffer[2, j], buffer[3, j], shape
        )
        sum_x += gradient_x
        sum_y += gradient_y
        sum_theta += slope
    return sum_x, sum_y, sum_theta


@kernel
def _sum_over_ghosts(
    target: tuple[float, float, float, float],
    buffer: Floats | None,
    count: int,
    shape: PotentialShape,
) -> tuple[float, float, float]:
    if buffer is None:
        return 0.0, 0.0, 0.0
    return sum_over_sources(target, buffer, count, shape)


@kernel
def _gather_ghosts(
    ghosts: Sources | None, column: int, row: int, grid: CellGrid, buffer: Floats | None
) -> int:
    if ghosts is None or buffer is None:
        return 0
    return gather(ghosts, column, row, grid, buffer)


@kernel
def _ghost_buffer(ghosts: Sources | None) -> Floats | None:
    if ghosts is None:
        return None
    return np.empty((4, ghosts.x.size))


@kernel
def _add_torque(force: Floats, i: int, slope: float, weight: float | None) -> None:
    if weight is not None:
        force[2, i] -= weight * slope


@kernel
def add_pair_forces(place: Floats, axis: Floats, pairs: Pairs, force: Floats) -> None:
    """Add the sums over -grad U of `eq:micro` to the drift of all particles of one realisation.

    Parameters
    ----------
    place : (D, N) float64
        x, y (and angle, not read here).
    axis : (2, N)
        cos and sin of 2 theta.
    pairs : Pairs
    force : (D, N)
        Per mass and per inertia; added to in place.
    """
    grid, shape = pairs.grid, pairs.shape
    own, came_from = sort_by_cell(place[0], place[1], axis[0], axis[1], grid)
    buffer = np.empty((4, own.x.size))
    ghost_buffer = _ghost_buffer(pairs.ghosts)
    for row in range(grid.rows):
        for column in range(grid.columns):
            cell = row * grid.columns + column
            if own.first[cell] == own.first[cell + 1]:
                continue
            count = gather(own, column, row, grid, buffer)
            ghosts = _gather_ghosts(pairs.ghosts, column, row, grid, ghost_buffer)
            for t in range(own.first[cell], own.first[cell + 1]):
                target = (own.x[t], own.y[t], own.c2[t], own.s2[t])
                gx, gy, slope = sum_over_sources(target, buffer, count, shape)
                wx, wy, wall_slope = _sum_over_ghosts(target, ghost_buffer, ghosts, shape)
                i = came_from[t]
                force[0, i] -= pairs.force_weight * (gx + pairs.ghost_factor * wx)
                force[1, i] -= pairs.force_weight * (gy + pairs.ghost_factor * wy)
                total = slope + pairs.ghost_factor * wall_slope
                _add_torque(force, i, total, pairs.torque_weight)
