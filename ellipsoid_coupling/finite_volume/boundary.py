"""Filling the ghost layers of padded fields, from the ghost table of their grid.

`geometry/ghost_table.py` draws the layers and says which cells each ghost follows from, the kinds of
`geometry/boundaries` what it then holds. Here are the loops: along x a row's own four ghosts, along y
whole rows of ghosts, which vectorise.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.compiled.threads import threads_for
from ellipsoid_coupling.compiled.tuning import GHOSTS_PER_THREAD
from ellipsoid_coupling.finite_volume.fluxes.contract import in_order
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid
from ellipsoid_coupling.geometry.boundaries import Boundaries, Place, ghost
from ellipsoid_coupling.geometry.ghost_table import (
    BOTTOM,
    EDGE,
    GHOST,
    IMAGE,
    LEFT,
    NEXT_GHOST,
    NEXT_IMAGE,
    NORMAL,
    RIGHT,
    STEP_X,
    STEP_Y,
    STRIDE,
    TOP,
    WIDTH,
    GhostTable,
    X,
    Y,
    ghost_table,
)

Floats = NDArray[np.float64]


def grid_ghosts(grid: Grid, kinds: Boundaries, angle_width: float = 0.0) -> GhostTable:
    """The ghost table of a grid, or of the planes of a q-grid, `angle_width` (radian) apart."""
    return ghost_table(kinds, grid.shape, GHOSTS, (grid.x_low, grid.y_low), grid.cell, angle_width)


def fill_ghosts(fields: Floats, axis: int, table: GhostTable, t: float) -> None:
    """Fill the ghost layers at both ends of x or y, in place.

    Parameters
    ----------
    fields : (K, ny + 4, nx + 4) or (K, na + 4, ny + 4, nx + 4) float64, contiguous
        Conserved fields, component first: density, momenta along x and y, and others.
    axis : int
        -1 for x, -2 for y.
    table : GhostTable
        Of the grid.
    t : float
        The time at the start of the step.
    """
    cells = math.prod(fields.shape[-2:])
    # Without a copy or not at all: ghosts are written where the fields are.
    flat = np.reshape(fields, (fields.shape[0], -1), copy=False)
    # A q-grid's ghost planes are filled by nobody.
    first, planes = (GHOSTS, fields.shape[1] - 2 * GHOSTS) if fields.ndim == 4 else (0, 1)
    # Component 1 is the momentum along x, 2 the one along y.
    components = in_order(fields.shape[0], -axis)
    # Few ghosts are filled sooner than a thread is awake.
    width = int(table.cells[LEFT if axis == -1 else BOTTOM, WIDTH])
    with threads_for(planes * width, GHOSTS_PER_THREAD):
        fill = _fill_all_ends if axis == -1 else _fill_all_sides
        fill(flat, components, (planes, first * cells, cells), width, (table, t))


@inline_kernel
def _place(places: Floats, side: int, i: int, angle: float) -> Place:
    """That of a side's ghost number i."""
    x = places[side, X] + i * places[side, STEP_X]
    # Only lines of a staircase ask for what the fluid carries.
    return Place(x, places[side, Y] + i * places[side, STEP_Y], angle, ())


@inline_kernel
def _fill_end(
    kind: object,
    cells: Rows,
    table: GhostTable,
    side: int,
    layer: int,
    at: tuple[int, float, float],
) -> None:
    """Fill one ghost of a row, see `fill_ends`; at : its row, the angle and the time."""
    row, first = table.cells[side], table.first
    # The table has cells of the lowest row; from its first ghost on they are the same in every row.
    edge = load(cells, row[EDGE] - first)
    image = load(cells, row[IMAGE] + layer * row[NEXT_IMAGE] - first)
    place = _place(table.places, side, at[0], at[1])
    held = ghost(kind, edge, image, float(row[NORMAL]), at[2], place)
    store(cells, row[GHOST] + layer * row[NEXT_GHOST] - first, held)


@kernel(noalias=True)
def fill_ends(cells: Rows, table: GhostTable, a: int, j: int, t: float) -> None:
    """Fill the ghosts of row j of plane a along x; `cells` (see `in_order`) begin with the first one."""
    at = j, a * table.angle_width, t
    # Layer by layer: the second mirrors the other end's first where there is one cell only.
    for layer in range(GHOSTS):
        _fill_end(table.kinds.left, cells, table, LEFT, layer, at)
        _fill_end(table.kinds.right, cells, table, RIGHT, layer, at)


@kernel(noalias=True)
def _fill_layer(
    kind: object,
    cells: tuple[Rows, Rows, Rows],
    places: Floats,
    side: int,
    columns: tuple[int, int],
    normal: float,
    at: tuple[float, float],
) -> None:
    """Ghosts side by side of the edge and their images, `cells`, all from the first of `columns` on.

    columns : the first one and how many; at : the angle and the time.
    """
    edge, image, ghosts = cells
    first, width = columns
    # Whole vectors with a mask, as in `over_row`: a remainder loop would go one cell at a time.
    for i in range(round_up_to_vectors(width)):
        if i < width:
            place = _place(places, side, first + i, at[0])
            store(ghosts, i, ghost(kind, load(edge, i), load(image, i), normal, at[1], place))


@inline_kernel
def _fill_side_layer(
    kind: object,
    planes: tuple[Floats, tuple[int, ...], int],
    table: GhostTable,
    side: int,
    layer: int,
    columns: tuple[int, int],
    at: tuple[float, float],
) -> None:
    """Fill one layer at the bottom or top; planes : fields, components, and where the plane begins."""
    fields, components, start = planes
    row, first = table.cells[side], start + columns[0]
    cells = (
        rows_at(fields, components, first + row[EDGE]),
        rows_at(fields, components, first + row[IMAGE] + layer * row[NEXT_IMAGE]),
        rows_at(fields, components, first + row[GHOST] + layer * row[NEXT_GHOST]),
    )
    _fill_layer(kind, cells, table.places, side, columns, float(row[NORMAL]), at)


@kernel(noalias=True)
def fill_sides(
    fields: Floats,
    components: tuple[int, ...],
    table: GhostTable,
    plane: tuple[int, int],
    columns: tuple[int, int],
    ends: tuple[bool, bool],
    t: float,
) -> None:
    """Fill rows of ghosts at the bottom of a plane, at its top, or both.

    fields : (K, cells), flat; components : `in_order`.
    plane : its number, and its first padded cell.
    columns : the first one and how many.
    ends : whether to fill the bottom and the top.
    """
    a, start = plane
    # Each side is a call of its own: its kind is a type, by which its formula is compiled in.
    at, planes = (a * table.angle_width, t), (fields, components, start)
    # Layer by layer: the second mirrors the other end's first where there is one row only.
    for layer in range(GHOSTS):
        if ends[0]:
            _fill_side_layer(table.kinds.bottom, planes, table, BOTTOM, layer, columns, at)
        if ends[1]:
            _fill_side_layer(table.kinds.top, planes, table, TOP, layer, columns, at)


@parallel_kernel
def _fill_all_ends(
    fields: Floats,
    components: tuple[int, ...],
    planes: tuple[int, int, int],
    rows: int,
    arguments: tuple[GhostTable, float],
) -> None:
    """Of all `rows` of all planes: how many these are, their first cell, and from plane to plane."""
    packed = pack(arguments)
    count, begin, size = planes
    for task in numba.prange(count * rows):
        table, t = unpack(packed)
        a, j = signed(task) // rows, signed(task) % rows
        # Ghosts at the left are a row apart.
        first = begin + a * size + table.first + j * table.cells[LEFT, STRIDE]
        fill_ends(rows_at(fields, components, first), table, a, j, t)


@parallel_kernel
def _fill_all_sides(
    fields: Floats,
    components: tuple[int, ...],
    planes: tuple[int, int, int],
    width: int,
    arguments: tuple[GhostTable, float],
) -> None:
    """Over all `width` columns of all planes, see `_fill_all_ends`."""
    packed = pack(arguments)
    count, begin, size = planes
    for task in numba.prange(count):
        table, t = unpack(packed)
        plane = signed(task), begin + signed(task) * size
        fill_sides(fields, components, table, plane, (0, width), (True, True), t)


def fill_periodic(fields: Floats, axis: int) -> None:
    """Fill the ghost layers at both ends of a periodic direction of contiguous fields, in place."""
    before, n, after = fields.shape[:axis], fields.shape[axis], fields.shape[axis + 1 :]
    # All axes before and all axes after are one each: one kernel for every shape.
    shape = math.prod(before), n, math.prod(after)
    with threads_for(shape[0] * shape[2], GHOSTS_PER_THREAD):
        _wrap(np.reshape(fields, shape, copy=False))


@parallel_kernel
def _wrap(fields: Floats) -> None:
    """`fill_periodic` along the second axis of three."""
    # The period in cells: an image is that far from its ghost.
    last = fields.shape[1] - 2 * GHOSTS
    layers = 2 * GHOSTS
    for task in numba.prange(fields.shape[0] * layers):
        line, layer = task // layers, task % layers
        # Layers 0 and 1 are the lower ghosts, 2 and 3 the upper ones.
        held = layer if layer < GHOSTS else last + layer
        image = held + last if layer < GHOSTS else held - last
        to, source = fields[line, held], fields[line, image]
        for i in range(to.size):
            to[i] = source[i]
