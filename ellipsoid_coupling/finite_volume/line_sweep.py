"""One step of transport along one axis of a staircase, line by line; see `fluid_lines.py`.

Each line is taken from the fields, gets its ghosts, is swept as a row along x is, and put back:

    fields   . . b b b . .   ->   g g b b b g g   ->  sweep_row  ->   . . b b b . .

Lines along y are taken with a stride; neighbouring ones follow one another, so that their cache lines are
still there.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import chunk, round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.compiled.threads import small_chunks
from ellipsoid_coupling.compiled.tuning import TASKS_PER_THREAD
from ellipsoid_coupling.finite_volume.fluid_lines import HIGH, LOW, FluidLines, LineTable
from ellipsoid_coupling.finite_volume.fluxes.contract import DENSITY, Flux, in_order
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.sweep import RowScratch, row_scratch, sweep_row
from ellipsoid_coupling.geometry.boundaries import Place, Seen, ghost_of

Floats = NDArray[np.float64]


class Planes(NamedTuple):
    """Planes of flat padded fields: the first one's first cell, from one to the next, their number, how far
    apart in angle (radian), and from one to the next in arrays of all lines (0: these are of no plane).
    """

    first: int
    apart: int
    number: int
    angle_width: float
    slots: int


class LineFields(NamedTuple):
    """What is swept along one axis.

    Attributes
    ----------
    fields : (K, cells) float64
        Padded, flat.
    components : tuple of int
        In the flux's order; each : 0, 1, .. K - 1.
    planes : Planes
    lines : LineTable
    kinds : tuple
    carried : (K, rows planes) float64
    t : float
        The time at the start of the step.
    """

    fields: Floats
    components: tuple[int, ...]
    each: tuple[int, ...]
    planes: Planes
    lines: LineTable
    kinds: tuple[object, ...]
    carried: Floats
    t: float


def line_fields(
    fields: Floats,
    axis: int,
    lines: FluidLines,
    angle_width: float,
    t: float,
    by_plane: bool = False,
) -> LineFields:
    """Of padded fields (K, planes, ny + 4, nx + 4); `angle_width` is 0 on an r-grid.

    by_plane : arrays of all lines, those of the flux, have each line in each plane, not in one for all.
    """
    count = len(fields)
    components = in_order(count, -axis)
    plane = fields.shape[2] * fields.shape[3]
    # Ghost planes of the angle have no lines.
    layers = GHOSTS if angle_width else 0
    table = lines.tables[axis]
    slots = table.size if by_plane else 0
    planes = Planes(layers * plane, plane, fields.shape[1] - 2 * layers, angle_width, slots)
    flat = fields.reshape(count, -1)
    each = tuple(range(count))
    return LineFields(flat, components, each, planes, table, lines.kinds, lines.carried[axis], t)


class Line(NamedTuple):
    """One line of one plane: the plane, the line, its cells, and its first ghost in arrays of all lines."""

    plane: int
    number: int
    length: int
    slot: int


@inline_kernel
def line_of(whole: LineFields, task: int) -> Line:
    """Line number `task`, counted through all planes."""
    lines, planes = whole.lines, whole.planes
    count = lines.length.size
    a, number = task // count, task % count
    slot = lines.slot[number] + a * planes.slots
    return Line(a, number, lines.length[number], slot)


@kernel(noalias=True)
def copy_cells(source: Rows, target: Rows, strides: tuple[int, int], count: int) -> None:
    """Copy cells that are so far apart in the source and in the target."""
    for i in range(count):
        store(target, i * strides[1], load(source, i * strides[0]))


@kernel
def _copy_line(whole: LineFields, line: Line, room: Floats, back: bool) -> None:
    """Between the fields and `room`, whose first cells are ghosts."""
    lines, stride = whole.lines, whole.lines.stride
    begin = whole.planes.first + line.plane * whole.planes.apart + lines.row[line.number]
    start = lines.start[line.number]
    # Beyond the end of the row the line goes on at its beginning.
    part = min(line.length, lines.cells - start)
    for first, at, count in ((start, 0, part), (0, part, line.length - part)):
        # Inside the order is the flux's: density, the momentum along the line, the others.
        outside = rows_at(whole.fields, whole.components, begin + first * stride)
        inside = rows_at(room, whole.each, GHOSTS + at)
        if back:
            copy_cells(inside, outside, (1, stride), count)
        else:
            copy_cells(outside, inside, (stride, 1), count)


@kernel
def take_line(whole: LineFields, line: Line, room: Floats) -> bool:
    """Take a line to `room`, (K, n) in the flux's order; whether it holds anything."""
    _copy_line(whole, line, room, False)
    held = False
    for i in range(GHOSTS, GHOSTS + line.length):
        # Written so that NaN counts as mass: it shall be found, not be left out.
        held = held or room[DENSITY, i] != 0.0
    return held


@kernel
def put_line(whole: LineFields, line: Line, room: Floats) -> None:
    """Put it back."""
    _copy_line(whole, line, room, True)


@inline_kernel
def _fill_end(
    whole: LineFields, line: Line, cells: Rows, end: int, layer: int, normal: float
) -> None:
    lines, planes = whole.lines, whole.planes
    n, number = line.length, line.number
    first, last = GHOSTS, GHOSTS + n - 1
    edge, other = (first, last) if end == LOW else (last, first)
    inwards = 1 if end == LOW else -1
    # Mirror images: that of the inner ghost is the edge itself.
    image = edge + inwards * layer
    if lines.ring[number]:
        # The ghosts of a ring go on at its other end.
        image = other - inwards * layer
    row = rows_at(whole.carried, whole.each, 0)
    # All planes of one face stand together.
    carried = load(row, lines.carried[number, end] * planes.number + line.plane)
    x, y = lines.faces[number, end, 0], lines.faces[number, end, 1]
    place = Place(x, y, line.plane * planes.angle_width, carried)
    seen = Seen(load(cells, edge), load(cells, image), normal, whole.t, place)
    held = ghost_of(whole.kinds, lines.kind[number, end], seen)
    store(cells, edge - inwards * (layer + 1), held)


@kernel
def fill_line_ends(whole: LineFields, line: Line, room: Floats) -> None:
    """Fill the ghosts at both ends of a line in `room`."""
    cells = rows_at(room, whole.each, 0)
    # Layer by layer: the second mirrors the other end's first where there is one cell only.
    for layer in range(GHOSTS):
        _fill_end(whole, line, cells, LOW, layer, 1.0)
        _fill_end(whole, line, cells, HIGH, layer, -1.0)


@kernel
def sweep_line(
    flux: Flux, whole: LineFields, line: Line, ratio: float, room: Floats, scratch: RowScratch
) -> tuple[float, float]:
    """Step a line in `room`, whose ghosts are filled; the mass that has left through either end."""
    cells = rows_at(room, whole.each, 0)
    sweep_row(flux, cells, line.slot, line.length, ratio, scratch)
    if whole.lines.ring[line.number]:
        # What passes the seam of a ring stays.
        return 0.0, 0.0
    # The line ends at faces 1 and `length` + 1, see `sweep_row`. At the lower one mass leaves downwards.
    return -float(scratch.through[1]), float(scratch.through[line.length + 1])


@inline_kernel
def carries(whole: LineFields, line: Line) -> bool:
    """Whether the fluid carries anything into a line."""
    rows = whole.lines.carried
    found: bool = (rows[line.number, LOW] > 0) | (rows[line.number, HIGH] > 0)
    return found


@inline_kernel
def line_room(whole: LineFields) -> Floats:
    """Memory for the longest line, ghosts and whole vectors included."""
    # From the last cell of a vector a sweep looks two cells on.
    longest = whole.lines.length.max() + 2 * GHOSTS
    return np.zeros((len(whole.each), round_up_to_vectors(longest) + GHOSTS))


@parallel_kernel
def _sweep_lines(
    tasks: int, count: int, ratio: float, arguments: tuple[Flux, LineFields], gone: Floats
) -> None:
    packed = pack(arguments)
    for task in numba.prange(tasks):
        flux, whole = unpack(packed)
        # One line at a time for each task: its memory stays in that core's cache.
        room = line_room(whole)
        scratch = row_scratch(room.shape[1])
        begin, end = chunk(signed(task), tasks, count)
        for number in range(begin, end):
            line = line_of(whole, number)
            # What is empty stays so, unless the fluid carries something in.
            if take_line(whole, line, room) or carries(whole, line):
                fill_line_ends(whole, line, room)
                gone[number, 0], gone[number, 1] = sweep_line(
                    flux, whole, line, ratio, room, scratch
                )
                put_line(whole, line, room)


def tasks_for(whole: LineFields) -> tuple[int, int]:
    """Into how many tasks all lines are cut, and how many lines there are in all planes."""
    count = whole.planes.number * whole.lines.length.size
    # Lines differ in length: several tasks a thread balance them.
    return max(1, min(count, TASKS_PER_THREAD * numba.get_num_threads())), count


def by_boundary(gone: Floats, whole: LineFields, boundaries: int) -> Floats:
    """The mass that has left through each boundary, (boundaries,), of both ends of all lines."""
    # Both ends of a line together, line after line, plane after plane: a sum in one order.
    where = np.tile(whole.lines.boundary.ravel(), whole.planes.number)
    return np.asarray(np.bincount(where, gone.ravel(), boundaries), np.float64)


def sweep_lines(flux: Flux, whole: LineFields, ratio: float, boundaries: int) -> Floats:
    """Transport along one axis, in place.

    Parameters
    ----------
    flux : NamedTuple
    whole : LineFields
    ratio : float
        dt / h.
    boundaries : int
        How many there are.

    Returns
    -------
    (boundaries,) float64
        The mass that has left through each, less what came in, in units of a cell's density.
    """
    tasks, count = tasks_for(whole)
    gone = np.zeros((count, 2))
    with small_chunks(tasks):
        _sweep_lines(tasks, count, ratio, (flux, whole), gone)
    return by_boundary(gone, whole, boundaries)
