"""When characteristics cross: the end of a mono-kinetic closure, seen from its own velocities.

Where particles move alike, a compression alpha = -dv/dx brings neighbours together in the time
1/alpha, unless damping Gamma stops them before: only alpha > Gamma counts. A grid cannot resolve the
blow-up alpha = 1/(t* - t): the measured alpha saturates, early for a diffusive scheme, within a few
cells of t* for a sharp one. So the estimate t + 1/alpha is followed:

    crossed    once t passes the earliest estimate while alpha is still half of its largest value
    the time   the present estimate while alpha grows, else the earliest estimate

Compressions of cells that hold hardly any mass do not count.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import block_size, chunk, over_row, prefetch_block
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at
from ellipsoid_coupling.compiled.threads import single_task_chunks
from ellipsoid_coupling.compiled.tuning import ROW_TASKS
from ellipsoid_coupling.finite_volume.fluxes.contract import DENSITY
from ellipsoid_coupling.finite_volume.grid import GHOSTS

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# Cells below this part of the largest density do not count.
NEGLIGIBLE = 1e-3
# A compression that has fallen below this part of its largest value has ended otherwise.
PERSISTING = 0.5

_CROSSED, _EARLIEST, _STRONGEST = range(3)
_X, _Y = 1, 2


@inline_kernel
def _jump(
    density: float, momentum: float, next_density: float, next_one: float, least: float
) -> float:
    """V - v_next, where both cells are denser than `least`; by one division."""
    # Velocities need two divisions, the common denominator one.
    jump = (momentum * next_density - next_one * density) / (density * next_density)
    return jump if min(density, next_density) > least else 0.0


@inline_kernel
def _raise_to_jump(
    i: int, cells: Rows, above: Rows, width: int, least: float, peaks: Floats
) -> None:
    here, beside, upper = load(cells, i), load(cells, i + 1), load(above, i)
    x = _jump(here[DENSITY], here[_X], beside[DENSITY], beside[_X], least)
    y = _jump(here[DENSITY], here[_Y], upper[DENSITY], upper[_Y], least)
    # The last cell of a run has no neighbour along x.
    peaks[i] = max(peaks[i], x if i + 1 < width else 0.0, y)


@kernel(noalias=True)
def _raise_to_jumps(cells: Rows, above: Rows, width: int, least: float, peaks: Floats) -> None:
    """Raise `peaks` to the jumps of a run of cells along x and to the row `above`.

    cells, above : density and both momenta.
    """
    over_row(width, _raise_to_jump, (cells, above, width, least, peaks))


@parallel_kernel
def _largest_density(fields: Floats, skipped: int, extents: Indices) -> float:
    """Of all cells; see `_largest_jump`."""
    rows = extents.shape[1]
    lines = extents.shape[0] * rows
    tasks = min(lines, ROW_TASKS)
    peaks = np.zeros(tasks)
    for task in numba.prange(tasks):
        peak = np.zeros(fields.shape[3])
        begin, end = chunk(task, tasks, lines)
        for line in range(begin, end):
            a, j = line // rows, line % rows
            width = extents[a, j, 1] - extents[a, j, 0]
            if width > 0:
                first = extents[a, j, 0] + GHOSTS
                density = fields[DENSITY, a + skipped, j + GHOSTS, first : first + width]
                # A peak a column: one number for all would wait for each comparison.
                for i in range(width):
                    peak[i] = max(peak[i], density[i])
        peaks[task] = peak.max()
    return float(peaks.max())


@parallel_kernel
def _largest_jump(fields: Floats, skipped: int, extents: Indices, least: float) -> float:
    """The largest v_i - v_{i+1}, along x or y, of neighbours denser than `least`; at least 0.

    fields : (K, planes, ny + 4, nx + 4), density and both momenta first; ghosts are left out.
    skipped : the number of ghost planes at either end.
    extents : (planes less those, ny, 2), first and end column of what may hold mass.
    """
    rows = extents.shape[1]
    lines = extents.shape[0] * rows
    tasks = min(lines, ROW_TASKS)
    # Rows of a component, all its planes one after another.
    plane, block = fields.shape[1] * fields.shape[2], block_size(3)
    jumps = np.zeros(tasks)
    for task in numba.prange(tasks):
        peaks = np.zeros(fields.shape[3])
        begin, last = chunk(task, tasks, lines)
        # In order: the row above is the next one, and is then still in cache.
        for line in range(begin, last):
            a, j = line // rows, line % rows
            width = extents[a, j, 1] - extents[a, j, 0]
            if width > 0:
                row = (a + skipped) * fields.shape[2] + j + GHOSTS
                end = extents[a, j, 1] + GHOSTS
                # The last row is its own neighbour: no jump.
                up = row + 1 if j + 1 < rows else row
                for first in range(end - width, end, block):
                    # The row above has been asked for with the one before.
                    coming = row + 2
                    prefetch_block(
                        rows_at(fields, (coming, coming + plane, coming + 2 * plane), first), block
                    )
                    cells = rows_at(fields, (row, row + plane, row + 2 * plane), first)
                    above = rows_at(fields, (up, up + plane, up + 2 * plane), first)
                    # One cell more than the block, for the jump to the next one.
                    _raise_to_jumps(cells, above, min(block + 1, end - first), least, peaks)
        jumps[task] = peaks.max()
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
    skipped = 0 if fields.ndim == 3 else GHOSTS
    planes = fields.reshape(fields.shape[0], -1, *fields.shape[-2:])
    if extents is None:
        ny, nx = (n - 2 * GHOSTS for n in planes.shape[2:])
        count = planes.shape[1] - 2 * skipped
        extents = np.broadcast_to(np.array([0, nx]), (count, ny, 2)).copy()
    with single_task_chunks():
        least = NEGLIGIBLE * _largest_density(planes, skipped, extents)
        return _largest_jump(planes, skipped, extents, least) / cell if least > 0.0 else 0.0


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
        """Update the estimate by the fields at the time `now`; see `largest_compression`."""
        if np.isfinite(self.memory[_CROSSED]):
            return
        compression = largest_compression(fields, cell, extents)
        if compression <= self._damping:
            return
        # The blow-up has ended, or is out of the grid's reach, once the compression falls.
        grows = compression >= self.memory[_STRONGEST]
        estimate = now + 1.0 / compression
        self.memory[_STRONGEST] = max(compression, self.memory[_STRONGEST])
        self.memory[_EARLIEST] = min(estimate, self.memory[_EARLIEST])
        persists = compression >= PERSISTING * self.memory[_STRONGEST]
        if persists and now >= self.memory[_EARLIEST]:
            self.memory[_CROSSED] = estimate if grows else self.memory[_EARLIEST]
