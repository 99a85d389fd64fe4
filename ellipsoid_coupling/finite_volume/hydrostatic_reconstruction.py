"""The work of all forces from the centre of a cell to the centre of the next one.

    g = h/2 (F_i + F_{i+1}) + w (psi_i - psi_{i+1}),    psi = U * q, w = 1/m or 1/I_c

The trapezoidal rule for fluid, outer potentials and walls, the difference itself for the
interaction. Across a periodic side it is the work to the other side. At a side that lets particles
through it goes on as it is where there is a fluid, whose drag does not end there; else it is 0, and what
is at rest stays. Across a wall it is 0, and in its ghosts the mirrored work with opposite sign:

    cells     -2    -1  |  0     1     2 ...            g_i leads from cell i to cell i + 1
    work    -g_0     0  | g_0   g_1   g_2               | wall
             g_0   g_0  | g_0   g_1   g_2               | let through, in a fluid
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values, add, axpy, mul, scale, sub, total
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import over_row
from ellipsoid_coupling.compiled.parallel_arguments import signed
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.q_grid import NORMAL
from ellipsoid_coupling.physics.elementary import exp_of_negative
from ellipsoid_coupling.scenes.sides import AtSide

Floats = NDArray[np.float64]

# Work beyond this, in units of the temperature, acts as a plain force: there one cell's equilibrium
# says nothing about its neighbour.
STEEPEST = 4.0
# What an end of x or y does with the work.
STOPS, MIRRORS, WRAPS, PASSES = range(4)
WORK_AT: dict[AtSide, int] = {"leave": PASSES, "reflect": MIRRORS, "wrap": WRAPS}
_RANGE = 0.5 * STEEPEST
_EXP_RANGE = math.exp(_RANGE)


@inline_kernel
def _set_cell(
    i: int,
    pulls: tuple[Rows, Rows],
    potentials: tuple[Rows, Rows],
    weights: tuple[float, float],
    out: Rows,
) -> None:
    # h/2 (F_i + F_{i+1}).
    pull = scale(weights[0], add(load(pulls[0], i), load(pulls[1], i)))
    # Of no potential no number.
    drop = scale(weights[1], sub(load(potentials[0], i), load(potentials[1], i)))
    work = total(pull + drop)
    kept = min(max(work, -STEEPEST), STEEPEST)
    # The package's exponential is for negative arguments.
    tilt = exp_of_negative(0.5 * kept - _RANGE) * _EXP_RANGE
    # The flux tilts its profile by the first number; the source adds the second as a plain force.
    store(out, i, (tilt, work - kept))


@kernel(noalias=True)
def set_run(
    pulls: tuple[Rows, Rows],
    potentials: tuple[Rows, Rows],
    weights: tuple[float, float],
    width: int,
    out: Rows,
) -> None:
    """Tilt and rest of a run of cells: `out`; of these and of the next ones pulls and potentials.

    weights : h/2 and w, with the sign of the work.
    """
    over_row(width, _set_cell, (pulls, potentials, weights, out))


@kernel
def _source(padded: int, count: int, ends: tuple[int, int]) -> tuple[int, float]:
    """The cell whose work a padded one of `count` cells in space holds, and its sign, 0 for none."""
    own = padded - GHOSTS
    if 0 <= own < count - 1:
        return own, 1.0
    # What comes in or goes out feels the force on both sides: with none beyond, half of it would be missing
    # in the cell at the side, and its profile would lean the wrong way.
    if ends[0] == PASSES and own < 0:
        return 0, 1.0
    if ends[1] == PASSES and own >= count - 1:
        return max(count - 2, 0), 1.0
    if ends[0] == WRAPS and -GHOSTS <= own < count + GHOSTS:
        return own % count, 1.0
    # Ghosts -2 and -1 mirror cells 1 and 0: g_0, the other way. From -1 on the way leads across the wall.
    if ends[0] == MIRRORS and count > 1 and own == -GHOSTS:
        return 0, -1.0
    # Likewise the first two ghosts above mirror the last two cells.
    if ends[1] == MIRRORS and count > 1 and own == count:
        return count - 2, -1.0
    return 0, 0.0


class _Forces(NamedTuple):
    """What works: F without the interaction, U * q or None, and the angles that this tells apart."""

    pull: Floats
    potential: Floats | None
    distinct: int


@kernel(noalias=True)
def _set_between(
    forces: _Forces,
    here: tuple[int, int, int],
    beyond: tuple[int, int, int],
    weights: tuple[float, float],
    width: int,
    out: Floats,
    start: int,
) -> None:
    """`set_run` of the cells from `here` on, (angle, y, x), to out (2, cells) from `start` on."""
    pull, potential, distinct = forces
    rows = pull.shape[1]
    # Rows of (angle, y); the potential has fewer angles where it is periodic in them.
    pulls = (
        rows_at(pull, (here[0] * rows + here[1],), here[2]),
        rows_at(pull, (beyond[0] * rows + beyond[1],), beyond[2]),
    )
    potentials = (
        rows_at(potential, (here[0] % distinct * rows + here[1],), here[2]),
        rows_at(potential, (beyond[0] % distinct * rows + beyond[1],), beyond[2]),
    )
    set_run(pulls, potentials, weights, width, rows_at(out, (0, 1), start))


@kernel
def _set_along_x(
    forces: _Forces,
    line: int,
    ends: tuple[int, int],
    weights: tuple[float, float],
    padded: tuple[int, int],
    out: Floats,
) -> None:
    """One row, number `line` of (angle, y)."""
    _, ny, nx = forces.pull.shape
    a, j = line // ny, line % ny
    row = (a + GHOSTS) * padded[0] + (j + GHOSTS) * padded[1]
    _set_between(forces, (a, j, 0), (a, j, 1), weights, nx - 1, out, row + GHOSTS)
    # Beyond a wall the mirror image: the same work, the other way. Beyond a periodic side that of the
    # other one; the last cell's work then leads to the first cell. Else the work goes on.
    # Of a padded row both lower ghosts, the last cell, and both upper ghosts.
    for end in (0, 1, nx + 1, nx + GHOSTS, nx + GHOSTS + 1):
        i, sign = _source(end, nx, ends)
        if sign != 0.0:
            signed, beyond = (sign * weights[0], sign * weights[1]), (a, j, (i + 1) % nx)
            _set_between(forces, (a, j, i), beyond, signed, 1, out, row + end)


@kernel
def _set_along_y(
    forces: _Forces,
    line: int,
    ends: tuple[int, int],
    weights: tuple[float, float],
    padded: tuple[int, int],
    out: Floats,
) -> None:
    """From one row to the next, number `line` of (angle, padded y)."""
    _, ny, nx = forces.pull.shape
    a, row = line // (ny + 2 * GHOSTS), line % (ny + 2 * GHOSTS)
    j, sign = _source(row, ny, ends)
    if sign != 0.0:
        # Sums and differences of forces change sign exactly, so mirrored work does as well.
        signed = sign * weights[0], sign * weights[1]
        start = (a + GHOSTS) * padded[0] + row * padded[1] + GHOSTS
        # Whole rows at once: along y neighbours are rows, and the loop goes along x.
        _set_between(forces, (a, j, 0), (a, (j + 1) % ny, 0), signed, nx, out, start)


@kernel
def _set_along_angle(
    forces: _Forces, line: int, weights: tuple[float, float], padded: tuple[int, int], out: Floats
) -> None:
    """From one angle to the next, number `line` of (y, padded angle), which is periodic."""
    na, _, nx = forces.pull.shape
    j, layer = line // (na + 2 * GHOSTS), line % (na + 2 * GHOSTS)
    # The ghost layers of the angle are periodic images.
    a = (layer - GHOSTS) % na
    start = layer * padded[0] + (j + GHOSTS) * padded[1] + GHOSTS
    _set_between(forces, (a, j, 0), ((a + 1) % na, j, 0), weights, nx, out, start)


@parallel_kernel
def _set_work(
    pull: Floats,
    potential: Floats | None,
    distinct: int,
    axis: int,
    ends: tuple[int, int],
    weights: tuple[float, float],
    out: Floats,
) -> None:
    na, ny, nx = pull.shape
    # Plane and row of padded fields.
    row = nx + 2 * GHOSTS
    plane = (ny + 2 * GHOSTS) * row
    # Along y and along the angle ghosts are rows of their own.
    lines = na * ny if axis == -1 else na * (ny + 4) if axis == -2 else ny * (na + 4)
    for line in numba.prange(lines):
        # Made within the loop: shared loops take plain arguments.
        forces, number = _Forces(pull, potential, distinct), signed(line)
        if axis == -1:
            _set_along_x(forces, number, ends, weights, (plane, row), out)
        elif axis == -2:
            _set_along_y(forces, number, ends, weights, (plane, row), out)
        else:
            _set_along_angle(forces, number, weights, (plane, row), out)


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
        What the lower and the upper end of x or y do: STOPS, MIRRORS, WRAPS or PASSES.
    weights : (float, float)
        h/2 and w.
    out : (2, (na + 4) (ny + 4) (nx + 4))
        exp(g/2), g held between +-`STEEPEST`, and the rest of g. Cells without work keep what they
        have: 1 and 0.
    """
    distinct = 1 if potential is None else potential.shape[0]
    _set_work(pull, potential, distinct, axis, ends, weights, out)


@inline_kernel
def _set_ahead_cell(
    i: int, density: Rows, low: Rows, high: Rows, factors: Values, out: Rows
) -> None:
    leaving = total(mul(factors, sub(load(high, i), load(low, i))))
    store(out, i, sub(load(density, i), leaving))


@kernel(noalias=True)
def _set_ahead_row(
    density: Rows, low: Rows, high: Rows, factors: Values, width: int, out: Rows
) -> None:
    over_row(width, _set_ahead_cell, (density, low, high, factors, out))


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
    # Rows of one number, so that a neighbour along any axis is a row of its own.
    numbers = fields.reshape(-1, 1)
    for task in numba.prange(na * ny):
        a, j = task // ny, task % ny
        row = (a + GHOSTS) * fields.shape[2] + j + GHOSTS
        # Of each momentum the flat number of the row's first cell.
        here = axpy(momenta, cells, row * fields.shape[3] + GHOSTS)
        low, high = rows_at(numbers, sub(here, strides), 0), rows_at(numbers, add(here, strides), 0)
        _set_ahead_row(
            rows_at(fields, (row,), GHOSTS), low, high, factors, nx, rows_at(out, (task,), 0)
        )


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
