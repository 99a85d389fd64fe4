"""Whether places lie in the fluid that an outline bounds: how often the outline goes around them.

    W = (crossings upwards to the right of the place) - (crossings downwards)
      = (crossings downwards to the left of the place) - (crossings upwards)

The fluid lies on the left of each edge: W = 1 in it where the outline goes around all of it, 0 where it
goes around solids alone; one less in a solid. The two edges of a thin plate cancel. Places one by one take
the first form; the nodes of a grid take the second, row by row, so that each edge is looked at in its rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


@kernel
def _windings(ends: Floats, x: Floats, y: Floats, counts: Indices) -> None:
    for e in range(len(ends)):
        ax, ay, bx, by = ends[e, 0, 0], ends[e, 0, 1], ends[e, 1, 0], ends[e, 1, 1]
        low, high = min(ay, by), max(ay, by)
        for i in range(x.size):
            # Half open: a place on the height of a corner meets one of the two edges there.
            if low <= y[i] < high:
                side = (bx - ax) * (y[i] - ay) - (by - ay) * (x[i] - ax)
                if by > ay and side > 0.0:
                    counts[i] += 1
                elif by < ay and side < 0.0:
                    counts[i] -= 1


def windings(ends: Floats, x: Floats, y: Floats) -> Indices:
    """How often edges (E, 2, 2) go around places (n,), counter-clockwise."""
    counts = np.zeros(x.size, np.int64)
    _windings(ends, x, y, counts)
    return counts


class Crossings(NamedTuple):
    """Edges that cross rows, (n,) each: their numbers, the rows, where, and whether they point down."""

    edge: Indices
    row: Indices
    at: Floats
    down: NDArray[np.bool_]


def row_crossings(ends: Floats, y: Floats) -> Crossings:
    """Where edges (E, 2, 2) cross the rows at y (ny,), ascending."""
    down = ends[:, 0, 1] > ends[:, 1, 1]
    # From the lower end up, so that both edges of a thin plate are crossed in the same place.
    low = np.where(down[:, None], ends[:, 1], ends[:, 0])
    high = np.where(down[:, None], ends[:, 0], ends[:, 1])
    first, stop = np.searchsorted(y, low[:, 1]), np.searchsorted(y, high[:, 1])
    times = stop - first
    edge = np.repeat(np.arange(times.size), times)
    row = np.repeat(first - np.cumsum(times) + times, times) + np.arange(edge.size)
    part = (y[row] - low[edge, 1]) / (high[edge, 1] - low[edge, 1])
    at = low[edge, 0] + part * (high[edge, 0] - low[edge, 0])
    return Crossings(edge, row, at, down[edge])


def grid_in_fluid(ends: Floats, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """(ny, nx), which nodes x (nx,), y (ny,), ascending, lie in the fluid on the left of the edges."""
    crossed = row_crossings(ends, y)
    turns = np.zeros((y.size, x.size + 1), np.int64)
    np.add.at(turns, (crossed.row, np.searchsorted(x, crossed.at)), np.where(crossed.down, 1, -1))
    return np.asarray(np.cumsum(turns, axis=1)[:, :-1] >= turns_in_fluid(ends))


def enclosed_area(ends: Floats) -> float:
    """The area on the left of closed lines of edges (E, 2, 2); negative around solids alone, 0 of none."""
    if len(ends) == 0:
        return 0.0
    origin = ends.reshape(-1, 2).mean(axis=0)
    start, stop = ends[:, 0] - origin, ends[:, 1] - origin
    return float(0.5 * (start[:, 0] * stop[:, 1] - start[:, 1] * stop[:, 0]).sum())


def turns_in_fluid(ends: Floats) -> int:
    """How often edges (E, 2, 2) go around their fluid: once, or not at all around solids alone."""
    return 1 if enclosed_area(ends) > 0.0 else 0


def in_fluid(ends: Floats, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether places (n,) lie in the fluid on the left of the edges (E, 2, 2); see the module."""
    return np.asarray(windings(ends, x, y) >= turns_in_fluid(ends))
