"""When characteristics cross: the end of a mono-kinetic closure, seen from its own velocities.

Where particles move alike, a compression alpha = -dv/dx brings neighbours together in the time
1/alpha, unless damping Gamma stops them before: only alpha > Gamma counts. On a grid alpha cannot
follow its blow-up 1/(t* - t) to the end: it stays behind, early in a diffusive scheme, a few cells
before the end in a sharp one. So the estimate t + 1/alpha is followed:

    crossed    once t passes the earliest estimate while alpha is still half of its largest value
    the time   the present estimate while alpha grows, else the earliest estimate

Compressions of cells that hold hardly any mass do not count.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import parallel_kernel
from ellipsoid_coupling.schemes.fluxes.contract import DENSITY
from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]

# Cells below this part of the largest density do not count.
NEGLIGIBLE = 1e-3
# A compression that has fallen below this part of its largest value has ended otherwise.
PERSISTING = 0.5

_CROSSED, _EARLIEST, _STRONGEST = range(3)
_X, _Y = 1, 2


@parallel_kernel
def _densest(fields: Floats, held: NDArray[np.bool_]) -> float:
    """The largest density of the rows that are `held`; at least 0."""
    rows = held.shape[1]
    densest = np.zeros(held.size)
    for task in numba.prange(held.size):
        a, j = task // rows, task % rows
        largest = 0.0
        for i in range(GHOSTS, fields.shape[3] - GHOSTS if held[a, j] else GHOSTS):
            largest = max(largest, fields[DENSITY, a, j + GHOSTS, i])
        densest[task] = largest
    return float(densest.max())


@parallel_kernel
def _largest_jump(fields: Floats, held: NDArray[np.bool_], least: float) -> float:
    """The largest v_i - v_{i+1}, along x or y, of neighbours denser than `least`; at least 0.

    fields : (K, planes, ny + 4, nx + 4), density and both momenta first; ghosts are left out.
    held : (planes, ny), the rows that may hold mass.
    """
    rows = held.shape[1]
    jumps = np.zeros(held.size)
    for task in numba.prange(held.size):
        a, j = task // rows, task % rows + GHOSTS
        largest = 0.0
        for i in range(GHOSTS, fields.shape[3] - GHOSTS if held[a, j - GHOSTS] else GHOSTS):
            here = fields[DENSITY, a, j, i]
            if here > least:
                right, above = fields[DENSITY, a, j, i + 1], fields[DENSITY, a, j + 1, i]
                if right > least and i + 1 < fields.shape[3] - GHOSTS:
                    jump = fields[_X, a, j, i] / here - fields[_X, a, j, i + 1] / right
                    largest = max(largest, jump)
                if above > least and j + 1 < rows + GHOSTS:
                    jump = fields[_Y, a, j, i] / here - fields[_Y, a, j + 1, i] / above
                    largest = max(largest, jump)
        jumps[task] = largest
    return float(jumps.max())


def largest_compression(
    fields: Floats, cell: float, held: NDArray[np.bool_] | None = None
) -> float:
    """The largest -dv_x/dx or -dv_y/dy of cells that hold mass, 1/time; 0 without compression.

    Parameters
    ----------
    fields : (K, ny + 4, nx + 4) or (K, na + 4, ny + 4, nx + 4) float64
        Padded conserved fields: density and the momenta along x and y first. Ghost planes of the
        angle are left out.
    cell : float
        Cell width h.
    held : (na, ny) bool, optional
        The rows that hold any mass, where that is known.
    """
    inner = fields if fields.ndim == 3 else fields[:, GHOSTS:-GHOSTS]
    planes = inner.reshape(fields.shape[0], -1, *fields.shape[-2:])
    if held is None:
        held = np.ones((planes.shape[1], planes.shape[2] - 2 * GHOSTS), np.bool_)
    largest = _densest(planes, held)
    return _largest_jump(planes, held, NEGLIGIBLE * largest) / cell if largest > 0.0 else 0.0


class CrossingDetector:
    """Follows a mono-kinetic solution and remembers when its characteristics first crossed.

    Parameters
    ----------
    damping : float
        Gamma, the total damping of velocities.

    Attributes
    ----------
    memory : (3,) float64
        All that a restart needs.
    """

    def __init__(self, damping: float) -> None:
        self._damping = damping
        self.memory = np.array([np.nan, np.inf, 0.0])

    @property
    def time(self) -> float:
        """When characteristics first crossed; NaN if they have not."""
        return float(self.memory[_CROSSED])

    def counts(self) -> dict[str, float]:
        """The crossing time for a model's `counts`; empty where characteristics have not crossed."""
        return {"crossing_time": self.time} if np.isfinite(self.time) else {}

    def look(
        self, fields: Floats, cell: float, now: float, held: NDArray[np.bool_] | None = None
    ) -> None:
        """Take notice of the fields at the time `now`; see `largest_compression`."""
        if np.isfinite(self.memory[_CROSSED]):
            return
        compression = largest_compression(fields, cell, held)
        if compression <= self._damping:
            return
        grows = compression >= self.memory[_STRONGEST]
        estimate = now + 1.0 / compression
        self.memory[_STRONGEST] = max(compression, self.memory[_STRONGEST])
        self.memory[_EARLIEST] = min(estimate, self.memory[_EARLIEST])
        persists = compression >= PERSISTING * self.memory[_STRONGEST]
        if persists and now >= self.memory[_EARLIEST]:
            self.memory[_CROSSED] = estimate if grows else self.memory[_EARLIEST]
