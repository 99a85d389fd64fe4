"""The work of all forces from the centre of a cell to the centre of the next one.

    g = h/2 (F_i + F_{i+1}) + w (psi_i - psi_{i+1}),    psi = U * q, w = 1/m or 1/I_c

The trapezoidal rule for fluid, outer potentials and walls, the difference itself for the
interaction. Across a periodic side it is the work to the other side. Across any other side it is 0, and
the ghosts of a wall hold the mirrored work with the other sign.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values, total
from ellipsoid_coupling.compiled.jit import (
    apart_kernel,
    inline_kernel,
    kernel,
    parallel_kernel,
    view_kernel,
)
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.rows import Rows, load, map_fields, rows_at, store
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.q_grid import NORMAL
from ellipsoid_coupling.physics.elementary import exp_of_negative
from ellipsoid_coupling.scenes.sides import AtSide

Floats = NDArray[np.float64]

# Work beyond this, in units of the temperature, acts as a plain force: there one cell's equilibrium
# says nothing about its neighbour.
STEEPEST = 4.0
# What an end of x or y does with the work.
PASSES, MIRRORS, WRAPS = range(3)
WORK_AT: dict[AtSide, int] = {"leave": PASSES, "reflect": MIRRORS, "wrap": WRAPS}
_RANGE = 0.5 * STEEPEST
_EXP_RANGE = math.exp(_RANGE)


@inline_kernel
def _step_down(weight: float, here: float, beyond: float) -> float:
    return weight * (here - beyond)


@inline_kernel
def _together(weight: float, here: float, beyond: float) -> float:
    return weight * (here + beyond)


@apart_kernel
def _set_run(
    pulls: tuple[Rows, Rows],
    potentials: tuple[Rows, Rows],
    weights: tuple[float, float],
    width: int,
    out: Rows,
) -> None:
    """Tilt and rest of a run of cells: `out`; of these and of the next ones pulls and potentials.

    weights : h/2 and w, with the sign of the work.
    """
    for i in range(round_up_to_vectors(width)):
        if i < width:
            pull = map_fields(_together, weights[:1], (load(pulls[0], i), load(pulls[1], i)))
            drop = map_fields(
                _step_down, weights[1:], (load(potentials[0], i), load(potentials[1], i))
            )
            work = total(pull + drop)
            kept = min(max(work, -STEEPEST), STEEPEST)
            tilt = exp_of_negative(0.5 * kept - _RANGE) * _EXP_RANGE
            store(out, i, (tilt, work - kept))


@kernel
def _source(padded: int, count: int, ends: tuple[int, int]) -> tuple[int, float]:
    """The cell whose work a padded one of `count` cells in space holds, and its sign, 0 for none."""
    own = padded - GHOSTS
    if 0 <= own < count - 1:
        return own, 1.0
    if ends[0] == WRAPS and -GHOSTS <= own < count + GHOSTS:
        return own % count, 1.0
    if ends[0] == MIRRORS and count > 1 and own == -GHOSTS:
        return 0, -1.0
    if ends[1] == MIRRORS and count > 1 and own == count:
        return count - 2, -1.0
    return 0, 0.0


@view_kernel
def _set_between(
    pull: Floats,
    potential: Floats | None,
    distinct: int,
    here: tuple[int, int, int],
    beyond: tuple[int, int, int],
    weights: tuple[float, float],
    width: int,
    out: Floats,
    place: int,
) -> None:
    """`_set_run` of the cells from `here` on, (angle, y, x), to out (2, cells) from `place` on."""
    rows = pull.shape[1]
    pulls = (
        rows_at(pull, (here[0] * rows + here[1],), here[2]),
        rows_at(pull, (beyond[0] * rows + beyond[1],), beyond[2]),
    )
    potentials = (
        rows_at(potential, (here[0] % distinct * rows + here[1],), here[2]),
        rows_at(potential, (beyond[0] % distinct * rows + beyond[1],), beyond[2]),
    )
    _set_run(pulls, potentials, weights, width, rows_at(out, (0, 1), place))


@parallel_kernel
def _set_work(
    pull: Floats,
    potential: Floats | None,
    distinct: int,
    axis: int,
    ends: tuple[int, int],
    weights: tuple[float, float],
    padded_row: int,
    out: Floats,
) -> None:
    na, ny, nx = pull.shape
    lines = na * ny if axis == -1 else na * (ny + 2 * GHOSTS) if axis == -2 else ny * (na + 4)
    plane = (ny + 2 * GHOSTS) * padded_row
    back = (-weights[0], -weights[1])
    for task in numba.prange(lines):
        if axis == -1:
            a, j = task // ny, task % ny
            place = (a + GHOSTS) * plane + (j + GHOSTS) * padded_row
            here = pull, potential, distinct
            _set_between(*here, (a, j, 0), (a, j, 1), weights, nx - 1, out, place + GHOSTS)
            for end in (0, 1, nx + 1, nx + 2, nx + 3):
                i, sign = _source(end, nx, ends)
                if sign != 0.0:
                    signed, beyond = weights if sign > 0.0 else back, (a, j, (i + 1) % nx)
                    _set_between(*here, (a, j, i), beyond, signed, 1, out, place + end)
        elif axis == -2:
            a, row = task // (ny + 2 * GHOSTS), task % (ny + 2 * GHOSTS)
            j, sign = _source(row, ny, ends)
            place = (a + GHOSTS) * plane + row * padded_row + GHOSTS
            if sign != 0.0:
                signed = weights if sign > 0.0 else back
                here = pull, potential, distinct
                _set_between(*here, (a, j, 0), (a, (j + 1) % ny, 0), signed, nx, out, place)
        else:
            j, layer = task // (na + 2 * GHOSTS), task % (na + 2 * GHOSTS)
            a = (layer - GHOSTS) % na
            place = layer * plane + (j + GHOSTS) * padded_row + GHOSTS
            here = pull, potential, distinct
            _set_between(*here, (a, j, 0), ((a + 1) % na, j, 0), weights, nx, out, place)


def set_work(
    pull: Floats,
    potential: Floats | None,
    axis: int,
    ends: tuple[int, int],
    weights: tuple[float, float],
    out: Floats,
) -> None:
    """Tilt and rest of every cell, towards the next one along `axis`.

    Parameters
    ----------
    pull : (na, ny, nx) float64
        F without the interaction.
    potential : (n, ny, nx) float64 or None
        U * q of the angles that it tells apart.
    axis : int
        -1 for x, -2 for y, -3 for the angle, which is periodic.
    ends : (int, int)
        What the lower and the upper end of x or y do: PASSES, MIRRORS or WRAPS.
    weights : (float, float)
        h/2 and w.
    out : (2, (na + 4) (ny + 4) (nx + 4))
        exp(g/2), g held between +-`STEEPEST`, and what is beyond. Cells that have no work are left
        as they are: with 1 and 0.
    """
    distinct = 1 if potential is None else potential.shape[0]
    row = pull.shape[2] + 2 * GHOSTS
    _set_work(pull, potential, distinct, axis, ends, weights, row, out)


@inline_kernel
def _position(cell: int, cells: int, sign: int, component: int, stride: int) -> int:
    """The neighbour's momentum among all numbers of the fields."""
    return component * cells + cell + sign * stride


@inline_kernel
def _through(low: float, high: float, factor: float) -> float:
    return factor * (high - low)


@inline_kernel
def _without(leaving: float, density: float) -> float:
    return density - leaving


@apart_kernel
def _set_ahead_row(
    density: Rows, low: Rows, high: Rows, factors: Values, width: int, out: Rows
) -> None:
    for i in range(round_up_to_vectors(width)):
        if i < width:
            leaving = total(map_fields(_through, (), (load(low, i), load(high, i), factors)))
            store(out, i, map_fields(_without, (leaving,), (load(density, i),)))


@parallel_kernel
def _set_ahead(
    fields: Floats,
    momenta: tuple[int, ...],
    strides: tuple[int, ...],
    factors: Values,
    out: Floats,
) -> None:
    na, ny, nx = out.shape
    cells = fields.shape[1] * fields.shape[2] * fields.shape[3]
    numbers = fields.reshape(-1, 1)
    for task in numba.prange(na * ny):
        a, j = task // ny, task % ny
        row = (a + GHOSTS) * fields.shape[2] + j + GHOSTS
        cell = row * fields.shape[3] + GHOSTS
        low = rows_at(numbers, map_fields(_position, (cell, cells, -1), (momenta, strides)), 0)
        high = rows_at(numbers, map_fields(_position, (cell, cells, 1), (momenta, strides)), 0)
        density = rows_at(fields, (row,), GHOSTS)
        _set_ahead_row(density, low, high, factors, nx, rows_at(out, (task,), 0))


def set_ahead(fields: Floats, axes: tuple[int, ...], factors: Values, out: Floats) -> None:
    """The density after a while, q - sum_d c_d (m_{d,+1} - m_{d,-1}); the ghosts are filled.

    Parameters
    ----------
    fields : (4 or 3, na + 4, ny + 4, nx + 4) float64
    axes : tuple of int
        -1, -2 and, where the angle is resolved, -3.
    factors : tuple of float
        c = time/(2 h) along each axis.
    out : (na, ny, nx)
        Overwritten.
    """
    row = fields.shape[3]
    strides = {-1: 1, -2: row, -3: row * fields.shape[2]}
    momenta = tuple(NORMAL[axis] for axis in axes)
    _set_ahead(fields, momenta, tuple(strides[axis] for axis in axes), factors, out)
