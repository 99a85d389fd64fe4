"""From what a reader found on a plane mesh to a `FlowField` on a uniform grid."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import (
    CloughTocher2DInterpolator,
    CubicSpline,
    PchipInterpolator,
    RectBivariateSpline,
)
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import spsolve

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.openfoam.plane import SINGLE
from ellipsoid_coupling.flow.plates import plates, without_plates
from ellipsoid_coupling.flow.polygons import Edges
from ellipsoid_coupling.flow.spline import WallVelocity
from ellipsoid_coupling.flow.stream_function import Patch, given_on_edges, stream_function

Array = NDArray[np.float64]
Contains = Callable[[Array], NDArray[np.bool_]]

# Nodes per mesh width where the mesh is not a uniform one, and their largest number per direction.
FINER = 2.0
MOST_CELLS = 400
# A lattice with obstacles has at most this many nodes per mesh point; an irregular mesh has more.
SPARSEST = 4.0
# Where the slopes of a scattered psi have settled, relative: psi to 1e-9 of its range; each further
# factor of 100 doubles the time.
SLOPES = 1e-8
# A field further off U than this, rms over the cells, is another flow. The mesh's own error is 3 to
# 8 % where a jet is two cells wide, less elsewhere; that of a flow with sources does not go away.
LARGEST_MISFIT = 0.1


@dataclass(frozen=True)
class MeshFlow:
    """One solved plane case, as either reader hands it over.

    points : (P, 2), the mesh points of one plane
    edges : between them
    centres : (C, 2) of the cells;  velocity : (C, 2) in them
    patches : by name, without the empty ones
    contains : whether points (n, 2) lie in the mesh, (n,)
    where, origin : the folder for messages, the line for `FlowField.origin`
    corner : (2,), the place in the case from which points and centres are measured
    """

    points: Array
    edges: Edges
    centres: Array
    velocity: Array
    patches: Mapping[str, Patch]
    contains: Contains
    where: str
    origin: str
    corner: Array


class _Grid(NamedTuple):
    """Nodes x (nx+1,), y (ny+1,), psi (ny+1, nx+1) on them, cells inside (ny, nx)."""

    x: Array
    y: Array
    psi: Array
    inside: NDArray[np.bool_]


def flow_field(mesh: MeshFlow, *, allow_misfit: bool = False) -> FlowField:
    """The divergence-free field of a solved plane case, walls honoured.

    The stream function is the one that fits U best, see `stream_function`. OpenFOAM's own is not
    used: it is wrong where no face of the boundary is without flux and at single points of other
    meshes, and where it is right, the fit is nearer to the flow on a finer mesh. `origin` says how
    far the field, its walls included, is off U.

    Raises InputError for a velocity that is not finite, or that the field is more than
    `LARGEST_MISFIT` off, unless that is allowed.
    """
    if not np.isfinite(mesh.velocity).all():
        bad = int(np.count_nonzero(~np.isfinite(mesh.velocity)))
        raise InputError(
            mesh.where, "finite values of U", f"{bad} NaN or infinite ones",
            "Solve the case again; its run has diverged.",
        )  # fmt: skip
    psi = stream_function(mesh.points, mesh.edges, mesh.centres, mesh.velocity, mesh.patches)
    grid = _resample(mesh, psi)
    walls = _wall_velocity(mesh, grid)
    nodes = _constant_on_walls(grid.psi)
    found = plates(mesh.points, mesh.edges, mesh.patches)
    inside = without_plates(grid.inside, grid.x, grid.y, found)
    field = FlowField.from_stream_function(nodes, grid.x, grid.y, "", walls, inside)
    misfit, slip = _misfit(mesh, field), _slip(mesh, field)
    told = f"{mesh.origin}, {_percent(misfit)} off U (rms)"
    if slip > SINGLE:
        told += f", up to {_percent(slip)} of its largest at walls"
    if not (misfit <= LARGEST_MISFIT or allow_misfit):
        raise InputError(
            mesh.where, f"a velocity U without sources, resolved by the mesh to {LARGEST_MISFIT:.0%}",
            f"one whose best stream function is {_percent(misfit)} off (rms)",
            "Give a solved plane incompressible flow, or solve it on a finer mesh; "
            "--allow-misfit (allow_misfit=True) takes it as it is.",
        )  # fmt: skip
    return replace(_moved(field, mesh.corner), origin=told)


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %" if part < 1.0 else f"{100.0 * part:.0f} %"


def _misfit(mesh: MeshFlow, field: FlowField) -> float:
    """How far a field is off U in the cells, rms / rms; 0 where nothing moves."""
    sample = field.evaluate(mesh.centres[:, 0], mesh.centres[:, 1])
    found = np.stack((sample.velocity_x, sample.velocity_y), axis=-1)
    speed = float(np.linalg.norm(mesh.velocity))
    return float(np.linalg.norm(found - mesh.velocity)) / speed if speed > 0.0 else 0.0


def _slip(mesh: MeshFlow, field: FlowField) -> float:
    """The largest error of the field on boundary faces that give a velocity, over the largest speed."""
    middle = mesh.points[mesh.edges.points].mean(axis=1)
    given = given_on_edges(mesh.points, mesh.edges, mesh.velocity, mesh.patches)
    there = np.isfinite(given[:, 0])
    sample = field.evaluate(*middle[there].T)
    off = np.hypot(sample.velocity_x - given[there, 0], sample.velocity_y - given[there, 1])
    speed = np.hypot(*np.concatenate((mesh.velocity, given[there])).T)
    return float(off.max(initial=0.0) / speed.max()) if speed.any() else 0.0


def _moved(field: FlowField, by: Array) -> FlowField:
    """The same field at another place, (2,) further."""
    old, (x, y) = field.arrays, by.tolist()
    return replace(
        field,
        arrays=old._replace(
            x0=old.x0 + x, x_low=old.x_low + x, x_high=old.x_high + x,
            y0=old.y0 + y, y_low=old.y_low + y, y_high=old.y_high + y,
        ),
    )  # fmt: skip


def _levels(values: Array) -> Array:
    """The distinct values, up to single precision, ascending."""
    ordered = np.sort(values)
    tolerance = SINGLE * (ordered[-1] - ordered[0])
    return ordered[np.concatenate(([True], np.diff(ordered) > tolerance))]


def _resample(mesh: MeshFlow, at_points: Array) -> _Grid:
    """From psi (P,) at the mesh points to a uniform grid: as it is, by a spline, or scattered."""
    x, y = _levels(mesh.points[:, 0]), _levels(mesh.points[:, 1])
    if x.size * y.size > SPARSEST * at_points.size:
        return _from_scattered(mesh, at_points)
    psi = np.full((y.size, x.size), np.nan)
    psi[_nearest(y, mesh.points[:, 1]), _nearest(x, mesh.points[:, 0])] = at_points
    known = np.isfinite(psi)
    if _even(x) and _even(y):
        even_x, even_y = (np.linspace(at[0], at[-1], at.size) for at in (x, y))
        inside = _inside(mesh, even_x, even_y)
        ends = known[:, 1:] & known[:, :-1]
        # Not where a cell is larger than the lattice's, as beside a finer part of a mesh.
        if (ends[1:] & ends[:-1])[inside].all():
            return _Grid(even_x, even_y, _fill(psi, known), inside)
    if known.all() and min(x.size, y.size) >= 5:
        even_x, even_y = _even_nodes(mesh)
        smooth: Array = RectBivariateSpline(y, x, psi)(even_y, even_x)
        return _Grid(even_x, even_y, smooth, np.ones((even_y.size - 1, even_x.size - 1), bool))
    return _from_scattered(mesh, at_points)


def _inside(mesh: MeshFlow, x: Array, y: Array) -> NDArray[np.bool_]:
    """(ny, nx), the cells between the nodes x, y whose centres lie in the mesh."""
    centres = np.stack(np.meshgrid(0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])), axis=-1)
    return mesh.contains(centres.reshape(-1, 2)).reshape(y.size - 1, x.size - 1)


def _even(levels: Array) -> bool:
    """Whether at least 5 levels are evenly spaced, up to single precision."""
    even = np.linspace(levels[0], levels[-1], levels.size)
    return levels.size >= 5 and bool(np.abs(even - levels).max() <= SINGLE * np.ptp(levels))


def _nearest(levels: Array, values: Array) -> NDArray[np.intp]:
    """The index of the level next to each value."""
    return np.searchsorted(0.5 * (levels[1:] + levels[:-1]), values)


def _even_nodes(mesh: MeshFlow) -> tuple[Array, Array]:
    """Evenly spaced nodes over the mesh's rectangle, finer than its mean cell."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    width, height = high - low
    step = np.sqrt(width * height / mesh.centres.shape[0]) / FINER
    nx, ny = (int(np.clip(np.ceil(side / step), 8, MOST_CELLS)) for side in (width, height))
    return np.linspace(low[0], high[0], nx + 1), np.linspace(low[1], high[1], ny + 1)


def _from_scattered(mesh: MeshFlow, at_points: Array) -> _Grid:
    """The grid's psi by Clough and Tocher's C1 cubic, continued beyond the mesh."""
    x, y = _even_nodes(mesh)
    nodes = np.stack(np.meshgrid(x, y), axis=-1)
    step = np.array([x[1] - x[0], y[1] - y[0]])
    inside = _inside(mesh, x, y)
    # A node on the rim counts: one of its four neighbours at 1e-6 of a cell lies in the mesh.
    known = np.zeros(nodes.shape[:2], bool)
    for sign in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        shifted = nodes + 1e-6 * step * np.array(sign)
        known |= mesh.contains(shifted.reshape(-1, 2)).reshape(known.shape)
    psi = CloughTocher2DInterpolator(mesh.points, at_points, tol=SLOPES)(nodes)
    _from_sides(mesh, at_points, x, y, psi, known)
    known &= np.isfinite(psi)
    return _Grid(x, y, _fill(psi, known), inside)


def _from_sides(
    mesh: MeshFlow, at_points: Array, x: Array, y: Array, psi: Array, known: NDArray[np.bool_]
) -> None:
    """Overwrite psi's nodes on the rectangle's sides by the mesh points there alone.

    A monotone cubic keeps psi constant between points of a wall, which the plane's interpolation
    does to its error only; on the rim that one may find no triangle, too.
    """
    for axis, row, at, nodes in (
        (1, 0, y[0], x), (1, -1, y[-1], x), (0, 0, x[0], y), (0, -1, x[-1], y),
    ):  # fmt: skip
        side = np.s_[row, :] if axis == 1 else np.s_[:, row]
        on_side = np.abs(mesh.points[:, axis] - at) <= SINGLE * np.ptp(mesh.points[:, axis])
        places, order = np.unique(mesh.points[on_side, 1 - axis], return_index=True)
        if places.size >= 2:
            curve = PchipInterpolator(places, at_points[on_side][order], extrapolate=False)
            psi[side] = np.where(known[side], curve(nodes), psi[side])


def _fill(psi: Array, known: NDArray[np.bool_]) -> Array:
    """Continue psi (ny+1, nx+1) to its unknown nodes with the least bending.

    Minimises the sum of psi_xx^2 + 2 psi_xy^2 + psi_yy^2, a plate's energy, so value and slope
    go on smoothly and the spline near the rim is as good as inside.
    """
    if known.all():
        return psi
    rows, columns = psi.shape
    bend = [
        diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(n - 2, n)) for n in (rows, columns)
    ]
    slope = [diags_array([-1.0, 1.0], offsets=[0, 1], shape=(n - 1, n)) for n in (rows, columns)]
    terms = (
        kron(eye_array(rows), bend[1]),
        np.sqrt(2.0) * kron(slope[0], slope[1]),
        kron(bend[0], eye_array(columns)),
    )
    operator = csr_array(vstack(terms)).tocsc()
    free = ~known.ravel()
    moved, fixed = operator[:, free], operator[:, ~free]
    filled = psi.ravel().copy()
    filled[free] = spsolve((moved.T @ moved).tocsc(), -(moved.T @ (fixed @ filled[~free])))
    return filled.reshape(psi.shape)


def _constant_on_walls(psi: Array) -> Array:
    """The same psi with the sides that no fluid crosses made exactly constant, rounding removed."""
    psi = psi.copy()
    tolerance = SINGLE * np.ptp(psi)
    # Around the rectangle, so that each side begins where the one before has ended.
    sides = (psi[0, :], psi[:, -1], psi[-1, ::-1], psi[::-1, 0])
    closed = [bool(np.ptp(side) <= tolerance) for side in sides]
    first = closed.index(False) if False in closed else 0
    constant: float | None = None
    for k in range(first, first + 4):
        side = sides[k % 4]
        constant = (float(side[0]) if constant is None else constant) if closed[k % 4] else None
        if constant is not None:
            side[:] = constant
    return psi


def _wall_velocity(mesh: MeshFlow, grid: _Grid) -> WallVelocity:
    """The patches' tangential velocity at the nodes of the rectangle's sides, NaN where unknown."""
    x, y = grid.x, grid.y
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
