"""What the ghost layers of a padded field hold: mirrored or continued values."""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.jit import (
    apart_kernel,
    inline_kernel,
    parallel_kernel,
    view_kernel,
)
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.rows import Rows, load, map_fields, rows_at, store
from ellipsoid_coupling.compiled.threads import threads_for
from ellipsoid_coupling.finite_volume.fluxes.contract import ALONG, DENSITY, in_order
from ellipsoid_coupling.finite_volume.grid import GHOSTS

Floats = NDArray[np.float64]

# To fill so many ghost cells takes as long as to wake a thread.
_CELLS_PER_THREAD = 4000


def fill_ghosts(fields: Floats, axis: int, reflecting: bool, normal: int) -> None:
    """Fill the ghost layers at both ends of one direction, in place.

    Parameters
    ----------
    fields : (K, ..., n + 4, ...) float64, contiguous
        Conserved fields, component first; padded along `axis`.
    axis : int
        The axis to fill, counted on `fields`.
    reflecting : bool
        True: mirror the interior and turn the normal momentum round, so that no mass crosses; False
        (open): continue the outermost cell (Neumann) where it moves outwards, so that what reaches
        the edge leaves, and mirror where it moves inwards. A continued cell that moves inwards
        would be a source without end: nothing is known of what lies outside.
    normal : int
        The component that is the momentum along `axis`.
    """
    before, n, after = fields.shape[1:axis], fields.shape[axis], fields.shape[axis + 1 :]
    lines, width = math.prod(before), math.prod(after)
    components = in_order(fields.shape[0], normal)
    with threads_for(lines * width, _CELLS_PER_THREAD):
        if width == 1:
            rows = np.reshape(fields, (fields.shape[0], lines * n), copy=False)
            _fill_all_ends(rows, components, lines, reflecting)
        else:
            planes = np.reshape(fields, (fields.shape[0], lines, n * width), copy=False)
            _fill_all_sides(planes, components, width, reflecting)


@inline_kernel
def _either(first: bool, one: float, other: float) -> float:
    return one if first else other


@inline_kernel
def _ghost(edge: Values, image: Values, inwards: float, reflecting: bool) -> Values:
    """What a ghost holds: its image turned round, or the edge where that moves outwards."""
    mirrored = reflecting | (edge[ALONG] * inwards > 0.0)
    held = map_fields(_either, (mirrored,), (image, edge))
    along = -held[ALONG] if mirrored else held[ALONG]
    return (held[DENSITY], along, *held[2:])


@view_kernel
def fill_ends(cells: Rows, n: int, reflecting: bool) -> None:
    """Fill the ghosts of one row: `cells` (see `in_order`) begin with the first ghost of n + 4 cells."""
    # Layer by layer: the second mirrors the other end's first where there is one cell only.
    for layer in range(GHOSTS):
        for end in range(2):
            inwards = 1 - 2 * end
            edge = GHOSTS if end == 0 else n + GHOSTS - 1
            image = load(cells, edge + inwards * layer)
            ghost = _ghost(load(cells, edge), image, float(inwards), reflecting)
            store(cells, edge - inwards * (layer + 1), ghost)


@apart_kernel
def _fill_side(
    edge: Rows, image: Rows, ghost: Rows, inwards: float, mirror: bool, width: int
) -> None:
    for i in range(round_up_to_vectors(width)):
        if i < width:
            store(ghost, i, _ghost(load(edge, i), load(image, i), inwards, mirror))


@view_kernel
def fill_sides(
    fields: Floats,
    components: tuple[int, ...],
    row: tuple[int, int, int],
    n: int,
    ends: tuple[bool, bool],
    reflecting: bool,
) -> None:
    """Fill ghost rows below and above n rows, at the lower end, the upper one or both.

    fields : (K, cells), flat; components : `in_order`.
    row : the flat index where the lowest of the n rows begins, its width, the way from row to row.
    """
    first, width, stride = row
    for layer in range(GHOSTS):
        for end in range(2):
            if ends[end]:
                inwards = 1 - 2 * end
                edge = 0 if end == 0 else n - 1
                image, ghost = edge + inwards * layer, edge - inwards * (layer + 1)
                _fill_side(
                    rows_at(fields, components, first + edge * stride),
                    rows_at(fields, components, first + image * stride),
                    rows_at(fields, components, first + ghost * stride),
                    float(inwards),
                    reflecting,
                    width,
                )


@parallel_kernel
def _fill_all_ends(
    fields: Floats, components: tuple[int, ...], lines: int, reflecting: bool
) -> None:
    padded = fields.shape[1] // lines
    for line in numba.prange(lines):
        cells = rows_at(fields, components, line * padded)
        fill_ends(cells, padded - 2 * GHOSTS, reflecting)


@parallel_kernel
def _fill_all_sides(
    fields: Floats, components: tuple[int, ...], width: int, reflecting: bool
) -> None:
    lines, plane = fields.shape[1:]
    flat = fields.reshape(fields.shape[0], lines * plane)
    n = plane // width - 2 * GHOSTS
    for line in numba.prange(lines):
        row = line * plane + GHOSTS * width, width, width
        fill_sides(flat, components, row, n, (True, True), reflecting)


def fill_periodic(fields: Floats, axis: int) -> None:
    """Fill the ghost layers at both ends of a periodic direction of contiguous fields, in place."""
    before, n, after = fields.shape[:axis], fields.shape[axis], fields.shape[axis + 1 :]
    shape = math.prod(before), n, math.prod(after)
    with threads_for(shape[0] * shape[2], _CELLS_PER_THREAD):
        _wrap(np.reshape(fields, shape, copy=False))


@parallel_kernel
def _wrap(fields: Floats) -> None:
    """`fill_periodic` along the second axis of three."""
    last = fields.shape[1] - 2 * GHOSTS
    layers = 2 * GHOSTS
    for task in numba.prange(fields.shape[0] * layers):
        line, layer = task // layers, task % layers
        ghost = layer if layer < GHOSTS else last + layer
        image = ghost + last if layer < GHOSTS else ghost - last
        to, source = fields[line, ghost], fields[line, image]
        for i in range(to.size):
            to[i] = source[i]
