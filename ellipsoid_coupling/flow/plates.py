"""Thin plates: walls inside the mesh, with fluid on both sides, that no cell of it shows.

OpenFOAM's baffles are faces of a patch between two cells of the mesh. The cells of the field's grid that
such a face touches are taken out of the flow, so that nothing passes through a plate unseen:

        +---+---+---+---+           x: out of the flow
        |   | x | x |   |
        |---|---=====---|           ===: the plate, on a line of the grid;
        |   | x | x |   |                between two lines, one row of cells
        +---+---+---+---+
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ellipsoid_coupling.flow.polygons import Edges
from ellipsoid_coupling.flow.stream_function import Patch

Array = NDArray[np.float64]

# Of an edge's length: the middle of a face and that of its edge are the same place.
_SAME_PLACE = 1e-3
# Points along a plate a cell, and how far to either side of it, in cells.
_PER_CELL, _ASIDE = 4.0, 1e-3


def plates(points: Array, edges: Edges, patches: Mapping[str, Patch]) -> Array:
    """(n, 2, 2), both ends of every edge inside the mesh that is a face of a patch.

    Parameters
    ----------
    points : (P, 2), the mesh points
    edges : between them
    patches : by name, without the empty ones
    """
    centres = [patch.centres for patch in patches.values() if len(patch.centres)]
    if not centres:
        return np.empty((0, 2, 2))
    ends = points[edges.points]
    middle, along = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    distance, _ = KDTree(np.concatenate(centres)).query(middle)
    faces = distance <= _SAME_PLACE * np.hypot(along[:, 0], along[:, 1])
    inner = faces & (edges.cells[:, 1] >= 0)
    # Plates whose points were split, too: two edges in one place, each beside one cell.
    rim = np.flatnonzero(faces & (edges.cells[:, 1] < 0))
    if rim.size > 1:
        next_one = np.asarray(KDTree(middle[rim]).query(middle[rim], k=2)[0])[:, 1]
        twice = next_one <= _SAME_PLACE * np.hypot(along[rim, 0], along[rim, 1])
        inner[rim[twice]] = True
    return np.asarray(ends[inner])


def without_plates(
    inside: NDArray[np.bool_], x: Array, y: Array, found: Array
) -> NDArray[np.bool_]:
    """The cells in the flow (ny, nx) less those that plates (n, 2, 2) touch; x, y are the nodes."""
    if not len(found):
        return inside
    step = np.array([x[1] - x[0], y[1] - y[0]])
    corner, kept = np.array([x[0], y[0]]), inside.copy()
    for start, end in found:
        way = (end - start) / step
        length = float(np.hypot(*way))
        part = np.linspace(_ASIDE, 1.0 - _ASIDE, 2 + int(_PER_CELL * length))[:, None]
        across = np.array([-way[1], way[0]]) / length
        at = (start - corner) / step + part * way
        for side in (-_ASIDE, _ASIDE):
            column, row = np.floor(at + side * across).astype(np.int64).T
            # Of two cells that meet at a corner, a third one beside both: no way through between them.
            row, column = np.concatenate((row, row[1:])), np.concatenate((column, column[:-1]))
            there = (row >= 0) & (row < kept.shape[0]) & (column >= 0) & (column < kept.shape[1])
            kept[row[there], column[there]] = False
    return kept
