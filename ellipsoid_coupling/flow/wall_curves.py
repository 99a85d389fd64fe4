"""Points on the walls between those of the mesh: on a smooth curve where a wall turns smoothly.

A mesh has chords of a round wall. Fluid that does not slip on chords slips on the arc between them, and
turns there at another rate, so psi is held on the curve through the mesh points:

    x(s) = cubic of Hermite's over each edge, its ends' tangents those of circles through three points

A corner stays a corner: the tangents there are those of the edges. A point is none where the wall turns
by less than `SHARPEST` and by about as much as at a point beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.polygons import Index

Array = NDArray[np.float64]

# Radian; an octagon has corners, a polygon of ten edges is a circle.
SHARPEST = np.radians(40.0)
# How many times more than a point beside it a point of a curve may turn; and a turn that is none.
ALIKE, STRAIGHT = 2.5, 1e-6
# Where psi is held along an edge, as parts of it: even, so that neighbouring edges go on evenly.
PLACES = (np.arange(5) + 0.5) / 5


class WallEdges(NamedTuple):
    """Edges of walls, the fluid on the left of the way from start to stop.

    edge, start, stop, patch : (W,), indices of the mesh's edges and points, and of patches
    speed : (W,), that of the wall along the way, NaN where it is not known
    """

    edge: Index
    start: Index
    stop: Index
    patch: Index
    speed: Array

    def only(self, kept: NDArray[np.bool_]) -> WallEdges:
        """Those of the edges that are kept, (W,)."""
        edge, start, stop, patch = (part[kept] for part in self[:4])
        return WallEdges(edge, start, stop, patch, self.speed[kept])


class WallPoints(NamedTuple):
    """Points on walls, `len(PLACES)` on each edge: at, way (n, 2), the second of length 1; speed (n,)."""

    at: Array
    way: Array
    speed: Array


def wall_points(points: Array, walls: WallEdges) -> WallPoints:
    """The points of all edges, one edge after the other; points (P, 2) are the mesh's."""
    way = points[walls.stop] - points[walls.start]
    length = np.hypot(way[:, 0], way[:, 1])[:, None]
    chord = way / length
    before, behind = _neighbours(walls, len(points))
    smooth = _smooth(chord, before, behind)
    # At its start and at its stop; an edge with a tangent at one end only is an arc of a circle.
    known = smooth, np.where(behind >= 0, smooth[behind], False)
    tangent = (
        _tangents(chord, length, before, np.arange(len(way))),
        _tangents(chord, length, np.arange(len(way)), behind),
    )
    at_start, at_stop = (
        np.where(
            known[k][:, None],
            tangent[k],
            np.where(known[1 - k][:, None], _mirrored(tangent[1 - k], chord), chord),
        )
        for k in (0, 1)
    )
    slopes = (_slope(tangent, chord, length) for tangent in (at_start, at_stop))
    at, along = _hermite(points[walls.start], way, *slopes)
    speed = _speeds(walls, known, before, behind)
    return WallPoints(at.reshape(-1, 2), along.reshape(-1, 2), speed.ravel())


def _neighbours(walls: WallEdges, points: int) -> tuple[Index, Index]:
    """(W,) each: the edge before and the one behind; -1 where there is none, or more than one."""
    edge = np.arange(walls.start.size)
    found = []
    for own, other in ((walls.start, walls.stop), (walls.stop, walls.start)):
        at_point = np.full(points, -1)
        at_point[other] = edge
        single = np.bincount(other, minlength=points) == 1
        found.append(np.where(single[own], at_point[own], -1))
    return found[0], found[1]


def _smooth(chord: Array, before: Index, behind: Index) -> NDArray[np.bool_]:
    """(W,), whether the wall has no corner where an edge starts."""
    cross = chord[before, 0] * chord[:, 1] - chord[before, 1] * chord[:, 0]
    turn = np.abs(np.arctan2(cross, np.sum(chord[before] * chord, axis=1)))
    turn = np.where(before >= 0, turn, np.pi)
    beside = np.maximum(
        np.where(before >= 0, turn[before], 0.0), np.where(behind >= 0, turn[behind], 0.0)
    )
    # A turn as sharp as a corner says nothing of the points beside it.
    beside = np.where(beside < SHARPEST, beside, 0.0)
    smooth: NDArray[np.bool_] = (turn < SHARPEST) & (turn <= ALIKE * beside + STRAIGHT)
    return smooth


def _tangents(chord: Array, length: Array, before: Index, behind: Index) -> Array:
    """(W, 2), of length 1: of the circle through the three points of two edges, where they meet."""
    sum_of = chord[before] * length[behind] + chord[behind] * length[before]
    size = np.hypot(sum_of[:, 0], sum_of[:, 1])[:, None]
    return np.asarray(sum_of / np.where(size > 0.0, size, 1.0))


def _mirrored(tangent: Array, chord: Array) -> Array:
    """The tangent at an arc's other end."""
    return np.asarray(2.0 * np.sum(tangent * chord, axis=1, keepdims=True) * chord - tangent)


def _slope(tangent: Array, chord: Array, length: Array) -> Array:
    """The cubic's slope at an end: as long as lets the cubic of an arc pass through the arc's middle."""
    cosine = np.sum(tangent * chord, axis=1, keepdims=True)
    return np.asarray(2.0 * length / (1.0 + cosine) * tangent)


def _hermite(start: Array, way: Array, first: Array, last: Array) -> tuple[Array, Array]:
    """(W, n, 2) each: the cubic from `start` with its slopes at both ends, and its way, of length 1."""
    s = PLACES[None, :, None]
    start, way, first, last = (v[:, None, :] for v in (start, way, first, last))
    at = start + s * s * (3.0 - 2.0 * s) * way + s * (1.0 - s) * ((1.0 - s) * first - s * last)
    slope = (
        6.0 * s * (1.0 - s) * way + (1.0 - s) * (1.0 - 3.0 * s) * first - s * (2.0 - 3.0 * s) * last
    )
    return at, slope / np.hypot(slope[..., :1], slope[..., 1:])


def _speeds(
    walls: WallEdges,
    smooth: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    before: Index,
    behind: Index,
) -> Array:
    """(W, n): linear from the middle of an edge to the next of its patch, and on to a corner."""
    own = walls.speed
    joined, change = [], []
    for there, other in ((smooth[0], before), (smooth[1], behind)):
        known = there & (walls.patch[other] == walls.patch) & np.isfinite(own[other])
        joined.append(known)
        change.append(np.where(known, 0.5 * (own[other] - own), 0.0))
    to_start = np.where(joined[0], change[0], -change[1])[:, None]
    to_stop = np.where(joined[1], change[1], -change[0])[:, None]
    part = 2.0 * PLACES - 1.0
    return np.asarray(
        own[:, None] + np.clip(-part, 0.0, None) * to_start + np.clip(part, 0.0, None) * to_stop
    )
