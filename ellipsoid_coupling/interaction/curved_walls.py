"""What walls of any shape do to the cells of a grid: the table of a straight one, at each cell's distance.

An endless straight wall is a function of the distance from it and of the angle to it (`wall_table.py`). A
cell takes it at its own distance d from the nearest edge of a wall, with that edge's normal:

    F = normal N(d/h - 1/2, theta - wall),   T = M(d/h - 1/2, theta - wall)

linear between the table's rows, which lie at d = (i + 1/2) h: straight walls along the grid's lines are
those of the table.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.interaction.grid_forces import Array, Forces
from ellipsoid_coupling.interaction.wall_table import NORMAL, TORQUE, look_up

Indices = NDArray[np.int64]

# Points by which edges are found lie so many to a cell's width; the nearest ones of a cell's centre that
# are looked at, and the part by which an edge that faces the cell may be further away than another.
_POINTS_A_CELL, _CANDIDATES, _ALIKE = 2, 8, 1e-9


class CurvedWalls:
    """Force and torque of walls on the cells of a grid.

    Parameters
    ----------
    edges : (E, 2, 2) float64
        Of the walls, the fluid on the left.
    entries : (2, depth, angles) float64
        The table of a straight wall, see `WallTable`.
    x, y : (nx,) and (ny,) float64
        The cells' centres; h is their distance.
    inside : (ny, nx) bool
        The cells that lie in the fluid.
    h : float

    Attributes
    ----------
    cell : (n,) int64
        The cells that feel a wall, flat; their row of the table, the part of the way to the next one, the
        normal (n, 2) and the angle of the wall.
    """

    def __init__(
        self,
        edges: Array,
        entries: Array,
        centres: tuple[Array, Array],
        inside: NDArray[np.bool_],
        h: float,
    ) -> None:
        depth = entries.shape[1]
        # Beyond its last row a wall is not felt.
        nothing = np.zeros((2, 1, entries.shape[2]))
        self._entries = np.ascontiguousarray(np.concatenate((entries, nothing), axis=1))
        j, i = np.nonzero(inside)
        places = np.stack((centres[0][i], centres[1][j]), axis=-1)
        far, normal = _nearest(edges, places, (depth + 0.5) * h, h)
        position = far / h - 0.5
        felt = position < depth
        self.cell = np.asarray((j * centres[0].size + i)[felt])
        position = position[felt]
        # A wall may cut a cell and be nearer than h/2: there the first two rows are extended.
        self._row = np.clip(np.floor(position), 0, max(depth - 1, 0)).astype(np.int64)
        self._part = position - self._row
        self._normal = np.ascontiguousarray(normal[felt])
        # The fluid lies on the left: the way along a wall is its normal, turned back by a quarter turn.
        self._wall = np.arctan2(-self._normal[:, 0], self._normal[:, 1])

    def add_to(self, forces: Forces, density: Array, angle: Array) -> None:
        """Add the walls' forces, in place, to those on occupied cells, all (ny, nx)."""
        count = (density.ravel()[self.cell] != 0.0) if self.cell.size else np.zeros(0, bool)
        push, turn = self._look_up(angle.ravel()[self.cell])
        for values, add in (
            (forces.x, self._normal[:, 0] * push),
            (forces.y, self._normal[:, 1] * push),
        ):
            # Fields are contiguous, so that `ravel` is a view and the sum stays in them.
            values.ravel()[self.cell] += np.where(count, add, 0.0)
        if forces.torque is not None:
            forces.torque.ravel()[self.cell] += np.where(count, turn, 0.0)

    def on_angles(self, angles: Array, shape: tuple[int, int]) -> tuple[Array, Array, Array]:
        """Force along x and y, and torque, of all cells at some angles: (angles, ny, nx) each."""
        out = np.zeros((3, angles.size, shape[0] * shape[1]))
        for a, angle in enumerate(angles):
            push, turn = self._look_up(np.full(self.cell.size, angle))
            out[0, a, self.cell] = self._normal[:, 0] * push
            out[1, a, self.cell] = self._normal[:, 1] * push
            out[2, a, self.cell] = turn
        x, y, torque = out.reshape(3, angles.size, *shape)
        return x, y, torque

    def _look_up(self, angle: Array) -> tuple[Array, Array]:
        """Normal force and torque of the felt cells at an angle each, (n,)."""
        out = np.zeros((2, self.cell.size))
        if self._entries.shape[1] > 1:
            _look_up_between(self._entries, self._row, self._part, angle - self._wall, out)
        return out[NORMAL], out[TORQUE]


def _nearest(edges: Array, places: Array, reach: float, h: float) -> tuple[Array, Array]:
    """Distance (n,) and normal (n, 2) of the nearest edge that faces a place; infinite beyond `reach`."""
    far, normals = np.full(len(places), np.inf), np.zeros((len(places), 2))
    if not len(edges) or not len(places):
        return far, normals
    start, way = edges[:, 0], edges[:, 1] - edges[:, 0]
    length = np.hypot(way[:, 0], way[:, 1])
    parts = np.maximum(np.ceil(_POINTS_A_CELL * length / h), 1).astype(np.int64)
    of = np.repeat(np.arange(len(edges)), parts)
    step = np.arange(of.size) - np.repeat(np.cumsum(parts) - parts, parts)
    points = start[of] + ((step + 0.5) / parts[of])[:, None] * way[of]
    # The points of an edge are half a cell apart: its nearest one is as far as that beside the foot.
    count = min(_CANDIDATES, len(points))
    # Hence also `+ h`: who is within reach of an edge is no further than that from one of its points.
    near = KDTree(points).query(places, k=count, distance_upper_bound=reach + h)
    distance, point = (np.reshape(one, (len(places), count)) for one in near)
    # Where fewer points are near, scipy fills up with infinity and an index that is none.
    found = np.isfinite(distance)
    edge = of[np.where(found, point, 0)]
    there = places[:, None]
    part = ((there - start[edge]) * way[edge]).sum(axis=-1) / length[edge] ** 2
    foot = start[edge] + np.clip(part, 0.0, 1.0)[..., None] * way[edge]
    apart = np.where(found, np.hypot(*np.moveaxis(there - foot, -1, 0)), np.inf)
    turned = np.stack((-way[:, 1], way[:, 0]), axis=-1) / length[:, None]
    facing = ((there - start[edge]) * turned[edge]).sum(axis=-1)
    # From behind a wall is none: a plate is an edge for either side.
    apart = np.where(facing > 0.0, apart, np.inf)
    nearest = apart.min(axis=-1, keepdims=True)
    # Of edges at one distance, as at a corner, the one that faces most.
    alike = apart <= nearest * (1.0 + _ALIKE)
    best = np.argmax(np.where(alike, facing, -np.inf), axis=-1)
    rows = np.arange(len(places))
    return apart[rows, best], turned[edge[rows, best]]


@kernel
def _look_up_between(entries: Array, rows: Indices, parts: Array, angle: Array, out: Array) -> None:
    for k in range(rows.size):
        low = look_up(entries, rows[k], angle[k])
        high = look_up(entries, rows[k] + 1, angle[k])
        for d in range(2):
            out[d, k] = low[d] + parts[k] * (high[d] - low[d])
