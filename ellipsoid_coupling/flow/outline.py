"""The outline of the fluid: where a solved case ends, edge by edge, and which patch each edge belongs to.

    +----------<----------+         the fluid lies on the left of the way along an edge:
    |    fluid            |         counter-clockwise around the mesh, clockwise around a solid in it
    v      +->-+          ^
    |      ^   v solid    |         normal (inwards): the way, turned to the left
    |      +-<-+          |
    +---------->----------+         a thin plate is two edges in one place, one for each side

Units and axes are those of the case; a fluid without an outline (an analytic flow) has no end.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


class Outline(NamedTuple):
    """See the module.

    Attributes
    ----------
    ends : (E, 2, 2) float64
        Where each edge starts and where it stops, (x, y).
    patch : (E,) int64
        Its patch, an index of `names`.
    outflow : (E,) float64
        The flux of the fluid out through it, per unit depth: the jump of psi; 0 on walls.
    names, types : tuple of str, one a patch
        As in constant/polyMesh/boundary: the case's own name, and its type (wall, patch, cyclic,
        symmetryPlane, symmetry).
    """

    ends: Floats
    patch: Indices
    outflow: Floats
    names: tuple[str, ...]
    types: tuple[str, ...]

    def normals(self) -> Floats:
        """(E, 2), of length 1, into the fluid."""
        way = self.ends[:, 1] - self.ends[:, 0]
        turned = np.stack((-way[:, 1], way[:, 0]), axis=-1)
        return np.asarray(turned / np.hypot(way[:, 0], way[:, 1])[:, None])

    def lengths(self) -> Floats:
        """(E,), of the edges."""
        way = self.ends[:, 1] - self.ends[:, 0]
        return np.asarray(np.hypot(way[:, 0], way[:, 1]))


def polygon_outline(parts: Iterable[tuple[str, str, Floats, bool]]) -> Outline:
    """An outline without flux through it, from lines of points.

    Parameters
    ----------
    parts : (name, type, points (n, 2), closed)
        A patch each, along which the fluid lies on the left; closed ones return to their first point.
    """
    names, types, ends, patch = [], [], [], []
    for number, (name, kind, points, closed) in enumerate(parts):
        line = np.vstack((points, points[:1])) if closed else points
        names.append(name)
        types.append(kind)
        ends.append(np.stack((line[:-1], line[1:]), axis=1))
        patch.append(np.full(len(line) - 1, number, np.int64))
    all_ends = np.concatenate(ends) if ends else np.empty((0, 2, 2))
    all_patches = np.concatenate(patch) if patch else np.empty(0, np.int64)
    return Outline(all_ends, all_patches, np.zeros(len(all_ends)), tuple(names), tuple(types))
