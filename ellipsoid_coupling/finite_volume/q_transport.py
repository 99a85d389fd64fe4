"""Transport of the q-equations' fields, confined to the rows' parts that hold mass."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.finite_volume.boundary import fill_ghosts
from ellipsoid_coupling.finite_volume.fluxes.contract import Flux
from ellipsoid_coupling.finite_volume.fused_xy_sweep import Move, sweep_planes
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.q_grid import NORMAL, Extents, grown
from ellipsoid_coupling.finite_volume.strips import Plane, strips_of
from ellipsoid_coupling.finite_volume.sweep import Runs, bundle_width, sweep_runs
from ellipsoid_coupling.geometry.ghost_table import GhostTable

Floats = NDArray[np.float64]


def transport(
    flux: Flux,
    fields: Floats,
    axis: int,
    ratio: float,
    extents: Extents,
    table: GhostTable,
    t: float,
    left: Floats | None = None,
) -> Extents:
    """One step of `flux` along one axis, in place; returns the extents that hold the mass now.

    Parameters
    ----------
    flux : NamedTuple
        A numerical flux of finite_volume/fluxes.
    fields : (K, na + 4, ny + 4, nx + 4) float64, contiguous
        Conserved fields; ghosts in x and y are filled here, in the angle they are not looked at.
    axis : int
        -1 for x, -2 for y, -3 for the angle, which is periodic.
    ratio : float
        dt / cell width along the axis.
    extents : (na, ny, 2) int64
        Hold all mass before the step.
    table : GhostTable
        Of the grid: what happens at the ends of x and y.
    t : float
        The time at the start of the step.
    left : (1,) float64, optional
        What leaves through the boundary is added, unless that is closed, in units of a cell's density.
    """
    components, *padded = fields.shape
    normal = NORMAL[axis]
    periodic = axis != -3 and table.kinds.wraps(axis)
    # Before the sweep: it moves mass by one cell, into cells that it must therefore visit.
    extents = grown(extents, padded[2] - 2 * GHOSTS, axis, periodic)
    # Ghosts that no sweep looks at are not filled.
    if axis != -3 and _reach_edge(extents, padded[2] - 2 * GHOSTS, axis):
        fill_ghosts(fields, axis, table, t)
    row, plane = padded[2], padded[1] * padded[2]
    stride = {-1: 1, -2: row, -3: plane}[axis]
    # The march itself goes on from the last angle to the first one.
    ring = (_corner(row, plane), extents.shape[0] * plane) if axis == -3 else (0, 0)
    runs = row_runs(extents, row, plane) if axis == -1 else column_runs(extents, row, plane, axis)
    if runs.first.size:
        flat = fields.reshape(components, -1)
        gone = sweep_runs(flux, flat, runs, stride, normal, ratio, ring)
        # Where no mass passes, the sum over the ends is rounding, and no outflow.
        if left is not None and axis != -3 and not table.kinds.closed:
            left += gone
    return extents


def transport_in_plane(
    flux: Flux,
    fields: Floats,
    move: Move,
    extents: Extents,
    table: GhostTable,
    left: Floats | None = None,
) -> Extents:
    """`transport` along x and y in one pass; see there and `fused_xy_sweep.Move`."""
    components, *padded = fields.shape
    columns, rows = padded[2] - 2 * GHOSTS, padded[1] - 2 * GHOSTS
    row, plane = padded[2], padded[1] * padded[2]
    kinds, axes = table.kinds, (-1, -2) if move.x_first else (-2, -1)
    first = grown(extents, columns, axes[0], kinds.wraps(axes[0]))
    second = grown(first, columns, axes[1], kinds.wraps(axes[1]))
    # Each sweep visits what has been grown for it; the second one grows from the first.
    along_x, along_y = (first, second) if move.x_first else (second, first)
    # All columns together: strips are cut across them.
    runs = bundle_runs(along_y, row, plane, -2, columns)
    if runs.first.size:
        planes = Plane(row, plane, columns, rows, _corner(row, plane))
        flat = fields.reshape(components, -1)
        strips = strips_of(runs, planes, kinds.wraps(-2), numba.get_num_threads())
        gone = sweep_planes(flux, flat, planes, strips, along_x, move, table)
        if left is not None and not kinds.closed:
            left += gone
    return second


def _corner(row: int, plane: int) -> int:
    """The first interior cell of flat padded fields."""
    return GHOSTS * (plane + row + 1)


def _reach_edge(extents: Extents, columns: int, axis: int) -> bool:
    """Whether a sweep of `extents` along an axis looks at a ghost, two cells beyond what it moves."""
    if axis == -1:
        first, end = extents[..., 0].min(), extents[..., 1].max()
        return bool(first < GHOSTS or end > columns - GHOSTS)
    held = extents[..., 1] > 0
    return bool(held[:, :GHOSTS].any() or held[:, -GHOSTS:].any())


def row_runs(extents: Extents, row: int, plane: int) -> Runs:
    """One run along x a row that holds mass; row and plane are the strides of the padded fields."""
    found = np.empty((2, extents.shape[0] * extents.shape[1]), np.int64)
    first, length = found[:, : _find_rows(extents, row, plane, found)]
    return Runs(first, length, np.ones(first.size, np.int64))


@kernel
def _find_rows(extents: Extents, row: int, plane: int, found: Extents) -> int:
    """Fill first and length of `found` (2, most); returns how many runs there are."""
    runs = 0
    for a in range(extents.shape[0]):
        for j in range(extents.shape[1]):
            first, end = extents[a, j, 0], extents[a, j, 1]
            if end > 0:
                found[0, runs] = (a + GHOSTS) * plane + (j + GHOSTS) * row + first + GHOSTS
                found[1, runs] = end - first
                runs += 1
    return runs


def column_runs(extents: Extents, row: int, plane: int, axis: int) -> Runs:
    """Runs along y or the angle of bundles of columns, each as narrow as the mass in it."""
    columns, lines = row - 2 * GHOSTS, extents.shape[0 if axis == -2 else 1]
    return bundle_runs(extents, row, plane, axis, bundle_width(columns, lines))


def bundle_runs(extents: Extents, row: int, plane: int, axis: int, bundle: int) -> Runs:
    """Runs along y or the angle of bundles of `bundle` columns each; see `column_runs`."""
    # Lines along the angle lead from plane to plane, those along y from row to row.
    lines = extents if axis == -2 else extents.transpose(1, 0, 2)
    outer, along = (plane, row) if axis == -2 else (row, plane)
    bundles = -(-(row - 2 * GHOSTS) // bundle)
    # Between two runs there is a row of vacuum at least.
    found = np.empty((3, lines.shape[0] * bundles * (lines.shape[1] // 2 + 1)), np.int64)
    strides = outer, along, _corner(row, plane)
    count = _find_runs(lines, (bundles, bundle), strides, axis == -3, found)
    return Runs(*np.ascontiguousarray(found[:, :count]))


@kernel
def _find_runs(
    lines: Extents,
    columns: tuple[int, int],
    strides: tuple[int, int, int],
    periodic: bool,
    found: Extents,
) -> int:
    """Fill first, length and width of `found` (3, most); returns how many runs there are.

    columns : how many bundles there are, and their width.
    strides : from line to line, along the lines, and where the first cell is.
    periodic : a run that reaches the end of its line goes on at the beginning.
    """
    bundles, bundle_size = columns
    outer, along, corner = strides
    rows = lines.shape[1]
    runs = 0
    for line in range(lines.shape[0]):
        for bundle in range(bundles):
            low, high = bundle * bundle_size, (bundle + 1) * bundle_size
            start = 0
            # From where nothing is, so that no run is found in two parts; from 0 all round.
            while periodic and start < rows and _meets(lines[line, start], low, high):
                start += 1
            start %= rows
            # An empty interval, which the first row with mass replaces.
            n, left, right = 0, high, low
            # One step more than there are rows, which closes a run at the end.
            for step in range(rows + 1):
                k = (start + step) % rows
                held = step < rows and _meets(lines[line, k], low, high)
                if held:
                    # As narrow as the mass in it, but of one width all along.
                    left = min(left, max(lines[line, k, 0], low))
                    right = max(right, min(lines[line, k, 1], high))
                    n += 1
                elif n > 0:
                    first = (start + step - n) % rows
                    found[0, runs] = corner + line * outer + first * along + left
                    found[1, runs], found[2, runs] = n, right - left
                    runs += 1
                    n, left, right = 0, high, low
    return runs


@kernel
def _meets(span: Extents, low: int, high: int) -> bool:
    """Whether a row holds mass in these columns."""
    return bool(max(span[0], low) < min(span[1], high))
