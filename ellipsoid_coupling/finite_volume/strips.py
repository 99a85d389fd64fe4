"""Runs of rows cut into strips, so that all threads have some.

A strip looks at two rows on the other side of a cut. Where y is periodic, the seam between the top and
the bottom is one more cut:

    strip above    row above + 1 ]              row 1        ]
                   row above     ] copies 2, 3  row 0        ] copies 2, 3 of the seam
    cut            - - - - - - -                - - - - - -
                   row below     ] copies 0, 1  row ny - 1   ] copies 0, 1
    strip below    row below - 1 ]              row ny - 2   ]
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.tuning import SHORTEST_STRIP, STRIPS_PER_THREAD
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.sweep import Runs

Indices = NDArray[np.int64]


class Plane(NamedTuple):
    """Planes of padded fields, in flat cells.

    row, next_plane : from row to row, from plane to plane; columns, rows : of the interior; corner :
    the first interior cell.
    """

    row: int
    next_plane: int
    columns: int
    rows: int
    corner: int


class Strips(NamedTuple):
    """What threads share: `Runs` along y of all columns together, cut where they are long.

    first, length, width : (T,) int64, first flat cell, rows, columns.
    low, high : (T,) int64, number of the cut at the lower and the upper end, -1 where the run ends.
    below, above : (cuts,) int64, a flat cell of the row on either side of each cut.
    """

    first: Indices
    length: Indices
    width: Indices
    low: Indices
    high: Indices
    below: Indices
    above: Indices


def strips_of(runs: Runs, plane: Plane, periodic: bool, threads: int) -> Strips:
    """Cut runs along y into strips, enough of them for all threads, and at the seam of a periodic y."""
    # Rows of a strip if all strips had as many.
    fair = -(-int(runs.length.sum()) // (STRIPS_PER_THREAD * threads))
    # Shorter strips would copy more rows beside their cuts than they gain.
    pieces = np.maximum(-(-runs.length // max(fair, SHORTEST_STRIP)), 1)
    run = np.repeat(np.arange(pieces.size), pieces)
    # The number of a strip within its run: all but the first one begin at a cut.
    piece = np.arange(run.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    begin, end = (k * runs.length[run] // pieces[run] for k in (piece, piece + 1))
    first, inner = runs.first[run] + begin * plane.row, piece > 0
    # Cuts are counted as they come.
    low = np.where(inner, np.cumsum(inner) - 1, -1)
    # A strip ends where the next one begins; behind the last one of a run a run begins, which is no cut.
    high = np.append(low[1:], -1)
    above = first[inner]
    strips = Strips(first, end - begin, runs.width[run], low, high, above - plane.row, above)
    return _with_seams(strips, plane) if periodic else strips


def _with_seams(strips: Strips, plane: Plane) -> Strips:
    """One more cut for each plane where a strip begins at the bottom or ends at the top."""
    rows = plane.next_plane // plane.row
    # Rows of padded planes; from the corner on interior ones are 0 .. rows - 1.
    a, j = np.divmod((strips.first - plane.corner) // plane.row, rows)
    bottom, top = j == 0, j + strips.length == plane.rows
    # Only planes in which something looks across the seam.
    planes = np.unique(a[bottom | top])
    # Seams are counted behind the cuts.
    seam = strips.above.size + np.searchsorted(planes, a)
    lowest = plane.corner + planes * plane.next_plane
    return strips._replace(
        low=np.where(bottom, seam, strips.low),
        high=np.where(top, seam, strips.high),
        below=np.append(strips.below, lowest + (plane.rows - 1) * plane.row),
        above=np.append(strips.above, lowest),
    )


# The same in each step of an r-grid.
@functools.cache
def whole_plane(
    padded: tuple[int, int], periodic: bool, threads: int
) -> tuple[Plane, Strips, Indices]:
    """A padded r-grid (ny + 4, nx + 4) that is filled, for so many threads; see `sweep_planes`."""
    rows, columns = (n - 2 * GHOSTS for n in padded)
    corner = GHOSTS * (padded[1] + 1)
    plane = Plane(padded[1], padded[0] * padded[1], columns, rows, corner)
    runs = Runs(*(np.full(1, number) for number in (corner, rows, columns)))
    # All of each row: an r-grid is filled.
    return plane, strips_of(runs, plane, periodic, threads), np.array([[[0, columns]] * rows])
