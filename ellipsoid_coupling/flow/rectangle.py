"""Rectangles whose mesh is a lattice: psi at the lattice's points is that of the spline's nodes.

Even lattices are taken as they are, graded ones by a spline through their points; the velocity of the
four sides' walls gives the end slopes. Everything else is fitted, see `fitted`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, RectBivariateSpline

from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.mesh import MeshFlow
from ellipsoid_coupling.flow.openfoam.plane import SINGLE
from ellipsoid_coupling.flow.spline import WallVelocity

Array = NDArray[np.float64]

# Nodes per mesh width of a graded lattice, and their largest number per direction.
FINER = 2.0
MOST_CELLS = 400
# Fewer points each way make no spline with slopes of their own.
_LEAST_LEVELS = 5


class Lattice(NamedTuple):
    """Levels x (nx+1,), y (ny+1,) of a mesh, and the column and the row of each of its points (P,)."""

    x: Array
    y: Array
    column: NDArray[np.intp]
    row: NDArray[np.intp]


def lattice(mesh: MeshFlow) -> Lattice | None:
    """The mesh as a lattice that fills its rectangle, without a plate in it; None for others."""
    x, y = (_levels(axis) for axis in mesh.points.T)
    rim = 2 * (x.size + y.size - 2)
    whole = (
        min(x.size, y.size) >= _LEAST_LEVELS
        and x.size * y.size == len(mesh.points)
        and (x.size - 1) * (y.size - 1) == len(mesh.centres)
        and np.count_nonzero(mesh.edges.cells[:, 1] < 0) == rim
    )
    if not whole:
        return None
    column, row = _nearest(x, mesh.points[:, 0]), _nearest(y, mesh.points[:, 1])
    every = np.unique(row * x.size + column).size == len(mesh.points)
    return Lattice(x, y, column, row) if every else None


def rectangle(mesh: MeshFlow, at: Lattice, at_points: Array) -> FlowField:
    """The field from psi (P,) at the points of a mesh that is a lattice."""
    psi: Array = np.empty((at.y.size, at.x.size))
    psi[at.row, at.column] = at_points
    if _even(at.x) and _even(at.y):
        x, y = (_evenly(level[0], level[-1], level.size - 1) for level in (at.x, at.y))
    else:
        x, y = _even_nodes(mesh)
        psi = RectBivariateSpline(at.y, at.x, psi)(y, x)
    walls = _wall_velocity(mesh, x, y)
    tolerance = SINGLE * np.ptp(psi)
    closed = [bool(np.ptp(side) <= tolerance) for side in sides_around(psi)]
    return FlowField.from_stream_function(constant_on(closed, psi), x, y, "", walls)


def _levels(values: Array) -> Array:
    """The distinct values, up to single precision, ascending."""
    ordered = np.sort(values)
    tolerance = SINGLE * (ordered[-1] - ordered[0])
    return ordered[np.concatenate(([True], np.diff(ordered) > tolerance))]


def _even(levels: Array) -> bool:
    """Whether levels are evenly spaced, up to single precision."""
    even = np.linspace(levels[0], levels[-1], levels.size)
    return bool(np.abs(even - levels).max() <= SINGLE * np.ptp(levels))


def _nearest(levels: Array, values: Array) -> NDArray[np.intp]:
    """The index of the level next to each value."""
    return np.searchsorted(0.5 * (levels[1:] + levels[:-1]), values)


def _even_nodes(mesh: MeshFlow) -> tuple[Array, Array]:
    """Evenly spaced nodes over the mesh's rectangle, finer than its mean cell."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    width, height = high - low
    step = np.sqrt(width * height / mesh.centres.shape[0]) / FINER
    nx, ny = (int(np.clip(np.ceil(side / step), 8, MOST_CELLS)) for side in (width, height))
    return _evenly(low[0], high[0], nx), _evenly(low[1], high[1], ny)


def _evenly(low: float, high: float, cells: int) -> Array:
    return np.linspace(low, high, cells + 1)


def sides_around(nodes: Array) -> tuple[Array, Array, Array, Array]:
    """Bottom, right, top, left of (ny+1, nx+1): each begins where the one before has ended."""
    return nodes[0, :], nodes[:, -1], nodes[-1, ::-1], nodes[::-1, 0]


def constant_on(closed: Sequence[bool], psi: Array) -> Array:
    """The same psi, exactly constant on the `sides_around` that no fluid crosses."""
    psi = psi.copy()
    sides = sides_around(psi)
    first = closed.index(False) if False in closed else 0
    constant: float | None = None
    for k in range(first, first + 4):
        side = sides[k % 4]
        constant = (float(side[0]) if constant is None else constant) if closed[k % 4] else None
        if constant is not None:
            side[:] = constant
    return psi


def _wall_velocity(mesh: MeshFlow, x: Array, y: Array) -> WallVelocity:
    """The patches' tangential velocity at the nodes of the rectangle's sides, NaN where unknown."""
    return WallVelocity(
        left=_along(mesh, 0, x[0], y),
        right=_along(mesh, 0, x[-1], y),
        bottom=_along(mesh, 1, y[0], x),
        top=_along(mesh, 1, y[-1], x),
    )


def _along(mesh: MeshFlow, axis: int, position: float, nodes: Array) -> Array:
    """Tangential velocity at `nodes` on the side where coordinate `axis` has this position."""
    tolerance = SINGLE * max(np.ptp(mesh.points[:, 0]), np.ptp(mesh.points[:, 1]))
    total, count = np.zeros(nodes.size), np.zeros(nodes.size)
    for patch in mesh.patches.values():
        on_side = np.abs(patch.centres[:, axis] - position) < tolerance
        at, order = np.unique(patch.centres[on_side, 1 - axis], return_index=True)
        if at.size == 0:
            continue
        values = patch.velocity[on_side, 1 - axis][order]
        covered = _covered(nodes, at)
        # Natural ends: others overshoot where a jet ends within one or two faces of a corner.
        curve = CubicSpline(at, values, bc_type="natural") if at.size >= 4 else None
        total[covered] += (
            np.interp(nodes[covered], at, values) if curve is None else curve(nodes[covered])
        )
        count[covered] += 1.0
    # Where two patches meet, their mean; where there is none, not known.
    with np.errstate(invalid="ignore"):
        mean: Array = total / count
    return mean


def _covered(nodes: Array, at: Array) -> NDArray[np.bool_]:
    """The nodes next to a face: faces at `at`, ascending; a patch may have gaps."""
    if at.size == 1:
        return np.ones(nodes.size, bool)
    nearest = at[_nearest(at, nodes)]
    spacing = np.minimum(
        np.interp(nodes, 0.5 * (at[1:] + at[:-1]), np.diff(at)), 2.0 * np.median(np.diff(at))
    )
    return np.abs(nodes - nearest) <= 0.75 * spacing
