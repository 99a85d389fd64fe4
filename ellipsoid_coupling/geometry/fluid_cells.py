"""Which cells of a grid lie in the fluid, and what closes them off: the staircase of an outline.

    . . # # # .      .   cell in the fluid: its centre lies within the outline, and in the domain
    . . # # # .      #   cell that is none
    . . . # . .      |   closed face between two cells of the fluid: an edge of the outline crosses the
    . . . | . .          way between their centres, as that of a thin plate does

A closed face belongs to the patch of the nearest edge that faces its cell, or to the domain's side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.inside import grid_in_fluid, row_crossings
from ellipsoid_coupling.flow.outline import Outline

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

# Of a cell's width: an edge so far beyond a side of the domain still lies on it.
_ON_SIDE = 1e-3
# Distances of points from edges that are computed at a time.
_AT_ONCE = 2_000_000
# In place of an edge's number, see `Faces`.
SIDE, NONE = -1, -2


class Faces(NamedTuple):
    """The faces across one axis, of cells (ny, nx); along it there is one more of them than of cells.

    Attributes
    ----------
    is_open : bool
        Both cells lie in the fluid, and no edge is between their centres.
    lower, upper : int64, of the cells
        What closes the cell's lower and upper face: an edge's number; `SIDE` for the domain's side; `NONE`
        where the face is open or the cell is not in the fluid.
    """

    is_open: Flags
    lower: Indices
    upper: Indices

    @property
    def turned(self) -> Faces:
        """With x and y exchanged."""
        return Faces(self.is_open.T, self.lower.T, self.upper.T)


class FluidCells(NamedTuple):
    """See the module.

    Attributes
    ----------
    inside : (ny, nx) bool
    x, y : Faces
        Across x, whose open ones are (ny, nx + 1), and across y, (ny + 1, nx).
    """

    inside: Flags
    x: Faces
    y: Faces


def fluid_cells(outline: Outline | None, x: Floats, y: Floats, cell: float) -> FluidCells:
    """The fluid's cells of a grid, `cell` wide, with the centres x (nx,), y (ny,); all without outline."""
    if outline is None:
        outline = Outline(np.empty((0, 2, 2)), np.empty(0, np.int64), np.empty(0), (), ())
    turned = _turned(outline)
    rows, columns = _crossings(outline.ends, x, y, cell), _crossings(turned.ends, y, x, cell)
    inside = grid_in_fluid(outline.ends, x, y)
    along_x = _faces(outline, inside, rows, (x, y), cell)
    along_y = _faces(turned, inside.T, columns, (y, x), cell).turned
    return FluidCells(inside, along_x, along_y)


def _turned(outline: Outline) -> Outline:
    """With x and y exchanged, and the fluid still on the left of each edge."""
    return outline._replace(ends=np.ascontiguousarray(outline.ends[:, ::-1, ::-1]))


class _Crossings(NamedTuple):
    """Edges across the lines of centres.

    crossing : (lines, centres + 1), how many between a centre and the one before it.
    low, high : (lines,), whether one closes the way to the side of the domain.
    """

    crossing: Indices
    low: Flags
    high: Flags


def _crossings(ends: Floats, along: Floats, across: Floats, cell: float) -> _Crossings:
    """Edges (E, 2, 2) across lines at `across` (lines,), each with its centres at `along` (n,).

    The first coordinate of the edges is that along the lines.
    """
    _, line, at, _ = row_crossings(ends, across)
    gap, count = np.searchsorted(along, at), np.zeros((across.size, along.size + 1), np.int64)
    np.add.at(count, (line, gap), 1)
    sides = np.zeros((2, across.size), bool)
    reach = (0.5 + _ON_SIDE) * cell
    sides[0, line[(gap == 0) & (at >= along[0] - reach)]] = True
    sides[1, line[(gap == along.size) & (at <= along[-1] + reach)]] = True
    return _Crossings(count, *sides)


def _faces(
    outline: Outline,
    inside: Flags,
    crossings: _Crossings,
    centres: tuple[Floats, Floats],
    cell: float,
) -> Faces:
    """Across the last axis of `inside`; centres : along it and across."""
    lines, n = inside.shape
    is_open = np.zeros((lines, n + 1), bool)
    is_open[:, 1:-1] = inside[:, 1:] & inside[:, :-1] & (crossings.crossing[:, 1:-1] == 0)
    found = []
    for end, closed in ((0, inside & ~is_open[:, :-1]), (1, inside & ~is_open[:, 1:])):
        owner = np.full(inside.shape, NONE)
        line, i = np.nonzero(closed)
        centre = np.stack((centres[0][i], centres[1][line]), axis=-1)
        face = centre + np.array([(end - 0.5) * cell, 0.0])
        at_side = i == (n - 1 if end else 0)
        by_edge = ~at_side | (crossings.high if end else crossings.low)[line]
        owner[line, i] = SIDE
        owner[line[by_edge], i[by_edge]] = nearest_edges(
            outline, face[by_edge], centre[by_edge]
        ).edge
        found.append(owner)
    return Faces(is_open, *found)


class Nearest(NamedTuple):
    """The nearest edges of points (n, 2): their numbers (n,), the nearest points on them (n, 2)."""

    edge: Indices
    foot: Floats


def nearest_edges(outline: Outline, points: Floats, seen_from: Floats) -> Nearest:
    """Among the edges that have their fluid's side towards `seen_from` (n, 2), where there are any."""
    edge, foot = np.zeros(len(points), np.int64), np.zeros((len(points), 2))
    start, way = outline.ends[:, 0], outline.ends[:, 1] - outline.ends[:, 0]
    square = np.maximum((way**2).sum(axis=-1), np.finfo(np.float64).tiny)
    share = max(1, _AT_ONCE // max(len(start), 1))
    for first in range(0, len(points) if len(start) else 0, share):
        these = slice(first, first + share)
        there, viewer = points[these, None], seen_from[these, None]
        part = np.clip(((there - start) * way).sum(axis=-1) / square, 0.0, 1.0)
        nearest = start + part[..., None] * way
        far = ((there - nearest) ** 2).sum(axis=-1)
        left = way[:, 0] * (viewer - start)[..., 1] - way[:, 1] * (viewer - start)[..., 0]
        # Of edges at the same distance, as at a corner, the one that faces most.
        facing = left / np.sqrt(square)
        turned_away = facing <= 0.0
        far = far + np.where(turned_away, 2.0 * far.max(axis=-1, keepdims=True), 0.0)
        least = far.min(axis=-1, keepdims=True)
        best = np.argmax(np.where(far <= least * (1.0 + 1e-9), facing, -np.inf), axis=-1)
        edge[these], foot[these] = best, nearest[np.arange(len(best)), best]
    return Nearest(edge, foot)
