"""One look over all cells or particles, for the monitors: sums and extremes in one pass over memory."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import (
    for_each,
    kernel,
    parallel_kernel,
    shares,
    threads_for,
    view_kernel,
)
from ellipsoid_coupling.schemes.fluxes.contract import DENSITY
from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]

# To look at so many cells takes as long as to wake a thread.
_CELLS_PER_THREAD = 20_000

# Sums and extremes over particles are kept in so many lanes, which do not wait for one another.
_LANES = 64
# Realisations are dealt out in so many parts at most, of so many numbers each: to look at those takes
# as long as to wake a thread.
_PARTS, _NUMBERS_PER_PART = 8, 100_000

# A sum, the least density, the sums of rho |v|^2 and of rho omega^2.
_MASS, _LEAST, _MOTION, _SPIN = range(4)


@parallel_kernel
def _survey(fields: Floats, first: int, planes: int, rows: Floats) -> None:
    components, ny = fields.shape[0], fields.shape[2] - 2 * GHOSTS
    for task in numba.prange(planes * ny):
        a, j = first + task // ny, task % ny + GHOSTS
        mass, least, motion, spin = 0.0, np.inf, 0.0, 0.0
        for i in range(GHOSTS, fields.shape[3] - GHOSTS):
            rho = fields[DENSITY, a, j, i]
            share = 0.0 if rho == 0.0 else 1.0 / rho
            x, y = fields[1, a, j, i], fields[2, a, j, i]
            mass += rho
            least = min(least, rho)
            motion += (x * x + y * y) * share
            if components > 3:
                turn = fields[components - 1, a, j, i]
                spin += turn * turn * share
        rows[task, _MASS], rows[task, _LEAST] = mass, least
        rows[task, _MOTION], rows[task, _SPIN] = motion, spin


def survey_cells(fields: Floats) -> tuple[float, float, tuple[float, float]]:
    """The density's sum and least value, and the root mean squares of v and omega.

    Parameters
    ----------
    fields : (K, ny + 4, nx + 4) or (K, na + 4, ny + 4, nx + 4) float64, contiguous
        Padded conserved fields: density, both momenta and, if K > 3, the angular momentum last.
    """
    first = GHOSTS if fields.ndim == 4 else 0
    planes = fields.reshape(fields.shape[0], -1, *fields.shape[-2:])
    count = planes.shape[1] - 2 * first
    rows = np.empty((count * (planes.shape[2] - 2 * GHOSTS), 4))
    with threads_for(rows.shape[0] * (planes.shape[3] - 2 * GHOSTS), _CELLS_PER_THREAD):
        _survey(planes, first, count, rows)
    mass, motion, spin = (float(rows[:, k].sum()) for k in (_MASS, _MOTION, _SPIN))
    if not mass > 0.0:
        return mass, float(rows[:, _LEAST].min()), (0.0, 0.0)
    # A negative density, which is told by itself, may make the sums negative.
    speeds = math.sqrt(abs(motion) / mass), math.sqrt(abs(spin) / mass)
    return mass, float(rows[:, _LEAST].min()), speeds


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
    parts = shares(realisations, min(_PARTS, velocity.size // _NUMBERS_PER_PART))
    lanes, here = np.zeros((len(parts), 5, _LANES)), (place, velocity, force, box)
    for_each(len(parts), lambda k: _survey_some(*here, parts[k], lanes[k]))
    return _in_all(lanes, realisations * number)


def largest_magnitude(values: NDArray[np.floating] | None) -> float:
    """The largest absolute value of an array; 0 for None or none."""
    if values is None or values.size == 0:
        return 0.0
    return max(float(values.max()), -float(values.min()))
