"""Psi and chi of a flow at points, apart from each other, by numpy.

What flows between two points without sources is the difference of psi; grad chi is what sources add.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from ellipsoid_coupling.flow.field import FlowArrays

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Weights = tuple[Array, ...]


def psi_coefficients(flow: FlowArrays) -> Array:
    """(ny+3, nx+3), those of psi alone."""
    return flow.coefficients[: flow.mask.shape[0] + 3]


def stream_values(flow: FlowArrays, x: ArrayLike, y: ArrayLike) -> Array:
    """Psi at points of any (common) shape; outside, the polynomial of the nearest cell goes on."""
    (column, s), (row, r) = _places(flow, x, y)
    return _summed(flow.coefficients, (row, column), _values(r), _values(s))


def chi_slopes(flow: FlowArrays, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """(d chi/dx, d chi/dy) at points of any (common) shape; 0 for a flow without sources."""
    if flow.chi is None:
        none = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
        return none, none
    (column, s), (row, r) = _places(flow, x, y)
    cell = row + flow.chi.row, column
    along_x = _summed(flow.coefficients, cell, _values(r), _slopes(s))
    along_y = _summed(flow.coefficients, cell, _slopes(r), _values(s))
    return flow.inverse_dx * along_x, flow.inverse_dy * along_y


def divergence_values(flow: FlowArrays, x: ArrayLike, y: ArrayLike) -> Array:
    """Div u, the Laplacian of chi, at points of any (common) shape; 0 for a flow without sources."""
    if flow.chi is None:
        return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
    (column, s), (row, r) = _places(flow, x, y)
    cell = row + flow.chi.row, column
    along_x = _summed(flow.coefficients, cell, _values(r), _curvatures(s))
    along_y = _summed(flow.coefficients, cell, _curvatures(r), _values(s))
    return flow.inverse_dx**2 * along_x + flow.inverse_dy**2 * along_y


def _places(
    flow: FlowArrays, x: ArrayLike, y: ArrayLike
) -> tuple[tuple[Index, Array], tuple[Index, Array]]:
    """Column and row of the cells of points, and where in them the points are."""
    ny, nx = flow.mask.shape
    return (
        _place((np.asarray(x) - flow.x0) * flow.inverse_dx, nx),
        _place((np.asarray(y) - flow.y0) * flow.inverse_dy, ny),
    )


def _place(position: Array, cells: int) -> tuple[Index, Array]:
    # What is not a number lies in the first cell, and gives none.
    cell = np.clip(np.nan_to_num(np.floor(position)), 0, cells - 1).astype(np.int64)
    return cell, position - cell


def _summed(
    coefficients: Array, cell: tuple[Index, Index], along_y: Weights, along_x: Weights
) -> Array:
    """The sum of the 16 coefficients of each cell, weighted."""
    row, column = cell
    total = np.zeros(np.broadcast_shapes(column.shape, row.shape))
    for k, weight_y in enumerate(along_y):
        for m, weight_x in enumerate(along_x):
            total += weight_y * weight_x * coefficients[row + k, column + m]
    return total


def _values(t: Array) -> Weights:
    """The four B-splines in a cell."""
    s = 1.0 - t
    inner = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t), 2.0 / 3.0 - s * s * (1.0 - 0.5 * s)
    return s**3 / 6.0, *inner, t**3 / 6.0


def _slopes(t: Array) -> Weights:
    """Their derivatives, per cell."""
    s = 1.0 - t
    return -0.5 * s * s, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t * t


def _curvatures(t: Array) -> Weights:
    """Their second derivatives, per cell^2."""
    s = 1.0 - t
    return s, 3.0 * t - 2.0, 3.0 * s - 2.0, t
