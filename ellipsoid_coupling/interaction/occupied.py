"""Which cells of a grid hold mass: one interval in each row, and the rectangle around all of them."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import parallel_kernel
from ellipsoid_coupling.interaction.grid_forces import Array

Indices = NDArray[np.int64]
# (rows, columns)
Box = tuple[slice, slice]


@parallel_kernel
def occupied_extents(density: Array) -> Indices:
    """First and end column of the mass in every row of `density` (na, ny, nx): (na, ny, 2) int64.

    An empty row has the first column nx and the end 0. NaN counts as mass.
    """
    planes, rows, columns = density.shape
    extents = np.empty((planes, rows, 2), np.int64)
    for line in numba.prange(planes * rows):
        a, j = line // rows, line % rows
        row = density[a, j]
        first, end = 0, columns
        # `== 0` is false for NaN, which so counts as mass and is found.
        while first < end and row[first] == 0.0:
            first += 1
        while end > first and row[end - 1] == 0.0:
            end -= 1
        extents[a, j, 0], extents[a, j, 1] = first, end if end > first else 0
    return extents


def occupied_box(extents: Indices) -> Box | None:
    """The smallest rectangle outside which no plane holds mass; None if all planes are empty.

    extents : (na, ny, 2) int64, of `occupied_extents`.
    """
    held = extents[..., 1] > 0
    rows = np.flatnonzero(np.any(held, axis=0))
    if rows.size == 0:
        return None
    columns = int(extents[held, 0].min()), int(extents[..., 1].max())
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(*columns)


def contains(outer: Box, inner: Box) -> bool:
    """Whether `inner` lies in `outer`."""
    return all(a.start <= b.start and b.stop <= a.stop for a, b in zip(outer, inner, strict=True))
