"""The stream function of a flow at points: what flows between two of them is the difference of psi."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ellipsoid_coupling.flow.field import FlowArrays

Array = NDArray[np.float64]


def stream_values(flow: FlowArrays, x: ArrayLike, y: ArrayLike) -> Array:
    """Psi at points of any (common) shape; outside, the polynomial of the nearest cell goes on."""
    ny, nx = flow.mask.shape
    column, along_x = _weights((np.asarray(x) - flow.x0) * flow.inverse_dx, nx)
    row, along_y = _weights((np.asarray(y) - flow.y0) * flow.inverse_dy, ny)
    psi = np.zeros(np.broadcast_shapes(column.shape, row.shape))
    for k, weight_y in enumerate(along_y):
        for m, weight_x in enumerate(along_x):
            psi += weight_y * weight_x * flow.coefficients[row + k, column + m]
    return psi


def _weights(position: Array, cells: int) -> tuple[NDArray[np.int64], tuple[Array, ...]]:
    """The cell of positions in units of cells, and the four B-splines there."""
    cell = np.clip(np.floor(position), 0, cells - 1).astype(np.int64)
    t = position - cell
    s = 1.0 - t
    inner = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t), 2.0 / 3.0 - s * s * (1.0 - 0.5 * s)
    return cell, (s**3 / 6.0, *inner, t**3 / 6.0)
