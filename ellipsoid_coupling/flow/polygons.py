"""The cells of a plane mesh as polygons, flat in one array: triangles, centroids, edges.

For one quadrilateral beside one triangle:

    corner   3 4 7 6 | 4 5 7 | ...      points, counter-clockwise around each cell
    owner    0 0 0 0 | 1 1 1 | ...      the cell that each corner belongs to

What is drawn is `Polygons`, which `polygons` makes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int_]


class Edges(NamedTuple):
    """points (E, 2): where each edge starts and stops; cells (E, 2): beside it, -1 for none."""

    points: Index
    cells: Index


class Polygons(NamedTuple):
    """Convex polygons; see the module's picture.

    corner, owner : (K,), the owners ascending;  sizes : (C,), each cell's number of corners
    """

    corner: Index
    owner: Index
    sizes: Index

    @property
    def _first(self) -> Index:
        """(C,), where each cell's corners begin."""
        return np.cumsum(self.sizes) - self.sizes

    def scatter(self, points: Array) -> tuple[Array, Index]:
        """Points (K, 2) in the cells, and the cell of each: the mean over those of a cell is its mean.

        One for each corner, between that and the centroid: exact for squares' and regular triangles'
        cubics, for any polygon's linear functions. points (P, 2) are the mesh's.
        """
        corners = points[self.corner]
        middle = np.stack([
            np.bincount(self.owner, axis, self.sizes.size) / self.sizes for axis in corners.T
        ], axis=-1)  # fmt: skip
        part = np.where(self.sizes == 3, 0.5, 1.0 / np.sqrt(3.0))[self.owner, None]
        at = self.centroids(points)[self.owner] + part * (corners - middle[self.owner])
        return at, self.owner

    def triangles(self) -> Index:
        """(T, 3), each polygon as a fan from its first corner."""
        return self.corner[self._fan()]

    def triangle_owners(self) -> Index:
        """(T,), the cell of each of `triangles`."""
        return self.owner[self._fan()[:, 0]]

    def centroids(self, points: Array) -> Array:
        """(C, 2), where OpenFOAM has the cells' values; points (P, 2)."""
        fan = self._fan()
        a, b, c = np.moveaxis(points[self.corner[fan]], 1, 0)
        area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        owner, count = self.owner[fan[:, 0]], self.sizes.size
        total = np.bincount(owner, area, count)
        moment = [np.bincount(owner, area * s, count) / 3.0 for s in (a + b + c).T]
        return np.stack(moment, axis=-1) / total[:, None]

    def areas(self, points: Array) -> Array:
        """(C,), of the cells; points (P, 2)."""
        a, b, c = np.moveaxis(points[self.triangles()], 1, 0)
        twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        return np.asarray(0.5 * np.bincount(self.triangle_owners(), twice, self.sizes.size))

    def edges(self) -> Edges:
        """Every edge once, with the one or two cells beside it."""
        end = self._first + self.sizes - 1
        following = np.arange(1, self.corner.size + 1)
        following[end] = self._first
        ends = np.sort(np.column_stack((self.corner, self.corner[following])), axis=1)
        points, first, which = np.unique(ends, axis=0, return_index=True, return_inverse=True)
        which = which.ravel()
        other = np.arange(which.size) != first[which]
        second = np.full(first.size, -1)
        second[which[other]] = self.owner[other]
        return Edges(points, np.column_stack((self.owner[first], second)))

    def _fan(self) -> Index:
        """(T, 3), places in `corner`."""
        first = self._first[self.owner]
        second = np.arange(self.corner.size)
        used = (second > first) & (second < first + self.sizes[self.owner] - 1)
        return np.stack((first[used], second[used], second[used] + 1), axis=-1)


def polygons(points: Array, corner: Index, owner: Index, count: int) -> Polygons:
    """Sort corners (K,) of `count` convex cells, of any order, around their cells.

    points : (P, 2);  owner : (K,), the cell of each corner, ascending
    """
    sizes = np.bincount(owner, minlength=count)
    mean = np.stack([np.bincount(owner, points[corner, k], count) / sizes for k in (0, 1)], axis=-1)
    offset = points[corner] - mean[owner]
    order = np.lexsort((np.arctan2(offset[:, 1], offset[:, 0]), owner))
    return Polygons(corner[order], owner, sizes)


def around_cells(points: Array, edges: Edges, count: int) -> Polygons:
    """The `count` convex cells that edges lie around; points (P, 2)."""
    beside = edges.cells >= 0
    cell = np.concatenate((edges.cells[beside[:, 0], 0], edges.cells[beside[:, 1], 1]))
    ends = np.concatenate((edges.points[beside[:, 0]], edges.points[beside[:, 1]]))
    # Each corner once: two edges of a cell meet there.
    each = np.unique(np.repeat(cell, 2) * len(points) + ends.ravel())
    owner, corner = np.divmod(each, len(points))
    return polygons(points, corner, owner, count)
