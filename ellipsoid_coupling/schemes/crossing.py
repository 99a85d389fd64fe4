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

from ellipsoid_coupling.kernels import parallel_kernel, view_kernel
from ellipsoid_coupling.schemes.fluxes.contract import DENSITY
from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# Cells below this part of the largest density do not count.
NEGLIGIBLE = 1e-3
# A compression that has fallen below this part of its largest value has ended otherwise.
PERSISTING = 0.5

_CROSSED, _EARLIEST, _STRONGEST = range(3)
_X, _Y = 1, 2


# Rows are dealt out in so many tasks at most, each with room of its own.
_TASKS = 64


@view_kernel
def _invert_dense(density: Floats, least: float, inverse: Floats) -> None:
    """1/rho of cells denser than `least`, else 0."""
    for i in range(inverse.size):
        inverse[i] = 1.0 / density[i] if density[i] > least else 0.0


@view_kernel
def _raise_to_jumps(
    momentum: Floats, inverse: Floats, next_momentum: Floats, next_inverse: Floats, peaks: Floats
) -> None:
    """Raise `peaks` to v - v_next where both cells are dense."""
    for i in range(peaks.size):
        jump = momentum[i] * inverse[i] - next_momentum[i] * next_inverse[i]
        jump = jump if inverse[i] * next_inverse[i] > 0.0 else 0.0
        peaks[i] = max(peaks[i], jump)


@view_kernel
def _raise_to_row(
    fields: Floats,
    at: tuple[int, int, int],
    width: int,
    has_next: bool,
    least: float,
    work: Floats,
) -> None:
    """`_raise_to_jumps` of a run of cells along x, and along y to the next row if there is one.

    work : (3, width or more), the peaks and room for two rows.
    """
    a, j, first = at
    end = first + width
    peaks, inverse, above = work[0, :width], work[1, :width], work[2, :width]
    # Each row by itself is contiguous; a slice of all components would not be.
    _invert_dense(fields[DENSITY, a, j, first:end], least, inverse)
    x = fields[_X, a, j, first:end]
    _raise_to_jumps(x[:-1], inverse[:-1], x[1:], inverse[1:], peaks[:-1])
    if has_next:
        _invert_dense(fields[DENSITY, a, j + 1, first:end], least, above)
        y, next_y = fields[_Y, a, j, first:end], fields[_Y, a, j + 1, first:end]
        _raise_to_jumps(y, inverse, next_y, above, peaks)


@parallel_kernel
def _largest_density(fields: Floats, extents: Indices) -> float:
    """Of all cells; see `_largest_jump`."""
    rows = extents.shape[1]
    lines = extents.shape[0] * rows
    tasks = min(lines, _TASKS)
    peaks = np.zeros(tasks)
    for task in numba.prange(tasks):
        peak = np.zeros(fields.shape[3])
        for line in range(task, lines, tasks):
            a, j = line // rows, line % rows
            width = extents[a, j, 1] - extents[a, j, 0]
            if width > 0:
                first = extents[a, j, 0] + GHOSTS
                density = fields[DENSITY, a, j + GHOSTS, first : first + width]
                for i in range(width):
                    peak[i] = max(peak[i], density[i])
        peaks[task] = peak.max()
    return float(peaks.max())


@parallel_kernel
def _largest_jump(fields: Floats, extents: Indices, least: float) -> float:
    """The largest v_i - v_{i+1}, along x or y, of neighbours denser than `least`; at least 0.

    fields : (K, planes, ny + 4, nx + 4), density and both momenta first; ghosts are left out.
    extents : (planes, ny, 2), first and end column of what may hold mass.
    """
    rows = extents.shape[1]
    lines = extents.shape[0] * rows
    tasks = min(lines, _TASKS)
    jumps = np.zeros(tasks)
    for task in numba.prange(tasks):
        work = np.zeros((3, fields.shape[3]))
        # Every so manyth line: mass is in some of the planes, and all threads shall have a share.
        for line in range(task, lines, tasks):
            a, j = line // rows, line % rows
            width = extents[a, j, 1] - extents[a, j, 0]
            if width > 0:
                at = a, j + GHOSTS, extents[a, j, 0] + GHOSTS
                _raise_to_row(fields, at, width, j + 1 < rows, least, work)
        jumps[task] = work[0].max()
    return float(jumps.max())


def largest_compression(fields: Floats, cell: float, extents: Indices | None = None) -> float:
    """The largest -dv_x/dx or -dv_y/dy of cells that hold mass, 1/time; 0 without compression.

    Parameters
    ----------
    fields : (K, ny + 4, nx + 4) or (K, na + 4, ny + 4, nx + 4) float64
        Padded conserved fields: density and the momenta along x and y first. Ghost planes of the
        angle are left out.
    cell : float
        Cell width h.
    extents : (na, ny, 2) int64, optional
        First and end column of what every row holds, end 0 if nothing, where that is known.
    """
    inner = fields if fields.ndim == 3 else fields[:, GHOSTS:-GHOSTS]
    planes = inner.reshape(fields.shape[0], -1, *fields.shape[-2:])
    if extents is None:
        ny, nx = (n - 2 * GHOSTS for n in planes.shape[2:])
        extents = np.broadcast_to(np.array([0, nx]), (planes.shape[1], ny, 2)).copy()
    largest = _largest_density(planes, extents)
    return _largest_jump(planes, extents, NEGLIGIBLE * largest) / cell if largest > 0.0 else 0.0


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

    def look(self, fields: Floats, cell: float, now: float, extents: Indices | None = None) -> None:
        """Take notice of the fields at the time `now`; see `largest_compression`."""
        if np.isfinite(self.memory[_CROSSED]):
            return
        compression = largest_compression(fields, cell, extents)
        if compression <= self._damping:
            return
        grows = compression >= self.memory[_STRONGEST]
        estimate = now + 1.0 / compression
        self.memory[_STRONGEST] = max(compression, self.memory[_STRONGEST])
        self.memory[_EARLIEST] = min(estimate, self.memory[_EARLIEST])
        persists = compression >= PERSISTING * self.memory[_STRONGEST]
        if persists and now >= self.memory[_EARLIEST]:
            self.memory[_CROSSED] = estimate if grows else self.memory[_EARLIEST]
