"""One look over all cells or particles, for the monitors: sums and extremes in one pass over memory."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import axpy
from ellipsoid_coupling.compiled.jit import (
    apart_kernel,
    inline_kernel,
    kernel,
    parallel_kernel,
    threads_for,
    view_kernel,
)
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.rows import Rows, load, map_fields, rows_at, store
from ellipsoid_coupling.finite_volume.fluxes.contract import DENSITY
from ellipsoid_coupling.finite_volume.grid import GHOSTS

Floats = NDArray[np.float64]

# To look at so many cells takes as long as to wake a thread; rows are dealt out in so many tasks.
_CELLS_PER_THREAD, _TASKS = 100_000, 64

# Sums and extremes over particles are kept in so many lanes, which do not wait for one another.
_LANES = 256
# Realisations are dealt out in so many parts at most, of so many numbers each: to look at those takes
# as long as to wake a thread.
_PARTS, _NUMBERS_PER_PART = 8, 100_000

# A sum, the least density, the sums of rho |v|^2 and of rho omega^2.
_MASS, _LEAST, _MOTION, _SPIN = range(4)


@inline_kernel
def _with_square(inverse: float, total: float, carried: float) -> float:
    return total + carried * carried * inverse


@apart_kernel
def _survey_row(cells: Rows, width: int, sums: Rows) -> None:
    """Add a row to the sums of each column; `cells` ends with the angular momentum, if there is any."""
    for i in range(round_up_to_vectors(width)):
        if i < width:
            cell, before = load(cells, i), load(sums, i)
            rho = cell[DENSITY]
            share = 0.0 if rho == 0.0 else 1.0 / rho
            motion = before[_MOTION] + (cell[1] * cell[1] + cell[2] * cell[2]) * share
            spin = map_fields(_with_square, (share,), (before[_SPIN:], cell[3:]))
            least = min(before[_LEAST], rho)
            store(sums, i, (before[_MASS] + rho, least, motion, *spin))


@parallel_kernel
def _survey(
    fields: Floats,
    components: tuple[int, ...],
    kinds: tuple[int, ...],
    first: int,
    planes: int,
    found: Floats,
) -> None:
    """Surveys of some rows each: found (tasks, 4), the first of them overwritten."""
    rows, columns = fields.shape[2] - 2 * GHOSTS, fields.shape[3] - 2 * GHOSTS
    tasks, lines = found.shape[0], planes * rows
    plane = fields.shape[1] * fields.shape[2]
    for task in numba.prange(tasks):
        sums = np.zeros((len(components), columns))
        sums[_LEAST] = np.inf
        here = rows_at(sums, kinds, 0)
        for line in range(task * lines // tasks, (task + 1) * lines // tasks):
            row = (first + line // rows) * fields.shape[2] + line % rows + GHOSTS
            cells = rows_at(fields, axpy(components, plane, row), GHOSTS)
            _survey_row(cells, columns, here)
        for k in range(len(components)):
            found[task, k] = sums[k].min() if k == _LEAST else sums[k].sum()


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
    found = np.zeros((min(count * rows, _TASKS), 4))
    with threads_for(count * rows * (planes.shape[3] - 2 * GHOSTS), _CELLS_PER_THREAD):
        _survey(planes, components, tuple(range(len(components))), first, count, found)
    mass, motion, spin = (float(found[:, k].sum()) for k in (_MASS, _MOTION, _SPIN))
    least = float(found[:, _LEAST].min())
    if not mass > 0.0:
        return mass, least, (0.0, 0.0)
    # A negative density, which is told by itself, may make the sums negative.
    return mass, least, (math.sqrt(abs(motion) / mass), math.sqrt(abs(spin) / mass))


@view_kernel
def _add_squares(squares: Floats, largest: Floats, velocity: Floats, force: Floats) -> None:
    """Lane by lane: squares += v^2, largest = max(largest, |F|)."""
    for lane in range(velocity.size):
        squares[lane] += velocity[lane] * velocity[lane]
        largest[lane] = max(largest[lane], abs(force[lane]))


@view_kernel
def _add_outside(outside: Floats, place: Floats, low: float, high: float) -> None:
    """Lane by lane, how many places are not within low .. high; NaN is not."""
    for lane in range(place.size):
        # `and` would branch: twice as slow.
        within = (low <= place[lane]) & (place[lane] <= high)
        outside[lane] += 0.0 if within else 1.0


@view_kernel
def _survey_some(
    place: Floats,
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
            kind = 1 if d == 2 else 0
            for first in range(0, number, _LANES):
                run = slice(first, min(first + _LANES, number))
                _add_squares(lanes[kind], lanes[2 + kind], velocity[k, d, run], force[k, d, run])
                if box is not None and d < 2:
                    _add_outside(lanes[4], place[k, d, run], box[d, 0], box[d, 1])


@parallel_kernel
def _survey_shared(
    place: Floats, velocity: Floats, force: Floats, box: Floats | None, lanes: Floats
) -> None:
    """Realisations dealt out among the parts of `lanes` (parts, 5, lanes)."""
    realisations, parts = velocity.shape[0], lanes.shape[0]
    for part in numba.prange(parts):
        some = part * realisations // parts, (part + 1) * realisations // parts
        _survey_some(place, velocity, force, box, some, lanes[part])


@kernel
def _in_all(lanes: Floats, count: int) -> tuple[float, float, float, float, int]:
    """What `survey_particles` returns, of (parts, 5, lanes)."""
    v, omega = math.sqrt(lanes[:, 0].sum() / count), math.sqrt(lanes[:, 1].sum() / count)
    return v, omega, lanes[:, 2].max(), lanes[:, 3].max(), int(lanes[:, 4].sum())


def survey_particles(
    place: Floats, velocity: Floats, force: Floats, box: Floats | None
) -> tuple[float, float, float, float, int]:
    """Root mean squares of v and omega, the largest forces, and how many coordinates are outside.

    Parameters
    ----------
    place, velocity, force : (R, D, N) float64
    box : (2, 2) float64 or None
        The walls, as in `Limits`; None where none reflects.

    Returns
    -------
    v, omega, the largest |F_x| or |F_y|, the largest |F_bar|, coordinates of places beyond `box`.
    """
    realisations, _, number = velocity.shape
    # Not by the number of threads, so that sums always add up in the same order.
    parts = max(1, min(realisations, _PARTS, velocity.size // _NUMBERS_PER_PART))
    lanes = np.zeros((parts, 5, _LANES))
    if parts == 1:
        _survey_some(place, velocity, force, box, (0, realisations), lanes[0])
    else:
        _survey_shared(place, velocity, force, box, lanes)
    return _in_all(lanes, realisations * number)


def largest_magnitude(values: NDArray[np.floating] | None) -> float:
    """The largest absolute value of an array; 0 for None or none."""
    if values is None or values.size == 0:
        return 0.0
    return max(float(values.max()), -float(values.min()))
