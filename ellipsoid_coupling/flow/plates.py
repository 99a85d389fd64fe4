"""Thin plates and patches in meshes that were read without their faces, as foamToVTK writes them.

OpenFOAM's baffles are two faces of patches between two cells. The cells' edges alone do not tell them from
an inner edge; a face of a patch in the same place does:

    inner edge   cell | cell          plate   cell ][ cell     two edges, each beside one cell
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ellipsoid_coupling.flow.polygons import Edges
from ellipsoid_coupling.flow.stream_function import Patch, Rim

Array = NDArray[np.float64]

# A face's centre is an edge's middle, up to this part of the edge: readers give single precision.
SAME_PLACE = 1e-2


def with_patches(points: Array, edges: Edges, patches: Mapping[str, Patch]) -> tuple[Edges, Rim]:
    """The edges, those that are plates twice, and where the patches' faces are among them.

    Parameters
    ----------
    points : (P, 2), the mesh points
    edges : between them, each once
    patches : by name, without the empty ones
    """
    face, edge = _matches(points, edges, patches)
    # Of an inner edge the first face is that of its first cell, the last one that of the other.
    order = np.argsort(edge, kind="stable")
    face, edge = face[order], edge[order]
    matched, first = np.unique(edge, return_index=True)
    last = np.append(first[1:], edge.size) - 1
    plate = edges.cells[matched, 1] >= 0
    cells = edges.cells.copy()
    cells[matched[plate], 1] = -1
    other = edges.cells[matched[plate]][:, ::-1].copy()
    other[:, 1] = -1
    doubled = Edges(
        np.concatenate((edges.points, edges.points[matched[plate]])), np.concatenate((cells, other))
    )
    found = np.concatenate((face[first], face[last[plate]]))
    begins = np.cumsum([0, *(len(patch.centres) for patch in patches.values())])
    patch = np.searchsorted(begins, found, side="right") - 1
    at = np.concatenate((matched, len(edges.points) + np.arange(np.count_nonzero(plate))))
    return doubled, Rim(at, patch, found - begins[patch])


def _matches(
    points: Array, edges: Edges, patches: Mapping[str, Patch]
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Faces, counted through all patches, and the edges in the same place."""
    centres = [patch.centres for patch in patches.values() if len(patch.centres)]
    if not centres:
        return np.empty(0, np.int_), np.empty(0, np.int_)
    ends = points[edges.points]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    distance, nearest = KDTree(ends.mean(axis=1)).query(np.concatenate(centres), k=2)
    near = np.asarray(distance) <= SAME_PLACE * length[nearest]
    # Two edges are in one place where a plate's points are split: its first face takes one of them, its
    # second face the other.
    nearest = np.where(near[:, 1:], np.sort(nearest, axis=1), nearest)
    _, pair, times = np.unique(nearest, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(pair.ravel(), kind="stable")
    rank = np.empty(order.size, np.int_)
    rank[order] = np.arange(order.size) - np.repeat(np.cumsum(times) - times, times)
    taken = np.where(near[:, 1] & (rank % 2 == 1), nearest[:, 1], nearest[:, 0])
    face = np.flatnonzero(near[:, 0])
    return face, taken[face]
