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

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.jit import (
    apart_kernel,
    few_by_few,
    inline_kernel,
    parallel_kernel,
    view_kernel,
)
from ellipsoid_coupling.compiled.loops import block_size, prefetch_block, round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, unpack
from ellipsoid_coupling.compiled.rows import Rows, element, load, map_fields, offset, rows_at, store
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    DENSITY,
    Flux,
    Stencil,
    in_order,
    kept_for,
    through_face,
)
from ellipsoid_coupling.finite_volume.grid import GHOSTS

Floats = NDArray[np.float64]

# Columns that march together: many, since the processor reads ahead in each row; fewer where there are
# few lines, so that threads can share them.
_WIDE, _NARROW, _MANY_LINES = 320, 100, 16
# Cells between two rows from which on the second one is fetched.
_FAR = 16


def bundle_width(columns: int, lines: int) -> int:
    """How many of `columns` march together on each of `lines`; all bundles but the last are alike."""
    most = _WIDE if lines >= _MANY_LINES else _NARROW
    return int(round_up_to_vectors(-(-columns // -(-columns // most))))


class Runs(NamedTuple):
    """What one sweep visits, (T,) int64 map_fields, as flat indices of padded fields.

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
    updated: Values = map_fields(_updated, (new <= flux.vacuum,), (cell, entering, leaving))
    return updated


@view_kernel
def _invert(cells: Rows, vacuum: float, inverse: Floats) -> None:
    """1/rho of as many cells as `inverse` has room for."""
    density = cells[:1]
    for i in range(inverse.size):
        inverse[i] = _inverse(load(density, i)[DENSITY], vacuum)


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
    leaving = map_fields(_nothing, (), (load(cells, 0),))
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


class RowScratch(NamedTuple):
    """Room for one row at a time: 1/rho of its cells, and the mass through its faces."""

    inverses: Floats
    through: Floats


@inline_kernel
def row_scratch(longest: int) -> RowScratch:
    """For rows of at most so many cells, ghosts included."""
    return RowScratch(
        np.empty(round_up_to_vectors(longest) + GHOSTS), np.empty(round_up_to_vectors(longest))
    )


@view_kernel
def sweep_row(
    flux: Flux,
    cells: Rows,
    cell: int,
    width: int,
    ratio: float,
    scratch: RowScratch,
) -> float:
    """Step `width` neighbours along x; `cells` and `cell` begin two ghosts before them.

    Returns the mass that has left through both ends, less what came in.
    """
    whole = round_up_to_vectors(width + 2)
    inverses, through = scratch.inverses[: whole + 2], scratch.through[:whole]
    _invert(cells, flux.vacuum, inverses)
    _along(flux, cells, cell, width, ratio, inverses, through)
    return float(through[width + 1] - through[1])


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
    longest = counts.max() + 2 * GHOSTS
    packed = pack(flux)
    for task in numba.prange(tasks):
        own, scratch = unpack(packed), row_scratch(longest)
        for row in range(task * starts.size // tasks, (task + 1) * starts.size // tasks):
            first, width = starts[row] - GHOSTS, counts[row]
            # Where the next row does not follow at once, the processor does not read on by itself.
            if row + 1 < starts.size and starts[row + 1] - starts[row] > width + _FAR:
                ahead = rows_at(fields, components, starts[row + 1] - GHOSTS)
                prefetch_block(ahead, counts[row + 1] + 2 * GHOSTS)
            cells = rows_at(fields, components, first)
            gone[row] = sweep_row(own, cells, first, width, ratio, scratch)


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
def copy_row(rows: Rows, copies: Rows, width: int) -> None:
    """Copy `width` cells."""
    for i in range(width):
        store(copies, i, load(rows, i))


class March(NamedTuple):
    """A bundle of columns on its way through the rows: first flat cell, rows, columns, row to row."""

    first: int
    length: int
    width: int
    stride: int


@inline_kernel
def march_room(components: tuple[int, ...], width: int) -> Floats:
    """What a march over `width` cells of each row needs, (4, K, width), all zero."""
    return np.zeros((4, len(components), width))


@inline_kernel
def first_row(flux: Flux, components: tuple[int, ...], room: Floats) -> int:
    """Where a march begins.

    What leaves the row before the first one goes into the first one, unless the flux needs no more
    than the face between them.
    """
    return -1 if len(kept_for(flux, rows_at(room[2], components, 0))) > 0 else 0


@view_kernel
def begin_march(flux: Flux, below: Rows, here: Rows, room: Floats) -> None:
    """With the two rows that the first step looks at first."""
    _invert(below, flux.vacuum, room[3, 0])
    _invert(here, flux.vacuum, room[3, 1])


@inline_kernel
def _stepped_row(below: Rows, components: tuple[int, ...], row: int, room: Floats) -> Rows:
    """What a step of the march writes to: the row `below`, unless that is none of the march's."""
    if row < 1:
        ends = rows_at(room[0], components, 0)
        copy_row(below, ends, room.shape[2])
        below = ends
    return below


@inline_kernel
def _kept_in(flux: Flux, components: tuple[int, ...], room: Floats) -> _Room:
    """What the march has kept of the rows before."""
    ups = kept_for(flux, rows_at(room[2], components, 0))
    return _Room(rows_at(room[1], components, 0), ups, room[3, 0], room[3, 1])


@inline_kernel
def _passed(march: March, row: int, room: Floats) -> float:
    """The mass that has left through the end that has been passed, less what came in."""
    if row in (0, march.length):
        through = float(room[1, DENSITY, : march.width].sum())
        return through if row == march.length else -through
    return 0.0


@inline_kernel
def step_march(
    flux: Flux,
    components: tuple[int, ...],
    rows: tuple[Rows, Rows, Rows],
    cell: int,
    march: March,
    row: int,
    ratio: float,
    room: Floats,
) -> float:
    """Step the lowest of three `rows`, of which the middle one is row number `row` of the march.

    cell : flat index of the middle one.
    Returns the mass that has left through the end that has been passed, less what came in.
    """
    below = _stepped_row(rows[0], components, row, room)
    kept = _kept_in(flux, components, room)
    _across(flux, (below, rows[1], rows[2]), cell, march.stride, march.width, ratio, kept)
    return _passed(march, row, room)


@inline_kernel
def _step_march_in_pieces(
    flux: Flux,
    components: tuple[int, ...],
    rows: tuple[Rows, Rows, Rows],
    cell: int,
    march: March,
    row: int,
    ratio: float,
    room: Floats,
    coming: Rows,
) -> float:
    """`step_march`, which asks for the row that is `coming` piece by piece on the way."""
    below, here, above = _stepped_row(rows[0], components, row, room), rows[1], rows[2]
    faces, ups, before, middle = _kept_in(flux, components, room)
    size, piece = room.shape[2], block_size(len(components))
    for first in range(0, size, piece):
        prefetch_block(offset(coming, first), piece)
        part = slice(first, min(first + piece, size))
        three = offset(below, first), offset(here, first), offset(above, first)
        kept = offset(faces, first), offset(ups, first), before[part], middle[part]
        left = march.width - first
        _across(flux, three, cell + first, march.stride, left, ratio, _Room(*kept))
    return _passed(march, row, room)


@inline_kernel
def _turned_to(cell: int, base: int, turn: int) -> int:
    """A cell of a ring, `turn` cells from its `base` to where that comes again; no ring, no turn."""
    if turn > 0:
        return cell + turn if cell < base else cell - turn if cell >= base + turn else cell
    return cell


@view_kernel
def _march(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    march: March,
    ring: tuple[int, int],
    ratio: float,
    rooms: tuple[Floats, Floats],
) -> float:
    """Sweep a bundle of columns; returns the mass that has left through both ends, less what came in.

    ring : the cell in the first row of a periodic direction, and the cells all round; 0 for none.
    rooms : a march's, and two rows, (2, K, whole vectors).
    """
    room, old = rooms
    base, turn = ring
    # Who goes all round comes back to rows that it has changed.
    closed = turn == march.length * march.stride
    if closed:
        for row in range(GHOSTS):
            cells = rows_at(fields, components, march.first + row * march.stride)
            copy_row(cells, rows_at(old[row], components, 0), room.shape[2])
    begin, gone = first_row(flux, components, room), 0.0
    for row in range(begin, march.length + 1):
        cell = march.first + row * march.stride
        middle = _turned_to(cell, base, turn)
        below = rows_at(fields, components, _turned_to(cell - march.stride, base, turn))
        here = rows_at(fields, components, middle)
        above = rows_at(fields, components, _turned_to(cell + march.stride, base, turn))
        if closed and row == march.length:
            here, above = rows_at(old[0], components, 0), rows_at(old[1], components, 0)
        elif closed and row == march.length - 1:
            above = rows_at(old[0], components, 0)
        if row == begin:
            begin_march(flux, below, here, room)
        rows = below, here, above
        # A plane further the processor does not read on by itself. A flux that both sides of a face
        # have a part in keeps it busy for so long that asking is no gain.
        if turn > 0 and begin == 0:
            coming = rows_at(fields, components, _turned_to(cell + 2 * march.stride, base, turn))
            gone += _step_march_in_pieces(
                flux, components, rows, middle, march, row, ratio, room, coming
            )
        else:
            gone += step_march(flux, components, rows, middle, march, row, ratio, room)
    return gone


@parallel_kernel
def _sweep_columns(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    runs: Runs,
    way: tuple[int, int, int],
    ratio: float,
    gone: Floats,
) -> None:
    """See `sweep_runs`; `way` is from row to row, the first row's first cell, and all round or 0."""
    starts, counts, widths = runs
    stride, corner, turn = way
    packed = pack(flux)
    for task in numba.prange(starts.size):
        own = unpack(packed)
        first, row = starts[task], round_up_to_vectors(widths[task])
        if turn == 0:
            # Not beyond the last cell of all, where the march looks at the row above the last one.
            row = min(row, fields.shape[1] - first - (counts[task] + 1) * stride)
        march = March(first, counts[task], widths[task], stride)
        ring = first - (first - corner) // stride * stride, turn
        rooms = march_room(components, row), np.empty((GHOSTS, len(components), row))
        gone[task] = _march(own, fields, components, march, ring, ratio, rooms)


def sweep_runs(
    flux: Flux,
    fields: Floats,
    runs: Runs,
    stride: int,
    normal: int,
    ratio: float,
    ring: tuple[int, int] = (0, 0),
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
    ring : (int, int)
        Of a periodic direction the first interior cell and the distance all round; runs go on from
        the last row to the first one, and no ghosts of the fields are needed (those of arrays that
        belong to the flux are).

    Returns
    -------
    float
        The mass that has left through the ends of runs, less what came in, in units of a cell's
        density.
    """
    gone = np.empty(runs.first.size)
    components = in_order(fields.shape[0], normal)
    with few_by_few(runs.first.size):
        if stride == 1:
            tasks = max(1, min(runs.first.size, 16 * numba.get_num_threads()))
            _sweep_rows(flux, fields, components, runs, ratio, tasks, gone)
        else:
            _sweep_columns(flux, fields, components, runs, (stride, *ring), ratio, gone)
    return float(gone.sum())
