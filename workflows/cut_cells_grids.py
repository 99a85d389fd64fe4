"""Grids past curved walls: stairs, stairs of the fluid's areas, cut cells; see cut_cells.py."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from cut_cells_flows import Floats, Flow
from numpy.typing import NDArray

Flags = NDArray[np.bool_]

# Of a cell's area: less than this is none.
_NONE = 1e-12
# Halvings of an edge that find where a wall cuts it.
_HALVINGS = 45


class Cells(NamedTuple):
    """The fluid's cells of a grid, (ny, nx).

    width : h.  area : of the fluid's part, 0 where there is none.  centre : (2, ny, nx) of that part.
    through : what flows through the faces across x, (ny, nx + 1), and across y, (ny + 1, nx).
    faces : the middles of their open parts, (2, ny, nx + 1) and (2, ny + 1, nx).
    """

    width: float
    area: Floats
    centre: Floats
    through: tuple[Floats, Floats]
    faces: tuple[Floats, Floats]

    @property
    def fluid(self) -> Flags:
        """Which cells have fluid."""
        return self.area > 0.0


def _corners(flow: Flow, number: int) -> Floats:
    at = np.linspace(-flow.half, flow.half, number + 1)
    return np.stack(np.meshgrid(at, at))


def _through(psi: Floats, fluid: Flags) -> tuple[Floats, Floats]:
    """Through the faces, from psi at the corners; nothing between two cells of which one is a solid."""
    x, y = (np.pad(fluid, width, mode="edge") for width in (((0, 0), (1, 1)), ((1, 1), (0, 0))))
    return np.diff(psi, axis=0) * (x[:, 1:] & x[:, :-1]), -np.diff(psi, axis=1) * (y[1:] & y[:-1])


def stairs_grid(flow: Flow, number: int) -> Cells:
    """Cells whose centre lies in the fluid, as the package has them (geometry/fluid_cells.py)."""
    corners = _corners(flow, number)
    width = 2.0 * flow.half / number
    middle = corners[:, :-1, :-1] + 0.5 * width
    fluid = flow.level(middle) > 0.0
    around = np.pad(fluid, 1, mode="edge")
    count = sum(around[j : j + number + 1, i : i + number + 1] * 1 for j in (0, 1) for i in (0, 1))
    at_stairs = (count > 0) & (count < 4)
    psi = np.where(at_stairs, flow.wall_psi(corners), flow.psi(corners))
    across = np.array([[[0.0]], [[0.5 * width]]])
    faces = corners[:, :-1] + across, corners[:, :, :-1] + across[::-1]
    return Cells(width, np.where(fluid, width**2, 0.0), middle, _through(psi, fluid), faces)


class _Edges(NamedTuple):
    """Edges of cells: the ends of the part in the fluid, where a wall cuts it, and whether one does."""

    first: Floats
    last: Floats
    cut: Floats
    is_cut: Flags

    def at(self, rows: slice, columns: slice) -> _Edges:
        """Some of them."""
        here = ..., rows, columns
        return _Edges(self.first[here], self.last[here], self.cut[here], self.is_cut[here])


def _open_part(flow: Flow, start: Floats, end: Floats) -> _Edges:
    """Of edges from `start` to `end`, (2, ..), that a wall cuts once or not at all."""
    low, high = flow.level(start) > 0.0, flow.level(end) > 0.0
    below, above = np.zeros(low.shape), np.ones(low.shape)
    for _ in range(_HALVINGS):
        middle = 0.5 * (below + above)
        as_start = (flow.level(start + middle * (end - start)) > 0.0) == low
        below, above = np.where(as_start, middle, below), np.where(as_start, above, middle)
    cut = start + below * (end - start)
    return _Edges(np.where(low, start, cut), np.where(high, end, cut), cut, low != high)


def cut_grid(flow: Flow, number: int) -> Cells:
    """What walls leave of each cell: a polygon whose ends on the cell's edges are exact."""
    corners = _corners(flow, number)
    width = 2.0 * flow.half / number
    along_x = _open_part(flow, corners[:, :, :-1], corners[:, :, 1:])
    along_y = _open_part(flow, corners[:, :-1], corners[:, 1:])
    near, far = slice(None, -1), slice(1, None)
    whole = slice(None)
    # Counter-clockwise: the lower, right, upper and left edge, the latter two from their ends.
    around = [
        (along_x.at(near, whole), 1.0),
        (along_y.at(whole, far), 1.0),
        (along_x.at(far, whole), -1.0),
        (along_y.at(whole, near), -1.0),
    ]
    cuts = np.sum([edge.is_cut for edge, _ in around], axis=0)
    middle = corners[:, :-1, :-1] + 0.5 * width
    # Triangles from the middle of the chord: the chord itself adds nothing.
    origin = np.sum([np.where(edge.is_cut, edge.cut, 0.0) for edge, _ in around], axis=0)
    origin = np.where(cuts > 0, origin / np.maximum(cuts, 1), middle)
    area, moment = np.zeros(cuts.shape), np.zeros(middle.shape)
    for edge, turn in around:
        one, other = edge.first - origin, edge.last - origin
        part = 0.5 * turn * (one[0] * other[1] - one[1] * other[0])
        area, moment = area + part, moment + part * (one + other) / 3.0
    fluid = area > _NONE * width**2
    area = np.where(fluid, area, 0.0)
    centre = np.where(fluid, origin + moment / np.where(fluid, area, 1.0), middle)
    psi = np.where(flow.level(corners) > 0.0, flow.psi(corners), flow.wall_psi(corners))
    faces = 0.5 * (along_y.first + along_y.last), 0.5 * (along_x.first + along_x.last)
    return Cells(width, area, centre, _through(psi, fluid), faces)


def areas_grid(flow: Flow, number: int) -> Cells:
    """Stairs whose cells have the area of the fluid in them and in solid cells beside them.

    A solid cell gives the fluid in it to that neighbour which has most; what has none is left out.
    """
    steps, fluid = stairs_grid(flow, number), cut_grid(flow, number).area
    own = np.pad(np.where(steps.fluid, fluid, 0.0), 1)
    left = np.where(steps.fluid, 0.0, fluid)
    within = slice(1, -1)
    beside = [(within, slice(0, -2)), (within, slice(2, None))]
    beside += [(along, across) for across, along in beside]
    sizes = np.stack([own[there] for there in beside])
    taker = np.where(sizes.max(axis=0) > 0.0, sizes.argmax(axis=0), -1)
    for k, there in enumerate(beside):
        own[there] += np.where(taker == k, left, 0.0)
    return steps._replace(area=own[within, within])
