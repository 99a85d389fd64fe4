"""Whether places lie in the fluid that an outline bounds: how often the outline goes around them.

    W = (crossings upwards to the right of the place) - (crossings downwards)

The fluid lies on the left of each edge: W = 1 in it where the outline goes around all of it, 0 where it
goes around solids alone; one less in a solid. The two edges of a thin plate cancel.
"""

from __future__ import annotations

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


def enclosed_area(ends: Floats) -> float:
    """The area on the left of closed lines of edges (E, 2, 2); negative around solids alone, 0 of none."""
    if len(ends) == 0:
        return 0.0
    origin = ends.reshape(-1, 2).mean(axis=0)
    start, stop = ends[:, 0] - origin, ends[:, 1] - origin
    return float(0.5 * (start[:, 0] * stop[:, 1] - start[:, 1] * stop[:, 0]).sum())


def in_fluid(ends: Floats, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether places (n,) lie in the fluid on the left of the edges (E, 2, 2); see the module."""
    around = 1 if enclosed_area(ends) > 0.0 else 0
    return np.asarray(windings(ends, x, y) == around)
