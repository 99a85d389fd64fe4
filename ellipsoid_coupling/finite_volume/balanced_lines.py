"""The well-balanced scheme along the lines of a staircase: both stages of a line in its own memory.

Transport, source and damping along one axis look at a line's own cells and ghosts only. So a line is taken
once, stepped twice and put back; `well_balanced.py` has the scheme, `fluid_lines.py` the lines.

The work of the forces stands in arrays of all lines, by plane: from each cell to the next one, 0 across
walls and mirrored in their ghosts, and going on where particles pass, as `hydrostatic_reconstruction.py`
says.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import chunk
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.rows import Rows, offset, rows_at
from ellipsoid_coupling.compiled.simd_vectors import DOUBLES
from ellipsoid_coupling.compiled.threads import small_chunks
from ellipsoid_coupling.finite_volume.fluid_lines import HIGH, LOW
from ellipsoid_coupling.finite_volume.fluxes.contract import ALONG, DENSITY, Flux
from ellipsoid_coupling.finite_volume.fluxes.kinetic import Limits
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.hydrostatic_reconstruction import set_run
from ellipsoid_coupling.finite_volume.line_sweep import (
    Line,
    LineFields,
    by_boundary,
    carries,
    copy_cells,
    fill_line_ends,
    line_of,
    line_room,
    put_line,
    sweep_line,
    take_line,
    tasks_for,
)
from ellipsoid_coupling.finite_volume.sweep import RowScratch, row_scratch
from ellipsoid_coupling.finite_volume.well_balanced_stages import (
    Forced,
    Stage,
    combine_row,
    push_row,
)

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

_TILT, _REST = range(2)


class LineForces(NamedTuple):
    """What works along the lines.

    pull : (na, ny, nx) float64, F without the interaction.
    potential : (n, ny, nx) or None, U * q of the n angles that it tells apart.
    angles : (na, n); there : (0,), or () without a potential.
    rows : (T,) int64, which row or column of cells each line is part of.
    strides : (int, int, int), from plane to plane, from row to row, from cell to cell.
    mirrors : (T, 2) bool, whether particles turn round at either end.
    weights : (h/2, w).
    """

    pull: Floats
    potential: Floats | None
    angles: tuple[int, int]
    there: tuple[int, ...]
    rows: Indices
    strides: tuple[int, int, int]
    mirrors: Flags
    weights: tuple[float, float]


def no_line_work(whole: LineFields) -> Floats:
    """Tilt 1 and rest 0 of all cells of all lines, in whole vectors."""
    # Whole vectors are read beyond the last line.
    cells = whole.planes.number * whole.lines.size + 2 * DOUBLES
    return np.array([np.ones(cells), np.zeros(cells)])


@inline_kernel
def _take(
    values: Floats | None,
    which: tuple[int, ...],
    place: tuple[int, int, int, int, int],
    room: Floats,
) -> Rows:
    """The values of a line's cells, and of the first one again behind the last of a ring; () of None.

    which : (0,) or (); place : a row's first cell, the line's start in it, cells of the line, of the row,
    and from cell to cell.
    """
    begin, start, n, cells, stride = place
    # Beyond the end of the row a line goes on at its beginning.
    part = min(n, cells - start)
    inside = rows_at(room, which, 0)
    first = rows_at(values, which, begin + start * stride)
    copy_cells(first, inside, (stride, 1), part)
    copy_cells(rows_at(values, which, begin), offset(inside, part), (stride, 1), n - part)
    # A ring's last cell has work to its first one.
    copy_cells(first, offset(inside, n), (1, 1), 1)
    return inside


@kernel
def _set_line(
    forces: LineForces, whole: LineFields, line: Line, out: Floats, rooms: tuple[Floats, Floats]
) -> None:
    n, number, first = line.length, line.number, line.slot + GHOSTS
    plane, row, stride = forces.strides
    begin = forces.rows[number] * row
    extent = whole.lines.start[number], n, whole.lines.cells, stride
    # The pull has all planes, the potential only those that it tells apart.
    here = begin + line.plane % forces.angles[0] * plane, *extent
    pull = _take(forces.pull, (0,), here, rooms[0])
    here = begin + line.plane % forces.angles[1] * plane, *extent
    potential = _take(forces.potential, forces.there, here, rooms[1])
    pulls, potentials = (pull, offset(pull, 1)), (potential, offset(potential, 1))
    work, weights = rows_at(out, (_TILT, _REST), first), forces.weights
    ring = whole.lines.ring[number]
    # Across a wall no work is done: there the array keeps tilt 1 and rest 0.
    set_run(pulls, potentials, weights, n if ring else n - 1, work)
    if ring:
        # The ghosts of a ring go on at its other end.
        copy_cells(offset(work, n - GHOSTS), offset(work, -GHOSTS), (1, 1), GHOSTS)
        copy_cells(work, offset(work, n), (1, 1), GHOSTS)
        return
    # From the first cell and from the last but one; of a single cell what its own force does.
    second, last_but_one = min(1, n - 1), max(n - 2, 0)
    low = (pull, offset(pull, second)), (potential, offset(potential, second))
    high = (
        (offset(pull, last_but_one), offset(pull, n - 1)),
        (offset(potential, last_but_one), offset(potential, n - 1)),
    )
    # In ghosts of walls the mirrored work, the other way; a single cell has none to mirror.
    back = (-weights[0], -weights[1])
    if not forces.mirrors[number, LOW]:
        for g in range(GHOSTS):
            set_run(low[0], low[1], weights, 1, offset(work, -1 - g))
    elif n > 1:
        # g leads to the next cell: at the low end the outer ghost has it, at the high end the inner one.
        set_run(low[0], low[1], back, 1, offset(work, -GHOSTS))
    if not forces.mirrors[number, HIGH]:
        for g in range(GHOSTS + 1):
            set_run(high[0], high[1], weights, 1, offset(work, n - 1 + g))
    elif n > 1:
        set_run(high[0], high[1], back, 1, offset(work, n))


@parallel_kernel
def _set_lines(
    tasks: int, count: int, arguments: tuple[LineForces, LineFields], out: Floats
) -> None:
    packed = pack(arguments)
    for task in numba.prange(tasks):
        forces, whole = unpack(packed)
        room = line_room(whole)
        # Pull and potential of one line at a time, in this task's cache.
        rooms = np.zeros((1, room.shape[1])), np.zeros((1, room.shape[1]))
        begin, end = chunk(signed(task), tasks, count)
        for number in range(begin, end):
            _set_line(forces, whole, line_of(whole, number), out, rooms)


def set_line_work(forces: LineForces, whole: LineFields, out: Floats) -> None:
    """Tilt and rest of the work from each cell of each line to the next one, to `out`; see the module."""
    tasks, count = tasks_for(whole)
    with small_chunks(tasks):
        _set_lines(tasks, count, (forces, whole), out)


class Balance(NamedTuple):
    """The work of the forces (2, cells of all lines) in either stage; limits and the stage's numbers.

    Both stages have the same work, but in a flow that changes that of the step's start and of its end.
    """

    works: tuple[Floats, Floats]
    limits: Limits
    stage: Stage


@inline_kernel
def _forced_line(work: Floats, limits: Limits, line: Line, density: Floats) -> Forced:
    """Of a line whose density, ghosts included, is row 0 of (K, n)."""
    around = (
        rows_at(density, (DENSITY,), GHOSTS - 1)
        + rows_at(density, (DENSITY,), GHOSTS)
        + rows_at(density, (DENSITY,), GHOSTS + 1)
    )
    # In its own memory a line has no gaps, whatever its axis. Work stands with the lower of the
    # two cells that it leads between.
    first = line.slot + GHOSTS
    up = rows_at(work, (_TILT, _REST), first)
    return Forced(around, up, rows_at(work, (_TILT, _REST), first - 1), limits)


@kernel
def _balance_line(
    fluxes: tuple[Flux, Flux],
    whole: LineFields,
    line: Line,
    balance: Balance,
    rooms: tuple[Floats, Floats, Floats],
    scratch: RowScratch,
) -> tuple[float, float]:
    """Both stages of a line, which is in the first of `rooms`: now, before, and in between."""
    now, before, middle = rooms
    ratio, stage, limits = balance.stage.ratio, balance.stage, balance.limits
    cells, n = rows_at(now, whole.each, 0), line.length
    fill_line_ends(whole, line, now)
    # The sweep works in place: source and second stage need the old cells.
    copy_cells(cells, rows_at(before, whole.each, 0), (1, 1), n + 2 * GHOSTS)
    first = sweep_line(fluxes[0], whole, line, ratio, now, scratch)
    m, moved = rows_at(before, (ALONG,), GHOSTS), rows_at(now, (ALONG,), GHOSTS)
    # R0 is the source of the old cells.
    push_row(_forced_line(balance.works[0], limits, line, before), m, moved, n, stage)
    # Ghosts follow from the stage that they belong to.
    fill_line_ends(whole, line, now)
    copy_cells(cells, rows_at(middle, whole.each, 0), (1, 1), n + 2 * GHOSTS)
    second = sweep_line(fluxes[1], whole, line, ratio, now, scratch)
    m1, olds = rows_at(middle, (ALONG,), GHOSTS), rows_at(before, whole.each, GHOSTS)
    news = rows_at(now, whole.each, GHOSTS)
    # R1 is the source of the cells that the first stage has left.
    forced = _forced_line(balance.works[1], limits, line, middle)
    combine_row(forced, m1, olds, news, n, stage)
    # Both stages' transports count half.
    return 0.5 * (first[LOW] + second[LOW]), 0.5 * (first[HIGH] + second[HIGH])


@parallel_kernel
def _balance_lines(
    tasks: int,
    count: int,
    arguments: tuple[tuple[Flux, Flux], LineFields, Balance],
    gone: Floats,
) -> None:
    packed = pack(arguments)
    for task in numba.prange(tasks):
        fluxes, whole, balance = unpack(packed)
        room = line_room(whole)
        rooms = room, np.zeros(room.shape), np.zeros(room.shape)
        scratch = row_scratch(room.shape[1])
        begin, end = chunk(signed(task), tasks, count)
        for number in range(begin, end):
            line = line_of(whole, number)
            # What is empty stays so, unless the fluid carries something in.
            if take_line(whole, line, room) or carries(whole, line):
                left = _balance_line(fluxes, whole, line, balance, rooms, scratch)
                gone[number, LOW], gone[number, HIGH] = left
                put_line(whole, line, room)


def balance_lines(
    fluxes: tuple[Flux, Flux], whole: LineFields, balance: Balance, boundaries: int
) -> Floats:
    """Both stages along one axis, each with its flux, in place.

    Returns the mass that has left through each boundary, (boundaries,).
    """
    tasks, count = tasks_for(whole)
    gone = np.zeros((count, 2))
    with small_chunks(tasks):
        _balance_lines(tasks, count, (fluxes, whole, balance), gone)
    return by_boundary(gone, whole, boundaries)


@parallel_kernel
def _lose_ahead(
    tasks: int,
    count: int,
    factor: float,
    arguments: tuple[LineFields, Indices, tuple[int, int, int], Floats],
) -> None:
    packed = pack(arguments)
    for task in numba.prange(tasks):
        whole, rows, strides, out = unpack(packed)
        room = line_room(whole)
        begin, end = chunk(signed(task), tasks, count)
        for number in range(begin, end):
            line = line_of(whole, number)
            if take_line(whole, line, room) or carries(whole, line):
                fill_line_ends(whole, line, room)
                # Ghosts are filled in the line's own memory; the fields stay as they are.
                first = line.plane * strides[0] + rows[line.number] * strides[1]
                for i in range(line.length):
                    place = (whole.lines.start[line.number] + i) % whole.lines.cells
                    k = GHOSTS + i
                    # Central differences: with ghosts there is no case of its own at the ends.
                    out[first + place * strides[2]] -= factor * (
                        room[ALONG, k + 1] - room[ALONG, k - 1]
                    )


def lose_ahead(whole: LineFields, factor: float, out: Floats) -> None:
    """Take what leaves each cell along one axis from its density, q -= c (m_{+1} - m_{-1}).

    Parameters
    ----------
    whole : LineFields
    factor : float
        c = time/(2 h).
    out : (na, ny, nx) float64, contiguous
        Overwritten.
    """
    tasks, count = tasks_for(whole)
    _, ny, nx = out.shape
    # Of an array without ghosts, while lines have strides of padded planes.
    strides = (ny * nx, nx, 1) if whole.lines.stride == 1 else (ny * nx, 1, nx)
    with small_chunks(tasks):
        _lose_ahead(tasks, count, factor, (whole, whole.lines.rows, strides, out.reshape(-1)))
