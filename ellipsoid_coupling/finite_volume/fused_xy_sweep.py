"""One step of transport along x and along y, in place and with one pass over memory for both.

To sweep one direction after the other brings all fields through memory twice. Here a strip of rows is
swept along x row by row, just ahead of the march along y, or just behind it where y comes first, while
the rows are in cache:

    x first                                    y first
    row j + 2   swept along x now              row j       swept along y now
    row j       swept along y now              row j - 1   as y has left it
    row j - 1   done                           row j - 2   swept along x now, its ghosts filled

A strip looks at two rows beyond each of its cuts (`strips.py`), which another thread changes: it reads
copies of these, made before (and swept along x where x comes first). The result is that of two sweeps,
bit for bit.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import prefetch_block, round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.rows import Rows, rows_at
from ellipsoid_coupling.compiled.simd_vectors import DOUBLES
from ellipsoid_coupling.compiled.threads import small_chunks
from ellipsoid_coupling.compiled.tuning import ROWS_AHEAD
from ellipsoid_coupling.finite_volume.boundary import fill_ends, fill_sides
from ellipsoid_coupling.finite_volume.fluxes.contract import Flux, in_order
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.march import (
    March,
    begin_march,
    copy_row,
    first_row,
    march_workspace,
    step_march,
)
from ellipsoid_coupling.finite_volume.strips import Plane, Strips
from ellipsoid_coupling.finite_volume.sweep import RowScratch, row_scratch, sweep_row
from ellipsoid_coupling.geometry.ghost_table import GhostTable

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# Rows beside a cut that are copied: as many as ghosts on either side.
_COPIED = 2 * GHOSTS


class Move(NamedTuple):
    """One step: x or y first, dt / h, and the time at its start."""

    x_first: bool
    ratio: float
    t: float


class _Whole(NamedTuple):
    """What all strips have in common; see `sweep_planes`.

    x, y : components in the order of a sweep along x and along y.
    copies : (cuts, 4, K, row), the rows beside cuts.
    table : of the ghosts.
    gone : (planes, rows + 2), the mass that has left through the ends of each row, and of each plane.
    """

    fields: Floats
    copies: Floats
    x: tuple[int, ...]
    y: tuple[int, ...]
    plane: Plane
    strips: Strips
    spans: Indices
    move: Move
    gone: Floats
    table: GhostTable


@inline_kernel
def _line_of(plane: Plane, cell: int) -> tuple[int, int]:
    """The plane and the row of a flat cell."""
    line, lines = (cell - plane.corner) // plane.row, plane.next_plane // plane.row
    return line // lines, line % lines


@inline_kernel
def _start_of(plane: Plane, cell: int) -> int:
    """The first ghost of a cell's row."""
    return plane.corner - GHOSTS + (cell - plane.corner) // plane.row * plane.row


@inline_kernel
def _fill_row(cells: Rows, whole: _Whole, a: int, j: int) -> None:
    """Fill the ghosts of row j of plane a, if so much of it moves that its sweep looks there."""
    span = whole.spans[a, j]
    if span[1] > 0 and (span[0] < GHOSTS or span[1] > whole.plane.columns - GHOSTS):
        fill_ends(cells, whole.table, a, j, whole.move.t)


@kernel(noalias=True)
def _copy_beside_cut(task: int, flux: Flux, whole: _Whole, scratch: RowScratch) -> None:
    """Copy a row beside a cut and, where x comes first, sweep the copy along x."""
    cut, row = task // _COPIED, task % _COPIED
    plane, move, copy = whole.plane, whole.move, whole.copies[cut, row]
    if row < GHOSTS:
        # Copies 0 and 1 lie below the cut, 2 and 3 above it, as `strips` draws.
        cell = whole.strips.below[cut] + (row + 1 - GHOSTS) * plane.row
    else:
        cell = whole.strips.above[cut] + (row - GHOSTS) * plane.row
    start = _start_of(plane, cell)
    copy_row(rows_at(whole.fields, whole.x, start), rows_at(copy, whole.x, 0), plane.row)
    # A copy has the ghosts and the span of the row that it is of.
    a, j = _line_of(plane, cell)
    if move.x_first:
        span = whole.spans[a, j]
        _fill_row(rows_at(copy, whole.x, 0), whole, a, j)
        if span[1] > 0:
            cells = rows_at(copy, whole.x, span[0])
            sweep_row(flux, cells, start + span[0], span[1] - span[0], move.ratio, scratch)


@kernel(noalias=True)
def _sweep_x(flux: Flux, whole: _Whole, a: int, j: int, scratch: RowScratch) -> None:
    """Sweep what moves of row j of plane a."""
    plane, span = whole.plane, whole.spans[a, j]
    # A sweep begins two cells before the first one that moves.
    first = plane.corner - GHOSTS + a * plane.next_plane + j * plane.row + span[0]
    width = span[1] - span[0]
    if width > 0:
        cells = rows_at(whole.fields, whole.x, first)
        whole.gone[a, j] = sweep_row(flux, cells, first, width, whole.move.ratio, scratch)


class _Strip(NamedTuple):
    """One strip on its way.

    a, j : its plane, and its lowest row there.
    start : the first ghost of that row, a flat cell.
    low, high : the cuts at its ends, -1 where there is none.
    march : along y.
    """

    a: int
    j: int
    start: int
    low: int
    high: int
    march: March


@inline_kernel
def _strip_of(whole: _Whole, number: int) -> _Strip:
    strips, plane = whole.strips, whole.plane
    first = strips.first[number]
    a, j = _line_of(plane, first)
    march = March(first, strips.length[number], strips.width[number], plane.row)
    return _Strip(a, j, _start_of(plane, first), strips.low[number], strips.high[number], march)


@inline_kernel
def _strip_row(whole: _Whole, strip: _Strip, row: int) -> Rows:
    """Row number `row` of a strip; beyond a cut its copy, of which the same column is meant."""
    # A copy is a whole row, ghosts included.
    march, column = strip.march, strip.march.first - strip.start
    rows = rows_at(whole.fields, whole.y, march.first + row * march.stride)
    if row < 0 and strip.low >= 0:
        # Row -2 is copy 0.
        rows = rows_at(whole.copies[strip.low, row + GHOSTS], whole.y, column)
    if row >= march.length and strip.high >= 0:
        # Row `length` is copy 2.
        rows = rows_at(whole.copies[strip.high, row - march.length + GHOSTS], whole.y, column)
    return rows


@inline_kernel
def _fetch_half(whole: _Whole, march: March, row: int, half: int) -> None:
    """Prefetch one half of a row, if the strip has it.

    A whole row exceeds the limit of outstanding misses, and without prefetch the hardware does not read
    on while the rows that are there are worked on.
    """
    part = march.width // 2
    if row < march.length:
        cells = march.first + row * march.stride + half * part
        prefetch_block(rows_at(whole.fields, whole.x, cells), part)


@kernel(noalias=True)
def _fill_beside(whole: _Whole, strip: _Strip, low: bool, high: bool) -> None:
    """Fill the rows of ghosts at the lower and the upper end of a strip, where the strip looks at them."""
    plane, march = whole.plane, strip.march
    # At a cut there are copies instead of ghosts; in the middle of a plane the strip sees none.
    ends = (
        low and strip.j < GHOSTS and strip.low < 0,
        high and strip.j + march.length > plane.rows - GHOSTS and strip.high < 0,
    )
    # The first padded cell of the plane.
    start = plane.corner - GHOSTS * (plane.row + 1) + strip.a * plane.next_plane
    columns = march.first - strip.start - GHOSTS, march.width
    fill_sides(whole.fields, whole.y, whole.table, (strip.a, start), columns, ends, whole.move.t)


@inline_kernel
def _step_y(flux: Flux, whole: _Whole, strip: _Strip, row: int, room: Floats) -> None:
    """Take the march along y one row further: row - 1 gets what both its faces let through."""
    march, plane = strip.march, whole.plane
    three = (
        _strip_row(whole, strip, row - 1),
        _strip_row(whole, strip, row),
        _strip_row(whole, strip, row + 1),
    )
    # 1/rho of both lower rows is kept from then on.
    if row == first_row(flux, whole.y, room):
        begin_march(flux, three[0], three[1], room)
    cell = march.first + row * march.stride
    through = step_march(flux, whole.y, three, cell, march, row, whole.move.ratio, room)
    # Runs that end elsewhere end in vacuum; what passes a seam stays.
    if row == 0 and strip.j == 0 and strip.low < 0:
        whole.gone[strip.a, plane.rows] = through
    if row == march.length and strip.j + row == plane.rows and strip.high < 0:
        whole.gone[strip.a, plane.rows + 1] = through


@kernel(noalias=True)
def _x_then_y(flux: Flux, whole: _Whole, strip: _Strip, scratch: RowScratch, room: Floats) -> None:
    """Sweep along x some rows ahead of the march along y."""
    march = strip.march
    # All ghosts at once: one by one, each would wait for its row to come from memory.
    for row in range(march.length):
        cells = rows_at(whole.fields, whole.x, strip.start + row * march.stride)
        _fill_row(cells, whole, strip.a, strip.j + row)
    swept = 0
    for row in range(first_row(flux, whole.y, room), march.length + 1):
        _fetch_half(whole, march, row + ROWS_AHEAD + 1, 0)
        # The march looks at row + 1, which must have been swept along x.
        while swept < min(row + ROWS_AHEAD, march.length):
            _sweep_x(flux, whole, strip.a, strip.j + swept, scratch)
            swept += 1
            # Ghosts follow from rows that have been swept along x, and not yet along y.
            low, high = swept == min(GHOSTS, march.length), swept == march.length
            if low or high:
                _fill_beside(whole, strip, low, high)
        _fetch_half(whole, march, row + ROWS_AHEAD + 1, 1)
        _step_y(flux, whole, strip, row, room)


@kernel(noalias=True)
def _y_then_x(flux: Flux, whole: _Whole, strip: _Strip, scratch: RowScratch, room: Floats) -> None:
    """Sweep along x a row behind the march along y: what has just been written is not read at once."""
    march, swept = strip.march, 0
    # Nothing has been swept: at both ends ghosts follow from the old rows.
    _fill_beside(whole, strip, True, True)
    for row in range(first_row(flux, whole.y, room), march.length + 1):
        _fetch_half(whole, march, row + GHOSTS, 0)
        _step_y(flux, whole, strip, row, room)
        _fetch_half(whole, march, row + GHOSTS, 1)
        # The march has left row - 1 behind; at its end that is all there is.
        while swept < (row if row == march.length else row - 1):
            cells = rows_at(whole.fields, whole.x, strip.start + swept * march.stride)
            # Ghosts along x follow from the row as the march along y has left it.
            _fill_row(cells, whole, strip.a, strip.j + swept)
            _sweep_x(flux, whole, strip.a, strip.j + swept, scratch)
            swept += 1


@parallel_kernel
def _sweep_planes(copies: int, strips: int, arguments: tuple[Flux, _Whole]) -> None:
    packed = pack(arguments)
    # All copies before any strip: strips change the rows that these are of.
    for task in numba.prange(copies):
        flux, whole = unpack(packed)
        _copy_beside_cut(signed(task), flux, whole, row_scratch(whole.plane.row))
    for task in numba.prange(strips):
        flux, whole = unpack(packed)
        strip, row = _strip_of(whole, signed(task)), whole.plane.row
        march = strip.march
        # Not beyond the last cell of all, where the march looks at the row above the last one.
        left = whole.fields.shape[1] - march.first - (march.length + 1) * row
        room = march_workspace(whole.y, min(round_up_to_vectors(march.width), left))
        if whole.move.x_first:
            _x_then_y(flux, whole, strip, row_scratch(row), room)
        else:
            _y_then_x(flux, whole, strip, row_scratch(row), room)


def sweep_planes(
    flux: Flux,
    fields: Floats,
    plane: Plane,
    strips: Strips,
    spans: Indices,
    move: Move,
    table: GhostTable,
) -> float:
    """Transport along x and y, in place, ghosts included; as sweeps along one and the other would.

    Parameters
    ----------
    flux : NamedTuple
        Chooses the numerical flux.
    fields : (K, cells) float64
        Padded fields, flat: density, momenta along x and y, and whatever else is carried.
    plane : Plane
    strips : Strips
        Of all columns where mass is before or after the march along y. No run may be a neighbour of
        another along y. Cut at the seam where the table has y periodic.
    spans : (planes, rows, 2) int64
        First column and end of what moves along x in each row; the end is 0 where nothing does. Where
        x is periodic, all of a row that moves up to an end of it.
    move : Move
    table : GhostTable
        Of the grid.

    Returns
    -------
    float
        The mass that has left through the boundary, less what came in, in units of a cell's density.
    """
    # A number for each row and for both ends of each plane: their sum does not depend on the strips.
    gone = np.zeros((spans.shape[0], plane.rows + 2))
    x, y = in_order(fields.shape[0], 1), in_order(fields.shape[0], 2)
    # A march reads whole vectors, which may go on beyond the last column.
    cuts, longest = strips.above.size, round_up_to_vectors(plane.row) + DOUBLES
    copies = np.empty((cuts, _COPIED, len(x), longest))
    whole = _Whole(fields, copies, x, y, plane, strips, spans, move, gone, table)
    with small_chunks(strips.first.size):
        _sweep_planes(cuts * _COPIED, strips.first.size, (flux, whole))
    return float(gone.sum())
