"""One step of transport in one direction, in place and with one pass over memory.

Along x (stride 1) a row is finished on its own. Across rows (y, angle) a bundle of columns, narrow
enough for its rows to stay in cache, marches through the rows:

    row p + 1 :  outflow is computed while row p still holds its old values
    row p     :  is then updated from the outflows of rows p - 1, p and p + 1

What is swept is a list of runs, so that only cells that can hold mass are touched.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.instructions import fetch_ahead
from ellipsoid_coupling.kernels import inline_kernel, parallel_kernel, view_kernel
from ellipsoid_coupling.registers import DOUBLES
from ellipsoid_coupling.schemes.fluxes.contract import (
    DENSITY,
    Flux,
    Inverse,
    Span,
    at_faces,
    invert,
    outflow,
    run_of,
)
from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]

# Columns that march together. The wider, the longer the processor reads ahead in each row, which
# counts more than a place in the first cache (angles of 150 x 150 cells: 57 M cells/s with 75
# columns, 131 with 150); narrow where there are few lines, so that threads can share them (an r-grid
# of 800 x 800: 4.0 ms a sweep with 64 columns, 2.8 with 100).
_WIDE, _NARROW, _MANY_LINES = 320, 100, 16
_WORK_ROWS = 5
# Cells between two rows from which on the second one is fetched.
_FAR = 16
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


@view_kernel
def _update(fields: Floats, first: int, width: int, moved: _Exchange, flux: Flux) -> None:
    """U -= leaving, U += entering, for a run of cells; what is as thin as the vacuum is emptied.

    Written so that NaN is no vacuum: it shall be found.
    """
    vacuum = flux.vacuum
    density = run_of(fields, DENSITY, first, width)
    for k in range(fields.shape[0]):
        content = run_of(fields, k, first, width)
        up = run_of(moved.up, k, moved.at[0], width)
        down = run_of(moved.down, k, moved.at[1], width)
        below = run_of(moved.below, k, moved.at[2], width)
        above = run_of(moved.above, k, moved.at[3], width)
        if at_faces(flux):
            if k == DENSITY:
                for i in range(width):
                    new = density[i] + (below[i] - up[i])
                    density[i] = 0.0 if new <= vacuum else new
            else:
                for i in range(width):
                    new = content[i] + (below[i] - up[i])
                    content[i] = 0.0 if density[i] == 0.0 else new
        elif k == DENSITY:
            for i in range(width):
                new = density[i] + (below[i] + above[i] - up[i] - down[i])
                density[i] = 0.0 if new <= vacuum else new
        else:
            for i in range(width):
                new = content[i] + (below[i] + above[i] - up[i] - down[i])
                content[i] = 0.0 if density[i] == 0.0 else new


@inline_kernel
def _whole(width: int) -> int:
    """So many cells are whole vectors.

    Outflow is computed for those: the rest of a loop goes one cell at a time, which takes as long as
    three vectors. What comes out beyond the run is not used.
    """
    return (width + DOUBLES - 1) // DOUBLES * DOUBLES


@view_kernel
def _mass(flux: Flux, up: Floats, down: Floats) -> float:
    """The mass of two streams: what goes up through the faces of one row less what comes down."""
    upwards: float = up.sum()
    return upwards if at_faces(flux) else upwards - down.sum()


@parallel_kernel
def _sweep_rows(
    flux: Flux,
    fields: Floats,
    runs: Runs,
    normal: int,
    ratio: float,
    tasks: int,
    gone: Floats,
) -> None:
    components = fields.shape[0]
    starts, counts, _ = runs
    longest = _whole(counts.max() + 2)
    for task in numba.prange(tasks):
        up = np.empty((components, longest))
        down = np.empty((components, longest))
        work = np.empty((_WORK_ROWS, longest))
        inverses = np.empty(longest + 2)
        moved = _Exchange(up, down, up, down, (1, 1, 0, 2))
        for row in range(task * starts.size // tasks, (task + 1) * starts.size // tasks):
            here = Span(starts[row] - 1, counts[row] + 2, 1, normal)
            # Where the next row does not follow at once, the processor does not read on by itself.
            if row + 1 < starts.size and starts[row + 1] - starts[row] > counts[row] + _FAR:
                _fetch(fields, (0, components), starts[row + 1] - 2, counts[row + 1] + 4)
            gone[row] = _sweep_row(flux, fields, here, ratio, moved, inverses, work)


@view_kernel
def _sweep_row(
    flux: Flux,
    fields: Floats,
    here: Span,
    ratio: float,
    moved: _Exchange,
    inverses: Floats,
    work: Floats,
) -> float:
    """Sweep a row of cells along itself; `here` has one more cell at either end.

    Returns the mass that has left through both ends, less what came in.
    """
    n = here.width - 2
    cells = Span(here.start, _whole(here.width), here.stride, here.normal)
    invert(fields, cells.start - 1, flux.vacuum, inverses[: cells.width + 2])
    inverse = Inverse(inverses[1:], inverses[2:], inverses)
    outflow(flux, fields, cells, inverse, ratio, moved.up, moved.down, work)
    up, down = moved.up[DENSITY], moved.down[DENSITY]
    gone = _mass(flux, up[n : n + 1], down[n + 1 : n + 2]) - _mass(flux, up[:1], down[1:2])
    _update(fields, here.start + 1, n, moved, flux)
    return gone


@view_kernel
def _fetch(fields: Floats, components: tuple[int, int], first: int, width: int) -> None:
    """Ask for a row before it is needed: the processor does not guess strides as long as a plane.

    A few components at a time: what is on its way has few places, and waits for the rest of them.
    """
    for k in range(components[0], components[1]):
        row = run_of(fields, k, first, width)
        for i in range(0, width, DOUBLES):
            fetch_ahead(row, i)


class _Room(NamedTuple):
    """What a march of a bundle writes to on its way: the last three rows' outflow and inverses.

    Rows are as long as whole vectors.
    """

    up: Floats
    down: Floats
    inverses: Floats
    work: Floats


@view_kernel
def _march(
    flux: Flux, fields: Floats, begin: int, n: int, span: Span, ratio: float, room: _Room
) -> float:
    """Sweep a bundle of span.width columns; `begin` is its first interior row's flat index.

    Returns the mass that has left through both ends, less what came in.
    """
    width, stride = span.width, span.stride
    up, down, inverses, work = room
    gone = 0.0
    for row in range(-2, 0):
        invert(fields, begin + row * stride, flux.vacuum, inverses[row + 3])
    for row in range(-1, n + 1):
        at = begin + row * stride
        new, old, middle = (row + 3) % 3, (row + 1) % 3, (row + 2) % 3
        # Beyond the last row nothing is swept.
        fetched = width if row + 2 < n else 0
        ahead = at + 2 * stride
        _fetch(fields, (0, 1), ahead, fetched)
        invert(fields, at + stride, flux.vacuum, inverses[old])
        inverse = Inverse(inverses[new], inverses[old], inverses[middle])
        here = Span(at, inverses.shape[1], stride, span.normal)
        outflow(flux, fields, here, inverse, ratio, up[new], down[new], work)
        _fetch(fields, (1, 3), ahead, fetched)
        if row in (0, n):
            through = _mass(flux, up[middle, DENSITY, :width], down[new, DENSITY, :width])
            gone += through if row == n else -through
        if row >= 1:
            moved = _Exchange(up[middle], down[middle], up[old], down[new], (0, 0, 0, 0))
            _update(fields, at - stride, width, moved, flux)
        _fetch(fields, (3, fields.shape[0]), ahead, fetched)
    return gone


@parallel_kernel
def _sweep_columns(
    flux: Flux, fields: Floats, runs: Runs, stride: int, normal: int, ratio: float, gone: Floats
) -> None:
    components = fields.shape[0]
    starts, counts, widths = runs
    for task in numba.prange(starts.size):
        first = starts[task]
        # Not beyond the last cell of all, where the march looks at the row above the last one.
        row = min(_whole(widths[task]), fields.shape[1] - first - (counts[task] + 1) * stride)
        room = _Room(
            np.empty((3, components, row)),
            np.empty((3, components, row)),
            np.empty((3, row)),
            np.empty((_WORK_ROWS, row)),
        )
        span = Span(first, widths[task], stride, normal)
        gone[task] = _march(flux, fields, first, counts[task], span, ratio, room)


def sweep_runs(
    flux: Flux,
    fields: Floats,
    runs: Runs,
    stride: int,
    normal: int,
    ratio: float,
) -> float:
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

    Returns
    -------
    float
        The mass that has left through the ends of runs, less what came in, in units of a cell's
        density.
    """
    gone = np.empty(runs.first.size)
    fair = runs.first.size // (4 * numba.get_num_threads())
    with numba.parallel_chunksize(max(1, min(_CHUNK, fair))):
        if stride == 1:
            tasks = max(1, min(runs.first.size, 16 * numba.get_num_threads()))
            _sweep_rows(flux, fields, runs, normal, ratio, tasks, gone)
        else:
            _sweep_columns(flux, fields, runs, stride, normal, ratio, gone)
    return float(gone.sum())


@functools.cache
def _all_runs(padded: tuple[int, ...], axis: int) -> tuple[Runs, int]:
    """The runs along one axis of a padded grid that is filled, and their stride."""
    index = np.arange(math.prod(padded), dtype=np.int64).reshape(padded)
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
    return runs, math.prod(padded[axis + 1 :]) if axis != -1 else 1


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
    runs, stride = _all_runs(fields.shape[1:], axis)
    flat = fields.reshape(fields.shape[0], -1)
    gone = sweep_runs(flux, flat, runs, stride, normal, ratio)
    if left is not None:
        left += gone
