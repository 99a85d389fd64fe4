"""One step of transport in one direction, in place and with one pass over memory.

One loop does all to all fields of a cell:

    U_p += F_{p-1/2} - F_{p+1/2}     as soon as the flux through its upper face is known, for which
                                     the cell above still holds its old values

Along x (stride 1) the last face is kept from one turn of the loop to the next, in registers. Across
rows (y, angle) a bundle of columns, narrow enough for its rows to stay in cache, marches through the
rows, and the last faces are a row in cache. What is swept is a list of runs, so that only cells that
can hold mass are touched.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import apart_kernel, inline_kernel, parallel_kernel, view_kernel
from ellipsoid_coupling.registers import DOUBLES
from ellipsoid_coupling.schemes.fluxes.contract import (
    DENSITY,
    Flux,
    Stencil,
    in_order,
    kept_for,
    through_face,
)
from ellipsoid_coupling.schemes.grid import GHOSTS
from ellipsoid_coupling.tuples import (
    Rows,
    Values,
    each,
    element,
    fetch,
    load,
    rows_at,
    store,
    whole_vectors,
)

Floats = NDArray[np.float64]

# Columns that march together. The wider, the longer the processor reads ahead in each row, which
# counts more than a place in the first cache (angles of 150 x 150 cells: 57 M cells/s with 75
# columns, 131 with 150); narrow where there are few lines, so that threads can share them (an r-grid
# of 800 x 800: 4.0 ms a sweep with 64 columns, 2.8 with 100).
_WIDE, _NARROW, _MANY_LINES = 320, 100, 16
# Cells between two rows from which on the second one is fetched.
_FAR = 16
# Runs that a thread takes at a time, at the most: they differ in length.
_CHUNK = 16


def bundle_width(columns: int, lines: int) -> int:
    """How many of `columns` march together on each of `lines`; all bundles but the last are alike."""
    most = _WIDE if lines >= _MANY_LINES else _NARROW
    return int(whole_vectors(-(-columns // -(-columns // most))))


class Runs(NamedTuple):
    """What one sweep visits, (T,) int64 each, as flat indices of padded fields.

    first : the first cell; length : how many cells it goes along the swept direction; width : how
    many neighbouring columns march together (1 along x).
    """

    first: NDArray[np.int64]
    length: NDArray[np.int64]
    width: NDArray[np.int64]


@inline_kernel
def _nothing(_: float) -> float:
    return 0.0


@inline_kernel
def _updated(empty: bool, content: float, entering: float, leaving: float) -> float:
    """U + F_- - F_+; nothing where the density has come to nothing."""
    return 0.0 if empty else content + (entering - leaving)


@inline_kernel
def _inverse(density: float, vacuum: float) -> float:
    """1/rho, 0 in vacuum."""
    return 1.0 / density if density > vacuum else 0.0


@inline_kernel
def _update(flux: Flux, cell: Values, entering: Values, leaving: Values) -> Values:
    """What a cell holds after the step; what is as thin as the vacuum is emptied.

    Written so that NaN is no vacuum: it shall be found.
    """
    new = cell[DENSITY] + (entering[DENSITY] - leaving[DENSITY])
    updated: Values = each(_updated, (new <= flux.vacuum,), (cell, entering, leaving))
    return updated


@view_kernel
def _invert(fields: Floats, first: int, vacuum: float, inverse: Floats) -> None:
    """1/rho of the cells from `first` on, as many as `inverse` has room for."""
    density = fields[DENSITY, first : first + inverse.size]
    for i in range(inverse.size):
        inverse[i] = _inverse(density[i], vacuum)


@apart_kernel
def _along(
    flux: Flux,
    cells: Rows,
    cell: int,
    width: int,
    ratio: float,
    inverses: Floats,
    through: Floats,
) -> None:
    """Step `width` neighbours along x, of which two `cells` before them are the first.

    cell : their flat index; inverses : 1/rho from there on.
    through : overwritten by the mass that goes up through the face above cells[i], for each i.
    """
    leaving = each(_nothing, (), (load(cells, 0),))
    up = kept_for(flux, leaving)
    for i in range(through.size):
        here = Stencil(
            load(cells, i),
            load(cells, i + 1),
            load(cells, i + 2),
            (inverses[i], element(inverses, i + 1), element(inverses, i + 2)),
            cell + i + 1,
            1,
        )
        entering = leaving
        leaving, up = through_face(flux, here, up, ratio)
        through[i] = leaving[DENSITY]
        if i >= GHOSTS and i < width + GHOSTS:
            store(cells, i, _update(flux, here.below, entering, leaving))


@parallel_kernel
def _sweep_rows(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    runs: Runs,
    ratio: float,
    tasks: int,
    gone: Floats,
) -> None:
    starts, counts, _ = runs
    longest = whole_vectors(counts.max() + 2)
    for task in numba.prange(tasks):
        inverses, through = np.empty(longest + 2), np.empty(longest)
        for row in range(task * starts.size // tasks, (task + 1) * starts.size // tasks):
            first, width = starts[row] - GHOSTS, counts[row]
            # Where the next row does not follow at once, the processor does not read on by itself.
            if row + 1 < starts.size and starts[row + 1] - starts[row] > width + _FAR:
                ahead = rows_at(fields, components, starts[row + 1] - GHOSTS)
                _fetch(ahead, counts[row + 1] + 2 * GHOSTS)
            whole = whole_vectors(width + 2)
            _invert(fields, first, flux.vacuum, inverses[: whole + 2])
            cells = rows_at(fields, components, first)
            _along(flux, cells, first, width, ratio, inverses, through[:whole])
            gone[row] = through[width + 1] - through[1]


@view_kernel
def _fetch(rows: Rows, width: int) -> None:
    """Ask for rows before they are needed: the processor does not guess strides as long as a plane."""
    for i in range(0, width, DOUBLES):
        fetch(rows, i)


class _Room(NamedTuple):
    """What a march keeps from row to row, in rows as long as whole vectors.

    Attributes
    ----------
    faces, ups : K rows each
        What has gone through the last face, and what is kept for the next one.
    before, here : (whole vectors,)
        1/rho of the row below and of the middle one.
    """

    faces: Rows
    ups: Rows
    before: Floats
    here: Floats


@apart_kernel
def _across(
    flux: Flux,
    rows: tuple[Rows, Rows, Rows],
    cell: int,
    stride: int,
    width: int,
    ratio: float,
    room: _Room,
) -> None:
    """Step one row of `width` columns: the lowest of three `rows`, now that both its faces are known.

    cell : flat index of the middle one.
    """
    below, here, above = rows
    for i in range(room.here.size):
        highest = load(above, i)
        inverse = (room.before[i], room.here[i], _inverse(highest[DENSITY], flux.vacuum))
        stencil = Stencil(load(below, i), load(here, i), highest, inverse, cell + i, stride)
        leaving, up = through_face(flux, stencil, load(room.ups, i), ratio)
        new = _update(flux, stencil.below, load(room.faces, i), leaving)
        if i < width:
            store(below, i, new)
        store(room.faces, i, leaving)
        store(room.ups, i, up)
        room.before[i] = inverse[1]
        room.here[i] = inverse[2]


@apart_kernel
def _copy(rows: Rows, copies: Rows, width: int) -> None:
    for i in range(width):
        store(copies, i, load(rows, i))


@view_kernel
def _march(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    run: tuple[int, int, int],
    stride: int,
    ratio: float,
    room: Floats,
) -> float:
    """Sweep a bundle of columns; `run` is its first cell's flat index, its length and its width.

    room : (4, K, whole vectors), all zero.
    Returns the mass that has left through both ends, less what came in.
    """
    first, length, width = run
    ends, faces = rows_at(room[0], components, 0), rows_at(room[1], components, 0)
    ups = kept_for(flux, rows_at(room[2], components, 0))
    before, here = room[3, 0], room[3, 1]
    # What leaves the row before the first one goes into the first one, unless the flux needs no more
    # than the face between them.
    begin = -1 if len(ups) > 0 else 0
    _invert(fields, first + (begin - 1) * stride, flux.vacuum, before)
    _invert(fields, first + begin * stride, flux.vacuum, here)
    gone = 0.0
    for row in range(begin, length + 1):
        cell = first + row * stride
        below = rows_at(fields, components, cell - stride)
        if row < 1:
            # Not of this run, and not to be written to.
            _copy(below, ends, before.size)
            below = ends
        rows = (
            below,
            rows_at(fields, components, cell),
            rows_at(fields, components, cell + stride),
        )
        _across(flux, rows, cell, stride, width, ratio, _Room(faces, ups, before, here))
        if row in (0, length):
            through = room[1, DENSITY, :width].sum()
            gone += through if row == length else -through
    return gone


@parallel_kernel
def _sweep_columns(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    runs: Runs,
    stride: int,
    ratio: float,
    gone: Floats,
) -> None:
    starts, counts, widths = runs
    for task in numba.prange(starts.size):
        first = starts[task]
        # Not beyond the last cell of all, where the march looks at the row above the last one.
        row = min(
            whole_vectors(widths[task]), fields.shape[1] - first - (counts[task] + 1) * stride
        )
        room = np.zeros((4, len(components), row))
        run = first, counts[task], widths[task]
        gone[task] = _march(flux, fields, components, run, stride, ratio, room)


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
    components = in_order(fields.shape[0], normal)
    fair = runs.first.size // (4 * numba.get_num_threads())
    with numba.parallel_chunksize(max(1, min(_CHUNK, fair))):
        if stride == 1:
            tasks = max(1, min(runs.first.size, 16 * numba.get_num_threads()))
            _sweep_rows(flux, fields, components, runs, ratio, tasks, gone)
        else:
            _sweep_columns(flux, fields, components, runs, stride, ratio, gone)
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
