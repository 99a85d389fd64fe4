"""One step of transport along x and along y, in place and with one pass over memory for both.

To sweep one direction after the other brings all fields through memory twice. Here a strip of rows is
swept along x row by row, just ahead of the march along y, or just behind it where y comes first, while
the rows are in cache:

    x first                                    y first
    row j + 2   swept along x now              row j       swept along y now
    row j       swept along y now              row j - 1   as y has left it
    row j - 1   done                           row j - 2   swept along x now, its ghosts filled

Where a run of rows is cut into strips, so that all threads have some, a strip looks at two rows beyond
its ends that another one changes. Copies of these are made before (and swept along x where x comes
first): what comes out is that of two sweeps, bit for bit.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, parallel_kernel, view_kernel
from ellipsoid_coupling.compiled.loops import prefetch_block, round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.rows import Rows, rows_at
from ellipsoid_coupling.compiled.simd_vectors import DOUBLES
from ellipsoid_coupling.compiled.threads import small_chunks
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
from ellipsoid_coupling.finite_volume.sweep import RowScratch, Runs, row_scratch, sweep_row

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# Rows that x is ahead of y. The march begins with two rows below the first one, which at the edge are
# ghosts that need the first two rows; and what has just been written is not read at once.
_AHEAD = 3
# To cut rows into strips no longer than this is not worth it (and a strip at the edge needs the rows
# that its ghosts mirror); strips for each thread, if there are rows enough.
_SHORTEST, _STRIPS = 16, 2
# Rows beside a cut that are copied: as many as ghosts on either side.
_COPIED = 2 * GHOSTS


class Plane(NamedTuple):
    """Planes of padded fields, in flat cells.

    row, next_plane : from row to row, from plane to plane; columns, rows : of the interior; corner :
    the first interior cell.
    """

    row: int
    next_plane: int
    columns: int
    rows: int
    corner: int


class Move(NamedTuple):
    """One step: x or y first, dt / h, and whether the boundary reflects."""

    x_first: bool
    ratio: float
    reflecting: bool


class Strips(NamedTuple):
    """What threads share: `Runs` along y of all columns together, cut where they are long.

    first, length, width : (T,) int64, first flat cell, rows, columns.
    low, high : (T,) int64, number of the cut at the lower and the upper end, -1 where the run ends.
    above : (cuts,) int64, first flat cell above each cut.
    """

    first: Indices
    length: Indices
    width: Indices
    low: Indices
    high: Indices
    above: Indices


def strips_of(runs: Runs, row: int, threads: int) -> Strips:
    """Cut runs along y into strips, enough of them for all threads; `row` is from row to row."""
    fair = -(-int(runs.length.sum()) // (_STRIPS * threads))
    most = max(fair, _SHORTEST)
    if runs.length.max(initial=0) <= most:
        none = np.full(runs.first.size, -1)
        return Strips(*runs, none, none, none[:0])
    pieces = -(-runs.length // most)
    run = np.repeat(np.arange(pieces.size), pieces)
    piece = np.arange(run.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    begin, end = (k * runs.length[run] // pieces[run] for k in (piece, piece + 1))
    first, inner = runs.first[run] + begin * row, piece > 0
    low = np.where(inner, np.cumsum(inner) - 1, -1)
    return Strips(first, end - begin, runs.width[run], low, np.append(low[1:], -1), first[inner])


@functools.cache
def whole_plane(padded: tuple[int, int], threads: int) -> tuple[Plane, Strips, Indices]:
    """A padded r-grid (ny + 4, nx + 4) that is filled, for so many threads; see `sweep_planes`."""
    rows, columns = (n - 2 * GHOSTS for n in padded)
    corner = GHOSTS * (padded[1] + 1)
    plane = Plane(padded[1], padded[0] * padded[1], columns, rows, corner)
    runs = Runs(*(np.full(1, number) for number in (corner, rows, columns)))
    return plane, strips_of(runs, padded[1], threads), np.array([[[0, columns]] * rows])


class _Whole(NamedTuple):
    """What all strips have in common; see `sweep_planes`.

    x, y : components in the order of a sweep along x and along y.
    copies : (cuts, 4, K, row), the rows beside cuts.
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


@inline_kernel
def _line_of(plane: Plane, cell: int) -> tuple[int, int]:
    """The plane and the row of a flat cell."""
    line, lines = (cell - plane.corner) // plane.row, plane.next_plane // plane.row
    return line // lines, line % lines


@inline_kernel
def _start_of(plane: Plane, cell: int) -> int:
    """The first ghost of a cell's row."""
    return plane.corner - GHOSTS + (cell - plane.corner) // plane.row * plane.row


@view_kernel
def _fill_row(cells: Rows, plane: Plane, span: Indices, reflecting: bool) -> None:
    """Fill the ghosts of one row, if so much of it moves that its sweep looks there."""
    if span[1] > 0 and (span[0] < GHOSTS or span[1] > plane.columns - GHOSTS):
        fill_ends(cells, plane.columns, reflecting)


@view_kernel
def _copy_beside_cut(task: int, flux: Flux, whole: _Whole, scratch: RowScratch) -> None:
    """Copy a row beside a cut and, where x comes first, sweep the copy along x."""
    cut, row = task // _COPIED, task % _COPIED
    plane, move, copy = whole.plane, whole.move, whole.copies[cut, row]
    cell = whole.strips.above[cut] + (row - GHOSTS) * plane.row
    start = _start_of(plane, cell)
    copy_row(rows_at(whole.fields, whole.x, start), rows_at(copy, whole.x, 0), plane.row)
    a, j = _line_of(plane, cell)
    if move.x_first:
        span = whole.spans[a, j]
        _fill_row(rows_at(copy, whole.x, 0), plane, span, move.reflecting)
        if span[1] > 0:
            cells = rows_at(copy, whole.x, span[0])
            sweep_row(flux, cells, start + span[0], span[1] - span[0], move.ratio, scratch)


@view_kernel
def _sweep_x(flux: Flux, whole: _Whole, a: int, j: int, scratch: RowScratch) -> None:
    """Sweep what moves of row j of plane a."""
    plane, span = whole.plane, whole.spans[a, j]
    first = plane.corner - GHOSTS + a * plane.next_plane + j * plane.row + span[0]
    width = span[1] - span[0]
    if width > 0:
        cells = rows_at(whole.fields, whole.x, first)
        whole.gone[a, j] = sweep_row(flux, cells, first, width, whole.move.ratio, scratch)


@inline_kernel
def _strip_row(whole: _Whole, march: March, cuts: tuple[int, int], column: int, row: int) -> Rows:
    """Row number `row` of a strip; beyond a cut, its copy, of which `column` is the same cell."""
    rows = rows_at(whole.fields, whole.y, march.first + row * march.stride)
    if row < 0 and cuts[0] >= 0:
        rows = rows_at(whole.copies[cuts[0], row + GHOSTS], whole.y, column)
    if row >= march.length and cuts[1] >= 0:
        rows = rows_at(whole.copies[cuts[1], row - march.length + GHOSTS], whole.y, column)
    return rows


@inline_kernel
def _fetch_half(whole: _Whole, march: March, row: int, half: int) -> None:
    """Ask for one half of a row to come, if the strip has it.

    A row at once is more than the processor can wait for; unasked, it does not read on while it works
    on rows that are there.
    """
    part = march.width // 2
    if row < march.length:
        cells = march.first + row * march.stride + half * part
        prefetch_block(rows_at(whole.fields, whole.x, cells), part)


@view_kernel
def _sweep_strip(
    strip: int,
    flux: Flux,
    whole: _Whole,
    march: March,
    scratch: RowScratch,
    room: Floats,
) -> None:
    """Sweep the rows of one strip along both directions."""
    plane, move, length = whole.plane, whole.move, march.length
    cuts = whole.strips.low[strip], whole.strips.high[strip]
    a, j = _line_of(plane, march.first)
    start = _start_of(plane, march.first)
    column = march.first - start
    # The lowest row of the plane, its width, and the way to the next one: ghosts lie beyond both ends.
    lowest = march.first - j * plane.row, march.width, plane.row
    at_low = j < GHOSTS and cuts[0] < 0
    at_high = j + length > plane.rows - GHOSTS and cuts[1] < 0
    if move.x_first:
        # All at once: each by itself would wait for its row to come from memory.
        for row in range(length):
            cells = rows_at(whole.fields, whole.x, start + row * plane.row)
            _fill_row(cells, plane, whole.spans[a, j + row], move.reflecting)
    begin, ready, done = first_row(flux, whole.y, room), 0, 0
    # Of the rows that nothing has looked at yet, the one that the next turn comes to.
    coming = _AHEAD + 1 if move.x_first else 2
    for row in range(begin, length + 1):
        _fetch_half(whole, march, row + coming, 0)
        while ready < min(row + _AHEAD, length):
            if move.x_first:
                _sweep_x(flux, whole, a, j + ready, scratch)
            ready += 1
            ends = at_low and ready == min(GHOSTS, length), at_high and ready == length
            fill_sides(whole.fields, whole.y, lowest, plane.rows, ends, move.reflecting)
        if move.x_first:
            _fetch_half(whole, march, row + coming, 1)
        three = (
            _strip_row(whole, march, cuts, column, row - 1),
            _strip_row(whole, march, cuts, column, row),
            _strip_row(whole, march, cuts, column, row + 1),
        )
        if row == begin:
            begin_march(flux, three[0], three[1], room)
        cell = march.first + row * plane.row
        through = step_march(flux, whole.y, three, cell, march, row, move.ratio, room)
        # Runs that end elsewhere end in vacuum.
        if row == 0 and j == 0:
            whole.gone[a, plane.rows] = through
        if row == length and j + length == plane.rows:
            whole.gone[a, plane.rows + 1] = through
        if not move.x_first:
            _fetch_half(whole, march, row + coming, 1)
        # X follows a row behind y: what has just been written is not read at once.
        while done < (row if row == length or move.x_first else row - 1):
            if not move.x_first:
                cells = rows_at(whole.fields, whole.x, start + done * plane.row)
                _fill_row(cells, plane, whole.spans[a, j + done], move.reflecting)
                _sweep_x(flux, whole, a, j + done, scratch)
            done += 1


@parallel_kernel
def _sweep_planes(copies: int, strips: int, arguments: tuple[Flux, _Whole]) -> None:
    packed = pack(arguments)
    for task in numba.prange(copies):
        flux, whole = unpack(packed)
        _copy_beside_cut(signed(task), flux, whole, row_scratch(whole.plane.row))
    for task in numba.prange(strips):
        flux, whole = unpack(packed)
        cut, row = whole.strips, whole.plane.row
        march = March(cut.first[task], cut.length[task], cut.width[task], row)
        # Not beyond the last cell of all, where the march looks at the row above the last one.
        left = whole.fields.shape[1] - march.first - (march.length + 1) * row
        room = march_workspace(whole.y, min(round_up_to_vectors(march.width), left))
        _sweep_strip(signed(task), flux, whole, march, row_scratch(row), room)


def sweep_planes(
    flux: Flux,
    fields: Floats,
    plane: Plane,
    strips: Strips,
    spans: Indices,
    move: Move,
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
        another along y.
    spans : (planes, rows, 2) int64
        First column and end of what moves along x in each row; the end is 0 where nothing does.
    move : Move

    Returns
    -------
    float
        The mass that has left through the boundary, less what came in, in units of a cell's density.
    """
    # A number for each row and for both ends of each plane: their sum does not depend on the strips.
    gone = np.zeros((spans.shape[0], plane.rows + 2))
    x, y = in_order(fields.shape[0], 1), in_order(fields.shape[0], 2)
    cuts, longest = strips.above.size, round_up_to_vectors(plane.row) + DOUBLES
    copies = np.empty((cuts, _COPIED, len(x), longest))
    whole = _Whole(fields, copies, x, y, plane, strips, spans, move, gone)
    with small_chunks(strips.first.size):
        _sweep_planes(cuts * _COPIED, strips.first.size, (flux, whole))
    return float(gone.sum())
