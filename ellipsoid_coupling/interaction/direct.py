"""The interaction integral on an r-grid as it stands: the sum over all cells within reach."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from ellipsoid_coupling.compiled.algebra import add
from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.compiled.parallel_arguments import pack, unpack
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.interaction.grid_forces import (
    Array,
    Forces,
    check_fields,
    check_grid,
    half_widths,
)
from ellipsoid_coupling.interaction.occupied import Indices, occupied_extents
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential


class _Setup(NamedTuple):
    """Constants of the sum; `scale` is -eps0 h^2, `widths` the disc of `half_widths`."""

    h: float
    scale: float
    shape: PotentialShape
    widths: Indices


class _Fields(NamedTuple):
    """cos and sin of 2 phi and density, (ny, nx) each; `extents` (ny, 2) of `occupied_extents`."""

    c2: Array
    s2: Array
    density: Array
    extents: Indices


class DirectInteraction:
    """The discretised integral of `GridInteraction` by the direct sum: exact to rounding.

    Only pairs of cells between the first and the last occupied cell of their rows are visited;
    force and torque are 0 in vacuum. The same bits come out for any number of threads: every cell
    adds up its neighbours in the same order.

    Parameters
    ----------
    grid_shape : (ny, nx)
    h : float
        Spacing, the same in both directions.
    shape : PotentialShape
    strength : float
        eps0.

    Raises
    ------
    InputError
        A grid without cells or spacing; fields of another shape.
    """

    def __init__(
        self, grid_shape: tuple[int, int], h: float, shape: PotentialShape, strength: float
    ) -> None:
        check_grid(grid_shape, h)
        self.grid_shape = grid_shape
        self._setup = _Setup(float(h), -strength * h * h, shape, half_widths(shape, h))

    def __call__(self, density: Array, angle: Array) -> Forces:
        """See `GridInteraction`."""
        check_fields(self.grid_shape, density, angle)
        extents = occupied_extents(density[None])[0]
        # Once a cell: no pair takes a sine or a cosine.
        fields = _Fields(np.cos(2.0 * angle), np.sin(2.0 * angle), density, extents)
        force = np.zeros((2, *self.grid_shape))
        turns = self._setup.shape.shape_factor != 0.0
        torque = np.zeros(self.grid_shape) if turns else None
        occupied = np.flatnonzero(extents[:, 0] < extents[:, 1])
        # Threads take contiguous parts of this list: every n-th row for each of n threads balances them.
        threads = numba.get_num_threads()
        rows = np.concatenate([occupied[first::threads] for first in range(threads)])
        _sum_rows(rows, (fields, self._setup), force, torque)
        return Forces(force[0], force[1], torque)


@parallel_kernel
def _sum_rows(
    rows: Indices, grid: tuple[_Fields, _Setup], force: Array, torque: Array | None
) -> None:
    packed = pack(grid)
    for k in numba.prange(rows.size):
        fields, setup = unpack(packed)
        _sum_row(rows[k], fields, setup, force, torque)


@kernel
def _sum_row(row: int, fields: _Fields, setup: _Setup, force: Array, torque: Array | None) -> None:
    """Forces on one row of cells, offset by offset: the inner loop runs along contiguous cells."""
    h, scale, shape, widths = setup
    c2, s2, density, extents = fields
    first, end = extents[row]
    # Slopes are summed over all offsets before they are scaled: one rounding less a pair.
    sums = np.zeros((2, c2.shape[1]))
    for source in range(max(0, row - widths.size + 1), min(c2.shape[0], row + widths.size)):
        width = widths[abs(source - row)]
        # Rows and offsets in one order, whichever thread has the row: the same bits.
        for offset in range(-width, width + 1):
            a = max(first, extents[source, 0] - offset)
            b = min(end, extents[source, 1] - offset)
            # Cells of the target's row that have an occupied source cell at this offset.
            if a >= b:
                continue
            # All these pairs have one offset, so that only angles vary along the loop.
            delta = offset * h, (source - row) * h
            # Cut out before the loop: an index that is a sum would be gathered, not read in line.
            target = c2[row, a:b], s2[row, a:b]
            a_bar, b_bar = a + offset, b + offset
            bar = c2[source, a_bar:b_bar], s2[source, a_bar:b_bar], density[source, a_bar:b_bar]
            pull = sums[0, a:b], sums[1, a:b]
            _add_offset(pull, rows_at(torque, (row,), a), target, bar, delta, shape)
    for j in range(first, end):
        # Empty cells between occupied ones have been summed over as well, so that the loop has no branch.
        held = density[row, j] != 0.0
        force[0, row, j] = scale * sums[0, j] if held else 0.0
        force[1, row, j] = scale * sums[1, j] if held else 0.0
        if torque is not None:
            torque[row, j] = scale * torque[row, j] if held else 0.0


@kernel(noalias=True)
def _add_offset(
    pull: tuple[Array, Array],
    turn: Rows,
    target: tuple[Array, Array],
    bar: tuple[Array, Array, Array],
    delta: tuple[float, float],
    shape: PotentialShape,
) -> None:
    """Add what a run of cells (c2, s2, density of `bar`) does to the run `target` at -`delta`.

    turn : the row of torques, or none. All arrays are contiguous and of one length; only so does the
    loop become SIMD instructions.
    """
    pull_x, pull_y = pull
    c2, s2 = target
    c2_bar, s2_bar, density = bar
    dx, dy = delta
    for j in range(c2.size):
        _, slope_x, slope_y, slope_angle = pair_potential(
            dx, dy, c2[j], s2[j], c2_bar[j], s2_bar[j], shape
        )
        pull_x[j] += density[j] * slope_x
        pull_y[j] += density[j] * slope_y
        store(turn, j, add(load(turn, j), density[j] * slope_angle))
