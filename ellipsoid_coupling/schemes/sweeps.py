"""One step of transport in one direction, in place and with one pass over memory.

Along x (stride 1) a row is finished on its own. Across rows (y, angle) a bundle of columns, narrow
enough for its rows to stay in cache, marches through the rows:

    row p + 1 :  outflow is computed while row p still holds its old values
    row p     :  is then updated from the outflows of rows p - 1, p and p + 1
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import kernel, parallel_kernel
from ellipsoid_coupling.schemes.fluxes.contract import DENSITY, VACUUM, Flux, Span, outflow
from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]

_BUNDLE = 64
_WORK_ROWS = 6


@kernel
def _update(fields: Floats, first: int, parts: tuple[Floats, Floats, Floats, Floats]) -> None:
    """U -= leaving, U += entering, for a run of cells; what is thinner than VACUUM becomes vacuum.

    parts : (up, down, entering from below, entering from above), each (K, width).
    """
    up, down, from_below, from_above = parts
    width = up.shape[1]
    for k in range(fields.shape[0]):
        for i in range(width):
            fields[k, first + i] += from_below[k, i] + from_above[k, i] - up[k, i] - down[k, i]
    for i in range(width):
        if fields[DENSITY, first + i] <= VACUUM:
            for k in range(fields.shape[0]):
                fields[k, first + i] = 0.0


@parallel_kernel
def sweep_rows(
    flux: Flux,
    fields: Floats,
    first: NDArray[np.int64],
    n: int,
    normal: int,
    ratio: float,
) -> None:
    """Transport along the contiguous axis.

    Parameters
    ----------
    flux : NamedTuple
        Chooses the numerical flux.
    fields : (K, cells) float64
        Padded fields, flat; ghosts filled. Updated in place.
    first : (rows,) int64
        Flat index of each row's first interior cell.
    n : int
        Interior cells of a row.
    normal : int
        Component of the momentum along the row.
    ratio : float
        dt / h.
    """
    components = fields.shape[0]
    for row in numba.prange(first.size):
        up = np.empty((components, n + 2))
        down = np.empty((components, n + 2))
        work = np.empty((_WORK_ROWS, n + 2))
        outflow(flux, fields, Span(first[row] - 1, n + 2, 1, normal), ratio, up, down, work)
        parts = (up[:, 1:-1], down[:, 1:-1], up[:, :-2], down[:, 2:])
        _update(fields, first[row], parts)


@kernel
def _march(flux: Flux, fields: Floats, begin: int, n: int, span: Span, ratio: float) -> None:
    """Sweep a bundle of span.width columns; `begin` is its first interior row's flat index."""
    components, width = fields.shape[0], span.width
    up = np.empty((3, components, width))
    down = np.empty((3, components, width))
    work = np.empty((_WORK_ROWS, width))
    stride = span.stride
    for row in range(-1, n + 1):
        at = begin + row * stride
        new = (row + 3) % 3
        here = Span(at, width, stride, span.normal)
        outflow(flux, fields, here, ratio, up[new], down[new], work)
        if row >= 1:
            old, middle = (row + 1) % 3, (row + 2) % 3
            _update(fields, at - stride, (up[middle], down[middle], up[old], down[new]))


@parallel_kernel
def sweep_columns(
    flux: Flux,
    fields: Floats,
    first: NDArray[np.int64],
    n: int,
    extent: tuple[int, int],
    normal: int,
    ratio: float,
) -> None:
    """Transport across rows: as `sweep_rows`, with extent = (cells of a row, stride to the next).

    first : (bundles of rows,) int64
        Flat index of the first interior cell of each plane that is swept.
    n : int
        Interior rows of a plane.
    """
    length, stride = extent
    bundles = (length + _BUNDLE - 1) // _BUNDLE
    for task in numba.prange(first.size * bundles):
        offset = (task % bundles) * _BUNDLE
        width = min(_BUNDLE, length - offset)
        begin = first[task // bundles] + offset
        _march(flux, fields, begin, n, Span(begin, width, stride, normal), ratio)


def sweep(flux: Flux, fields: Floats, axis: int, normal: int, ratio: float) -> None:
    """Transport padded fields along one axis, in place; their ghosts along it are filled.

    Parameters
    ----------
    fields : (K, ny + 4, nx + 4) or (K, na + 4, ny + 4, nx + 4) float64, contiguous
    axis : int
        -1 for x, -2 for y, -3 for the angle.
    normal : int
        Component of the momentum along it.
    ratio : float
        dt / h.
    """
    components, *padded = fields.shape
    flat = fields.reshape(components, -1)
    index = np.arange(flat.shape[1], dtype=np.int64).reshape(padded)
    inner = index[(slice(GHOSTS, -GHOSTS),) * len(padded)]
    n = inner.shape[axis]
    if axis == -1:
        sweep_rows(flux, flat, np.ascontiguousarray(inner[..., 0].ravel()), n, normal, ratio)
        return
    stride = int(np.prod(padded[axis + 1 :])) if axis != -1 else 1
    planes = np.moveaxis(inner[..., 0], axis + 1, 0)[0].ravel()
    extent = (inner.shape[-1], stride)
    sweep_columns(flux, flat, np.ascontiguousarray(planes), n, extent, normal, ratio)
