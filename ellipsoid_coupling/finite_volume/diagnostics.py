"""Sums and extremes over all cells or particles in one pass over memory, for the monitors."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import add, axpy, mul, scale
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import chunk, over_row
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.compiled.threads import threads_for
from ellipsoid_coupling.compiled.tuning import (
    CELLS_PER_THREAD,
    NUMBERS_PER_PART,
    ROW_TASKS,
    SURVEY_LANES,
    SURVEY_PARTS,
)
from ellipsoid_coupling.finite_volume.fluxes.contract import DENSITY
from ellipsoid_coupling.finite_volume.grid import GHOSTS

Floats = NDArray[np.float64]

# Columns of what is surveyed: the sum and the least value of the density, the sums of rho |v|^2 and of
# rho omega^2.
_MASS, _LEAST, _MOTION, _SPIN = range(4)


@inline_kernel
def _survey_cell(i: int, cells: Rows, sums: Rows) -> None:
    cell, before = load(cells, i), load(sums, i)
    rho = cell[DENSITY]
    # Vacuum has no momentum: 0/0 would be NaN, 0 is what it adds.
    inverse = 0.0 if rho == 0.0 else 1.0 / rho
    motion = before[_MOTION] + (cell[1] * cell[1] + cell[2] * cell[2]) * inverse
    # One number, or none where there is no angle.
    angular_momentum = cell[3:]
    spin = add(before[_SPIN:], scale(inverse, mul(angular_momentum, angular_momentum)))
    store(sums, i, (before[_MASS] + rho, min(before[_LEAST], rho), motion, *spin))


@kernel(noalias=True)
def _survey_row(cells: Rows, width: int, sums: Rows) -> None:
    """Add a row to the sums of each column; `cells` ends with the angular momentum, if there is any."""
    over_row(width, _survey_cell, (cells, sums))


@parallel_kernel
def _survey(
    fields: Floats,
    components: tuple[int, ...],
    kinds: tuple[int, ...],
    first: int,
    planes: int,
    surveys: Floats,
) -> None:
    """One survey of some rows for each task: surveys (tasks, 4), as many columns as `kinds`."""
    rows, columns = fields.shape[2] - 2 * GHOSTS, fields.shape[3] - 2 * GHOSTS
    tasks, lines = surveys.shape[0], planes * rows
    plane = fields.shape[1] * fields.shape[2]
    for task in numba.prange(tasks):
        # One sum for each column of cells: additions along x do not wait for each other.
        sums = np.zeros((len(components), columns))
        sums[_LEAST] = np.inf
        here = rows_at(sums, kinds, 0)
        begin, end = chunk(task, tasks, lines)
        for line in range(begin, end):
            row = (first + line // rows) * fields.shape[2] + line % rows + GHOSTS
            cells = rows_at(fields, axpy(components, plane, row), GHOSTS)
            _survey_row(cells, columns, here)
        for k in range(len(components)):
            surveys[task, k] = sums[k].min() if k == _LEAST else sums[k].sum()


def survey_cells(fields: Floats) -> tuple[float, float, tuple[float, float]]:
    """The density's sum and least value, and the root mean squares of v and omega.

    Parameters
    ----------
    fields : (K, ny + 4, nx + 4) or (K, na + 4, ny + 4, nx + 4) float64, contiguous
        Padded conserved fields: density, both momenta and, if K > 3, the angular momentum last.
    """
    first = GHOSTS if fields.ndim == 4 else 0
    planes = fields.reshape(fields.shape[0], -1, *fields.shape[-2:])
    count, rows = planes.shape[1] - 2 * first, planes.shape[2] - 2 * GHOSTS
    components = (0, 1, 2, fields.shape[0] - 1)[: min(fields.shape[0], 4)]
    surveys = np.zeros((min(count * rows, ROW_TASKS), 4))
    with threads_for(count * rows * (planes.shape[3] - 2 * GHOSTS), CELLS_PER_THREAD):
        _survey(planes, components, tuple(range(len(components))), first, count, surveys)
    mass, motion, spin = (float(surveys[:, k].sum()) for k in (_MASS, _MOTION, _SPIN))
    # Tasks follow from the rows alone, so that the sums have one order.
    least = float(surveys[:, _LEAST].min())
    if not mass > 0.0:
        return mass, least, (0.0, 0.0)
    # A negative density, which `least` reports, may make the sums negative.
    return mass, least, (math.sqrt(abs(motion) / mass), math.sqrt(abs(spin) / mass))


@kernel(noalias=True)
def _add_squares(squares: Floats, largest: Floats, velocity: Floats, force: Floats) -> None:
    """Lane by lane: squares += v^2, largest = max(largest, |F|)."""
    for lane in range(velocity.size):
        squares[lane] += velocity[lane] * velocity[lane]
        largest[lane] = max(largest[lane], abs(force[lane]))


@kernel(noalias=True)
def _add_outside(outside: Floats, position: Floats, low: float, high: float) -> None:
    """Lane by lane, how many positions are not within low .. high; NaN is not."""
    for lane in range(position.size):
        # `and` would branch: twice as slow.
        within = (low <= position[lane]) & (position[lane] <= high)
        outside[lane] += 0.0 if within else 1.0


@kernel(noalias=True)
def _survey_some(
    position: Floats,
    velocity: Floats,
    force: Floats,
    box: Floats | None,
    realisations: tuple[int, int],
    lanes: Floats,
) -> None:
    """Some realisations to `lanes` (5, lanes): squares of v and omega, largest |F| of both, outside."""
    _, components, number = velocity.shape
    for k in range(realisations[0], realisations[1]):
        for d in range(components):
            # Angular velocity and torque have units of their own, and so lanes.
            kind = 1 if d == 2 else 0
            for first in range(0, number, SURVEY_LANES):
                run = slice(first, min(first + SURVEY_LANES, number))
                _add_squares(lanes[kind], lanes[2 + kind], velocity[k, d, run], force[k, d, run])
                if box is not None and d < 2:
                    _add_outside(lanes[4], position[k, d, run], box[d, 0], box[d, 1])


@parallel_kernel
def _survey_shared(
    position: Floats, velocity: Floats, force: Floats, box: Floats | None, lanes: Floats
) -> None:
    """All realisations, cut into the parts of `lanes` (parts, 5, lanes)."""
    realisations, parts = velocity.shape[0], lanes.shape[0]
    for part in numba.prange(parts):
        _survey_some(position, velocity, force, box, chunk(part, parts, realisations), lanes[part])


@kernel
def _in_all(lanes: Floats, count: int) -> tuple[float, float, float, float, int]:
    """What `survey_particles` returns, of (parts, 5, lanes)."""
    v, omega = math.sqrt(lanes[:, 0].sum() / count), math.sqrt(lanes[:, 1].sum() / count)
    return v, omega, lanes[:, 2].max(), lanes[:, 3].max(), int(lanes[:, 4].sum())


def survey_particles(
    position: Floats, velocity: Floats, force: Floats, box: Floats | None
) -> tuple[float, float, float, float, int]:
    """Root mean squares of v and omega, the largest forces, and how many coordinates are outside.

    Parameters
    ----------
    position, velocity, force : (R, D, N) float64
    box : (2, 2) float64 or None
        The walls, as in `Limits`; None where none reflects.

    Returns
    -------
    v, omega, the largest |F_x| or |F_y|, the largest |F_bar|, coordinates of positions beyond `box`.
    """
    realisations, _, number = velocity.shape
    # Not by the number of threads, so that sums always add up in the same order.
    parts = max(1, min(realisations, SURVEY_PARTS, velocity.size // NUMBERS_PER_PART))
    lanes = np.zeros((parts, 5, SURVEY_LANES))
    # To wake threads would take longer.
    if parts == 1:
        _survey_some(position, velocity, force, box, (0, realisations), lanes[0])
    else:
        _survey_shared(position, velocity, force, box, lanes)
    return _in_all(lanes, realisations * number)


def largest_magnitude(values: NDArray[np.floating] | None) -> float:
    """The largest absolute value of an array; 0 for None or none."""
    if values is None or values.size == 0:
        return 0.0
    # Two looks, and no array of absolute values.
    return max(float(values.max()), -float(values.min()))
