"""Coefficients of the clamped cubic spline on a uniform grid, from nodes and end slopes.

psi(x_i) = (c_i-1 + 4 c_i + c_i+1) / 6,      psi'(x_i) = (c_i+1 - c_i-1) / (2 h)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

Array = NDArray[np.float64]

# f'(0) h from f(0), f(h), ... f(4 h): fourth order, so the spline's own order is kept.
ONE_SIDED = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12.0


class WallVelocity(NamedTuple):
    """Tangential velocity at the sides' nodes: u_y on left and right, u_x on bottom and top.

    left, right : (ny+1,), from bottom to top;  bottom, top : (nx+1,), from left to right.
    NaN where it is not known.
    """

    left: Array
    right: Array
    bottom: Array
    top: Array


def clamped_coefficients(values: Array, first: Array, last: Array, h: float) -> Array:
    """Coefficients (n+3, m) along axis 0 for values (n+1, m) and end derivatives (m,)."""
    n = values.shape[0] - 1
    bands = np.empty((3, n + 1))
    bands[0], bands[1], bands[2] = 1.0, 4.0, 1.0
    # c_-1 = c_1 - 2 h psi'_0 put into the first row, and likewise into the last one.
    bands[0, 1] = bands[2, -2] = 2.0
    right_side = 6.0 * values
    right_side[0] += 2.0 * h * first
    right_side[-1] -= 2.0 * h * last
    inner = solve_banded((1, 1), bands, right_side)
    below = inner[1] - 2.0 * h * first
    above = inner[-2] + 2.0 * h * last
    return np.vstack((below, inner, above))


def _end_slopes(values: Array, h: float) -> tuple[Array, Array]:
    """One-sided derivatives at both ends of axis 0, each (m,)."""
    return ONE_SIDED @ values[:5] / h, -(ONE_SIDED @ values[:-6:-1]) / h


def _known(given: Array, otherwise: Array) -> Array:
    return np.where(np.isnan(given), otherwise, given)


def _slopes(psi: Array, dx: float, dy: float, wall: WallVelocity | None) -> list[Array]:
    """psi_x at left and right (ny+1,), psi_y at bottom and top (nx+1,)."""
    left, right = _end_slopes(np.ascontiguousarray(psi.T), dx)
    bottom, top = _end_slopes(psi, dy)
    if wall is not None:
        left, right = _known(-wall.left, left), _known(-wall.right, right)
        bottom, top = _known(wall.bottom, bottom), _known(wall.top, top)
    # Where psi is constant along a side, nothing crosses it, not even at its ends: a lid that still
    # moves at its corner would otherwise blow through the wall beside it.
    for end in (0, -1):
        if np.ptp(psi[:, end]) == 0.0:
            bottom[end] = top[end] = 0.0
        if np.ptp(psi[end]) == 0.0:
            left[end] = right[end] = 0.0
    return [left, right, bottom, top]


def stream_coefficients(psi: Array, dx: float, dy: float, wall: WallVelocity | None) -> Array:
    """Coefficients (ny+3, nx+3) of psi (ny+1, nx+1), axis order (y, x), walls honoured.

    The mixed derivative at a corner belongs to both of its sides (d u_x/dx = -d u_y/dy); each side
    gives one value by one-sided differences, and their mean is taken.
    """
    left, right, bottom, top = _slopes(psi, dx, dy, wall)
    # psi and its y slopes at the bottom and the top, (ny+3, nx+1), along x first.
    rows = np.vstack((bottom, psi, top))
    along_x = np.array(_end_slopes(np.column_stack((bottom, top)), dx))  # (left/right, bottom/top)
    along_y = np.array(_end_slopes(np.column_stack((left, right)), dy)).T  # the same corners
    mixed = 0.5 * (along_x + along_y)
    first = np.concatenate((mixed[0, :1], left, mixed[0, 1:]))
    last = np.concatenate((mixed[1, :1], right, mixed[1, 1:]))
    in_x = clamped_coefficients(rows.T, first, last, dx).T
    return np.ascontiguousarray(clamped_coefficients(in_x[1:-1], in_x[0], in_x[-1], dy))
