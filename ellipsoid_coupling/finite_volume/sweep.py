"""One step of transport in one direction, in place and with one pass over memory.

One loop treats all fields of a cell:

    U_p += F_{p-1/2} - F_{p+1/2}     as soon as the flux through its upper face is known, for which
                                     the cell above still holds its old values

Along x (stride 1) the last face is kept from one cell to the next, in registers. Across rows (y, angle)
bundles of columns march through the rows (`march`). A sweep visits a list of runs, so that only cells that
can hold mass are touched.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import fill
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import chunk, prefetch_block, round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, unpack
from ellipsoid_coupling.compiled.rows import Rows, element, load, rows_at, store
from ellipsoid_coupling.compiled.threads import small_chunks
from ellipsoid_coupling.compiled.tuning import (
    FAR_CELLS,
    MANY_LINES,
    NARROW_BUNDLE,
    TASKS_PER_THREAD,
    WIDE_BUNDLE,
)
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    DENSITY,
    Flux,
    Stencil,
    in_order,
    kept_for,
    through_face,
)
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.march import (
    March,
    Ring,
    invert,
    march_workspace,
    run_march,
    updated,
)

Floats = NDArray[np.float64]


def bundle_width(columns: int, lines: int) -> int:
    """How many of `columns` march together on each of `lines`; all bundles but the last are alike."""
    # Equal bundles, so that no thread ends with a narrow one; whole vectors, so that none is
    # masked.
    most = WIDE_BUNDLE if lines >= MANY_LINES else NARROW_BUNDLE
    return int(round_up_to_vectors(-(-columns // -(-columns // most))))


class Runs(NamedTuple):
    """What one sweep visits, (T,) int64 each, as flat indices of padded fields.

    first : the first cell; length : how many cells it goes along the swept direction; width : how
    many neighbouring columns march together (1 along x).
    """

    first: NDArray[np.int64]
    length: NDArray[np.int64]
    width: NDArray[np.int64]


@kernel(noalias=True)
def _along(
    flux: Flux,
    cells: Rows,
    cell: int,
    width: int,
    ratio: float,
    inverses: Floats,
    through: Floats,
) -> None:
    """Step `width` neighbours along x, of which two `cells` before them are the first.

        cells     i       i + 1      i + 2
              |  below  |  here   |  above  |     the flux through face i needs the cell above its own;
                        ^ face i                  with it, both faces of the cell below are known

    cell : their flat index; inverses : 1/rho from there on.
    through : overwritten by the mass that goes up through face i, for each i.
    """
    # Nothing comes through the face before the first: it would go into a ghost, which is not stored.
    leaving = fill(0.0, load(cells, 0))
    up = kept_for(flux, leaving)
    for i in range(through.size):
        here = Stencil(
            load(cells, i),
            load(cells, i + 1),
            load(cells, i + 2),
            (inverses[i], element(inverses, i + 1), element(inverses, i + 2)),
            cell + i + 1,
            1,
        )
        entering = leaving
        leaving, up = through_face(flux, here, up, ratio)
        through[i] = leaving[DENSITY]
        # The first two steps are for ghosts, the last ones fill a vector: neither changes a cell.
        if i >= GHOSTS and i < width + GHOSTS:
            store(cells, i, updated(flux, here.below, entering, leaving))


class RowScratch(NamedTuple):
    """Memory for one row at a time: 1/rho of its cells, and the mass through its faces."""

    inverses: Floats
    through: Floats


@inline_kernel
def row_scratch(longest: int) -> RowScratch:
    """For rows of at most `longest` cells, ghosts included."""
    return RowScratch(
        np.empty(round_up_to_vectors(longest) + GHOSTS), np.empty(round_up_to_vectors(longest))
    )


@kernel(noalias=True)
def sweep_row(
    flux: Flux,
    cells: Rows,
    cell: int,
    width: int,
    ratio: float,
    scratch: RowScratch,
) -> float:
    """Step `width` neighbours along x; `cells` and `cell` begin two ghosts before them.

    Returns the mass that has left through both ends, less what came in.
    """
    # Faces 1 .. width + 1 are those of the interior cells; whole vectors of them are computed.
    whole = round_up_to_vectors(width + 2)
    inverses, through = scratch.inverses[: whole + 2], scratch.through[:whole]
    invert(cells, flux.vacuum, inverses)
    _along(flux, cells, cell, width, ratio, inverses, through)
    # A face counts upwards: what goes through the lower one comes in.
    return float(through[width + 1] - through[1])


@parallel_kernel
def _sweep_rows(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    runs: Runs,
    ratio: float,
    tasks: int,
    outflow: Floats,
) -> None:
    starts, counts, _ = runs
    longest = counts.max() + 2 * GHOSTS
    packed = pack(flux)
    for task in numba.prange(tasks):
        # Each task has its own memory for a row: it stays in that core's cache.
        own, scratch = unpack(packed), row_scratch(longest)
        begin, end = chunk(task, tasks, starts.size)
        for row in range(begin, end):
            first, width = starts[row] - GHOSTS, counts[row]
            # Hardware prefetch reads on into the next row only where that follows at once.
            if row + 1 < starts.size and starts[row + 1] - starts[row] > width + FAR_CELLS:
                ahead = rows_at(fields, components, starts[row + 1] - GHOSTS)
                prefetch_block(ahead, counts[row + 1] + 2 * GHOSTS)
            cells = rows_at(fields, components, first)
            outflow[row] = sweep_row(own, cells, first, width, ratio, scratch)


@parallel_kernel
def _sweep_columns(
    flux: Flux,
    fields: Floats,
    components: tuple[int, ...],
    runs: Runs,
    way: tuple[int, int, int],
    ratio: float,
    outflow: Floats,
) -> None:
    """See `sweep_runs`; `way` is from row to row, the first row's first cell, and all around or 0."""
    starts, counts, widths = runs
    stride, corner, around = way
    packed = pack(flux)
    for task in numba.prange(starts.size):
        own = unpack(packed)
        first, row = starts[task], round_up_to_vectors(widths[task])
        if around == 0:
            # The march looks at the row above the last one, which must end within the fields.
            row = min(row, fields.shape[1] - first - (counts[task] + 1) * stride)
        march = March(first, counts[task], widths[task], stride)
        # The march's own column in the first row of the ring.
        ring = Ring(first - (first - corner) // stride * stride, around)
        workspaces = march_workspace(components, row), np.empty((GHOSTS, len(components), row))
        outflow[task] = run_march(own, fields, components, march, ring, ratio, workspaces)


def sweep_runs(
    flux: Flux,
    fields: Floats,
    runs: Runs,
    stride: int,
    normal: int,
    ratio: float,
    ring: tuple[int, int] = (0, 0),
) -> float:
    """Transport of all runs in one direction, in place.

    Parameters
    ----------
    flux : NamedTuple
        Chooses the numerical flux.
    fields : (K, cells) float64
        Padded fields, flat; ghosts filled. No run may be a neighbour of another along the
        direction, nor of mass that belongs to none.
    runs : Runs
    stride : int
        Distance of neighbours along the direction, 1 along x.
    normal : int
        Component of the momentum along it.
    ratio : float
        dt / h.
    ring : (int, int)
        Of a periodic direction the first interior cell and the distance all around; runs go on from
        the last row to the first one, and no ghosts of the fields are needed (those of arrays that
        belong to the flux are).

    Returns
    -------
    float
        The mass that has left through the ends of runs, less what came in, in units of a cell's
        density.
    """
    # A number a run: the order of their sum does not depend on threads.
    outflow = np.empty(runs.first.size)
    components = in_order(fields.shape[0], normal)
    with small_chunks(runs.first.size):
        if stride == 1:
            # Rows differ in length: several tasks a thread balance them.
            tasks = max(1, min(runs.first.size, TASKS_PER_THREAD * numba.get_num_threads()))
            _sweep_rows(flux, fields, components, runs, ratio, tasks, outflow)
        else:
            _sweep_columns(flux, fields, components, runs, (stride, *ring), ratio, outflow)
    return float(outflow.sum())
