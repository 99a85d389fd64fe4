"""The bicubic spline whose coefficients fit many equations best, in the sense of least squares.

Each equation takes the 16 coefficients around a point, or differences of neighbouring ones, so the normal
equations are sparse: a coefficient meets 7 x 7 others. They are solved by elimination in the order of
nested dissection, which for n coefficients takes n^(3/2) operations and n log n numbers:

    1 1 1 1 | 2 2 2 2       first the parts, then the strip between them, as wide as equations reach;
    1 1 1 1 | 2 2 2 2       each part is divided in the same way
"""

from __future__ import annotations

from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import splu

from ellipsoid_coupling.flow.polygons import Index

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Coefficients that are eliminated without further division.
_SMALL = 64


class Nodes(NamedTuple):
    """A uniform grid: its lower left node, the steps, and the numbers of cells."""

    x0: float
    y0: float
    dx: float
    dy: float
    nx: int
    ny: int

    @property
    def shape(self) -> tuple[int, int]:
        """(ny+3, nx+3), of the coefficients."""
        return self.ny + 3, self.nx + 3

    def lines(self) -> tuple[Array, Array]:
        """(nx+1,) and (ny+1,): where its nodes are."""
        x = self.x0 + self.dx * np.arange(self.nx + 1, dtype=np.float64)
        return x, self.y0 + self.dy * np.arange(self.ny + 1, dtype=np.float64)

    def cells(self, at: Array) -> tuple[Index, Index, Array]:
        """The row and the column of the cell of each point (n, 2), and where in it each is (n, 2)."""
        scaled = (at - (self.x0, self.y0)) / (self.dx, self.dy)
        cell = np.clip(np.floor(scaled), 0, (self.nx - 1, self.ny - 1)).astype(np.int64)
        return cell[:, 1], cell[:, 0], scaled - cell

    def around(self, at: Array) -> Mask:
        """(ny, nx), the cells of points (n, 2)."""
        found = np.zeros((self.ny, self.nx), np.bool_)
        row, column, _ = self.cells(at)
        found[row, column] = True
        return found

    def needed(self, cells: Mask) -> Mask:
        """(ny+3, nx+3), the coefficients that the spline in cells (ny, nx) takes."""
        needed = np.zeros(self.shape, np.bool_)
        for i in range(4):
            for j in range(4):
                needed[i : i + self.ny, j : j + self.nx] |= cells
        return needed


class Equations(NamedTuple):
    """rows (n, coefficients) of a sparse matrix, and right-hand sides (n,)."""

    rows: csr_array
    values: Array

    def weighted(self, weight: float) -> Equations:
        """The same, counting weight^2 times as much."""
        return Equations(weight * self.rows, weight * self.values)


def spline_rows(nodes: Nodes, at: Array, along: str) -> csr_array:
    """(n, coefficients): the spline at points (n, 2), along "": itself, "x" or "y": its derivative."""
    row, column, within = nodes.cells(at)
    x, y = (
        _weights(within[:, k], step if name == along else None)
        for k, (name, step) in enumerate((("x", nodes.dx), ("y", nodes.dy)))
    )
    columns = nodes.shape[1]
    offset = columns * np.arange(4)[:, None] + np.arange(4)
    place = (row * columns + column)[:, None] + offset.ravel()
    weights = y[:, :, None] * x[:, None, :]
    begins = np.arange(len(at) + 1) * 16
    return csr_array(
        (weights.ravel(), place.ravel(), begins), shape=(len(at), columns * nodes.shape[0])
    )


def _weights(t: Array, step: float | None) -> Array:
    """(n, 4), the cubic B-splines at t in a cell, or their derivatives where a step is given."""
    s = 1.0 - t
    if step is not None:
        slopes = -0.5 * s * s, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t * t
        return np.stack(slopes, axis=-1) / step
    inner = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t), 2.0 / 3.0 - s * s * (1.0 - 0.5 * s)
    return np.stack((s**3 / 6.0, *inner, t**3 / 6.0), axis=-1)


def third_differences(used: Mask) -> Equations:
    """That psi's third differences vanish: x^3, x^2 y, x y^2, y^3, each as often as it occurs.

    used : (ny+3, nx+3), the coefficients that are looked for
    """
    numbers = np.arange(used.size).reshape(used.shape)
    parts = []
    for order_y in range(4):
        order_x = 3 - order_y
        rows, columns = used.shape[0] - order_y, used.shape[1] - order_x
        windows, factors, known = [], [], np.ones((rows, columns), np.bool_)
        for i in range(order_y + 1):
            for j in range(order_x + 1):
                here = np.s_[i : i + rows, j : j + columns]
                windows.append(numbers[here])
                factors.append((-1.0) ** (i + j) * comb(order_y, i) * comb(order_x, j))
                known &= used[here]
        place = np.stack([window[known] for window in windows], axis=-1)
        factor = np.sqrt(comb(3, order_y)) * np.tile(factors, len(place))
        begins = np.arange(len(place) + 1) * len(factors)
        parts.append(csr_array((factor, place.ravel(), begins), shape=(len(place), used.size)))
    joined = csr_array(vstack(parts))
    return Equations(joined, np.zeros(joined.shape[0]))


def solve(equations: list[Equations], used: Mask, reach: int = 3, rounds: int = 0) -> Array:
    """(ny+3, nx+3), the best coefficients; those that are not used repeat the nearest one that is.

    reach : how far apart coefficients of one equation are at most
    rounds : of refinement, for equations whose squares lose too many digits
    """
    free = np.flatnonzero(used)
    rows = csr_array(vstack([part.rows for part in equations])).tocsc()[:, free].tocsr()
    values = np.concatenate([part.values for part in equations])
    order = _dissected(np.stack(np.divmod(free, used.shape[1])), reach // 2)
    rows = rows[:, order]
    normal = (rows.T @ rows).tocsc()
    factors = splu(
        normal, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    found = factors.solve(rows.T @ values)
    for _ in range(rounds):
        found = found + factors.solve(rows.T @ (values - rows @ found))
    coefficients = np.zeros(used.shape)
    coefficients.ravel()[free[order]] = found
    nearest = distance_transform_edt(~used, return_distances=False, return_indices=True)
    return np.ascontiguousarray(coefficients[tuple(nearest)])


def _dissected(places: Index, half: int = 1) -> Index:
    """An order of elimination (n,) for coefficients at rows and columns (2, n).

    half : of a strip's width
    """
    order: list[Index] = []
    # Parts are put in front of what has been put before: strips first, then both of their sides.
    waiting = [np.arange(places.shape[1])]
    while waiting:
        part = waiting.pop()
        along = places[int(np.argmax(np.ptp(places[:, part], axis=1)))][part]
        if part.size <= _SMALL or np.ptp(along) <= 2 * half:
            order.append(part)
            continue
        middle = int(np.median(along))
        strip = np.abs(along - middle) <= half
        order.append(part[strip])
        sides = part[along < middle - half], part[along > middle + half]
        waiting += [side for side in sides if side.size]
    return np.concatenate(order[::-1])
