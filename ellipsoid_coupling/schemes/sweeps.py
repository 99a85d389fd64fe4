"""One step of transport in one direction, in place and with one pass over memory.

Along x (stride 1) a row is finished on its own. Across rows (y, angle) a bundle of columns, narrow
enough for its rows to stay in cache, marches through the rows:

    row p + 1 :  outflow is computed while row p still holds its old values
    row p     :  is then updated from the outflows of rows p - 1, p and p + 1

What is swept is a list of runs, so that only cells that can hold mass are touched.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import kernel, parallel_kernel
from ellipsoid_coupling.schemes.fluxes.contract import DENSITY, Flux, Span, outflow, run_of
from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]

# Columns that march together. The wider, the longer the processor reads ahead in each row, which
# counts more than a place in the first cache (angles of 150 x 150 cells: 57 M cells/s with 75
# columns, 131 with 150); narrow where there are few lines, so that threads can share them.
_WIDE, _NARROW, _MANY_LINES = 320, 64, 16
_WORK_ROWS = 6
# Runs that a thread takes at a time, at the most: they differ in length.
_CHUNK = 16


def bundle_width(columns: int, lines: int) -> int:
    """How many of `columns` march together on each of `lines`; all bundles but the last are alike."""
    most = _WIDE if lines >= _MANY_LINES else _NARROW
    return -(-columns // -(-columns // most))


class Runs(NamedTuple):
    """What one sweep visits, (T,) int64 each, as flat indices of padded fields.

    first : the first cell; length : how many cells it goes along the swept direction; width : how
    many neighbouring columns march together (1 along x).
    """

    first: NDArray[np.int64]
    length: NDArray[np.int64]
    width: NDArray[np.int64]


class _Exchange(NamedTuple):
    """What the cells of a run give and get in a step, each (K, width and more).

    up, down : their own outflow; below, above : those of their lower and upper neighbours.
    at : the columns where each of the four begins.
    """

    up: Floats
    down: Floats
    below: Floats
    above: Floats
    at: tuple[int, int, int, int]


@kernel
def _update(
    fields: Floats, first: int, moved: _Exchange, vacuum: float, new_density: Floats
) -> None:
    """U -= leaving, U += entering, for a run of cells; what is as thin as `vacuum` is emptied.

    new_density : (width,) scratch.
    """
    width = new_density.size
    for k in range(fields.shape[0]):
        content = run_of(fields, k, first, width)
        up = run_of(moved.up, k, moved.at[0], width)
        down = run_of(moved.down, k, moved.at[1], width)
        below = run_of(moved.below, k, moved.at[2], width)
        above = run_of(moved.above, k, moved.at[3], width)
        if k == DENSITY:
            for i in range(width):
                new_density[i] = content[i] + (below[i] + above[i] - up[i] - down[i])
        for i in range(width):
            new = content[i] + (below[i] + above[i] - up[i] - down[i])
            content[i] = 0.0 if new_density[i] <= vacuum else new


@parallel_kernel
def _sweep_rows(flux: Flux, fields: Floats, runs: Runs, normal: int, ratio: float) -> None:
    components = fields.shape[0]
    starts, counts, _ = runs
    for row in numba.prange(starts.size):
        first, n = starts[row], counts[row]
        up = np.empty((components, n + 2))
        down = np.empty((components, n + 2))
        work = np.empty((_WORK_ROWS, n + 2))
        outflow(flux, fields, Span(first - 1, n + 2, 1, normal), ratio, up, down, work)
        moved = _Exchange(up, down, up, down, (1, 1, 0, 2))
        _update(fields, first, moved, flux.vacuum, work[0, :n])


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
            moved = _Exchange(up[middle], down[middle], up[old], down[new], (0, 0, 0, 0))
            _update(fields, at - stride, moved, flux.vacuum, work[0])


@parallel_kernel
def _sweep_columns(
    flux: Flux, fields: Floats, runs: Runs, stride: int, normal: int, ratio: float
) -> None:
    starts, counts, widths = runs
    for task in numba.prange(starts.size):
        first = starts[task]
        _march(flux, fields, first, counts[task], Span(first, widths[task], stride, normal), ratio)


@kernel
def leaving(
    flux: Flux, fields: Floats, runs: Runs, stride: int, normal: int, ratio: float
) -> float:
    """The mass that a step will take out of runs through their ends, less what it will bring in.

    In units of a cell's density; arguments as for `sweep_runs`, which is still to come.
    """
    starts, counts, widths = runs
    total = 0.0
    for task in range(starts.size):
        first, last = starts[task], starts[task] + (counts[task] - 1) * stride
        width = widths[task]
        up, down = np.empty((2, fields.shape[0], width))
        work = np.empty((_WORK_ROWS, width))
        outflow(flux, fields, Span(first, width, stride, normal), ratio, up, down, work)
        total += down[DENSITY].sum()
        outflow(flux, fields, Span(first - stride, width, stride, normal), ratio, up, down, work)
        total -= up[DENSITY].sum()
        outflow(flux, fields, Span(last, width, stride, normal), ratio, up, down, work)
        total += up[DENSITY].sum()
        outflow(flux, fields, Span(last + stride, width, stride, normal), ratio, up, down, work)
        total -= down[DENSITY].sum()
    return total


def sweep_runs(
    flux: Flux,
    fields: Floats,
    runs: Runs,
    stride: int,
    normal: int,
    ratio: float,
) -> None:
    """Transport of all runs in one direction, in place.

    Parameters
    ----------
    flux : NamedTuple
        Chooses the numerical flux.
    fields : (K, cells) float64
        Padded fields, flat; ghosts filled. No run may be a neighbour of another along the
        direction, nor of mass that belongs to none.
    runs : Runs
    stride : int
        Distance of neighbours along the direction, 1 along x.
    normal : int
        Component of the momentum along it.
    ratio : float
        dt / h.
    """
    fair = runs.first.size // (4 * numba.get_num_threads())
    with numba.parallel_chunksize(max(1, min(_CHUNK, fair))):
        if stride == 1:
            _sweep_rows(flux, fields, runs, normal, ratio)
        else:
            _sweep_columns(flux, fields, runs, stride, normal, ratio)


def sweep(
    flux: Flux,
    fields: Floats,
    axis: int,
    normal: int,
    ratio: float,
    left: Floats | None = None,
) -> None:
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
    left : (1,) float64, optional
        What leaves through the boundary is added, in units of a cell's density.
    """
    components, *padded = fields.shape
    index = np.arange(fields[0].size, dtype=np.int64).reshape(padded)
    inner = index[(slice(GHOSTS, -GHOSTS),) * len(padded)]
    # The first cell of every line along the axis; across rows, of every bundle of them.
    first = np.moveaxis(inner, axis, 0)[0]
    if axis == -1:
        first, width = first.ravel(), np.ones(first.size, np.int64)
    else:
        bundle = bundle_width(first.shape[-1], first.size // first.shape[-1])
        offsets = np.arange(0, first.shape[-1], bundle)
        width = np.broadcast_to(
            np.minimum(bundle, first.shape[-1] - offsets), (*first.shape[:-1], offsets.size)
        ).ravel()
        first = first[..., ::bundle].ravel()
    runs = Runs(first, np.full(first.size, inner.shape[axis]), np.ascontiguousarray(width))
    stride = int(np.prod(padded[axis + 1 :])) if axis != -1 else 1
    flat = fields.reshape(components, -1)
    if left is not None:
        left += leaving(flux, flat, runs, stride, normal, ratio)
    sweep_runs(flux, flat, runs, stride, normal, ratio)
