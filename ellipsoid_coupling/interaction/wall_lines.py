"""Ghost particles along walls of any shape: on the wall, spaced L, main axes along it.

Edges that follow one another are one wall, up to a corner of more than 30 degrees. So a straight wall
has the ghosts of `walls`, and no two walls share one:

    --g-----g-----g-----g--        as many as fit best at distances L, centred; around a closed wall,
                                   without a corner, evenly
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.walls import GhostParticles

Floats = NDArray[np.float64]

# The cosine of the angle by which the way along one wall may turn from an edge to the next.
_SMOOTH = np.cos(np.radians(30.0))
# Of an edge's length: the end of one edge and the start of the next one are in the same place.
_SAME_PLACE = 1e-6


def ghosts_along(ends: Floats, length: float) -> GhostParticles:
    """The ghost particles along edges (E, 2, 2), spaced `length`."""
    empty = np.empty(0)
    parts = [_along_wall(wall, closed, length) for wall, closed in walls_of(ends)]
    return GhostParticles(*np.concatenate([np.array([empty] * 3), *parts], axis=1))


def walls_of(ends: Floats) -> list[tuple[Floats, bool]]:
    """Edges (E, 2, 2) as lines of points (n, 2) without corners, and whether each is closed."""
    following = _following(ends)
    # Edges that none leads to.
    first = np.setdiff1d(np.arange(len(ends)), following[following >= 0])
    walls, taken = [], np.zeros(len(ends), np.bool_)
    # Lines that begin somewhere, and then those that do not.
    for start in (*first, *range(len(ends))):
        chain, e = [], int(start)
        while e >= 0 and not taken[e]:
            taken[e] = True
            chain.append(e)
            e = int(following[e])
        if chain:
            points = np.vstack((ends[chain, 0], ends[chain[-1:], 1]))
            walls.append((points, e == chain[0]))
    return walls


def _following(ends: Floats) -> NDArray[np.int64]:
    """(E,), the edge that goes on where each one ends, without a corner; -1 for none."""
    way = ends[:, 1] - ends[:, 0]
    length = np.hypot(way[:, 0], way[:, 1])
    along = way / length[:, None]
    # Starts by rounded places: what is searched for is within rounding of one of four of them.
    size = _SAME_PLACE * float(length.max(initial=1.0))
    starts: dict[tuple[int, int], list[int]] = {}
    for e, place in enumerate(np.floor(ends[:, 0] / size).astype(np.int64)):
        starts.setdefault((int(place[0]), int(place[1])), []).append(e)
    following = np.full(len(ends), -1, np.int64)
    for e, end in enumerate(ends[:, 1]):
        near = np.unique(np.floor(end / size + np.array([[a, b] for a in (-0.5, 0.5) for b in (-0.5, 0.5)]))
                         .astype(np.int64), axis=0)  # fmt: skip
        found = [f for cell in near for f in starts.get((int(cell[0]), int(cell[1])), [])]
        # The front of a plate leads to its back only by turning round, which is no smooth way.
        smooth = [f for f in found if f != e and float(along[e] @ along[f]) > _SMOOTH]
        if smooth:
            following[e] = max(smooth, key=lambda f: float(along[e] @ along[f]))
    return following


def _along_wall(points: Floats, closed: bool, length: float) -> Floats:
    """(3, n) of x, y, angle of the ghosts of one wall."""
    way = np.diff(points, axis=0)
    edges = np.hypot(way[:, 0], way[:, 1])
    reached = np.concatenate(([0.0], np.cumsum(edges)))
    count = max(1, round(float(reached[-1]) / length))
    spacing = float(reached[-1]) / count if closed else length
    at = 0.5 * reached[-1] + spacing * (np.arange(count, dtype=np.float64) - 0.5 * (count - 1))
    edge = np.clip(np.searchsorted(reached, at, side="right") - 1, 0, len(edges) - 1)
    part = ((at - reached[edge]) / edges[edge])[:, None]
    place = points[edge] + part * way[edge]
    # An ellipse has no front: the angle of a wall is one in [0, pi).
    angle = np.mod(np.arctan2(way[edge, 1], way[edge, 0]), np.pi)
    return np.stack((place[:, 0], place[:, 1], angle))
