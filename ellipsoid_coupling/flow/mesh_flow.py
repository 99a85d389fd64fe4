"""From what a reader found on a plane mesh to a `FlowField` on a uniform grid."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.fitted import fitted
from ellipsoid_coupling.flow.mesh import MeshFlow
from ellipsoid_coupling.flow.openfoam.plane import SINGLE
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.rectangle import lattice, rectangle
from ellipsoid_coupling.flow.stream_function import (
    from_fluxes,
    from_velocity,
    velocity_of_fluxes,
)
from ellipsoid_coupling.flow.wall_curves import PLACES, WallEdges, wall_points

Array = NDArray[np.float64]
Index = NDArray[np.int_]

# A field further off U than this, rms over the fluid's area or over the edges of walls, is another flow.
LARGEST_MISFIT = 0.05
# Of psi's range: fluxes that close worse are those of a flow with sources, or of a moving mesh.
LARGEST_GAP = 1e-3
# A U in cells that is further off the fluxes, rms, is none: that of potentialFoam on oblique cells is 47 to
# 100 % off, that of coarse meshes 5 %.
LARGEST_DOUBT = 0.25
# Of the largest speed through an edge: one that is none, as single precision has it on walls.
NO_FLUX = 1e-6


class _Stream(NamedTuple):
    """psi (P,) at the mesh points, where it came from, in words, and the case with the U to it."""

    psi: Array
    source: str
    mesh: MeshFlow


def flow_field(mesh: MeshFlow, *, allow_misfit: bool = False) -> FlowField:
    """The divergence-free field of a solved plane case, walls honoured.

    The stream function adds up the solver's fluxes where they are there and close; else it is the one
    that fits U best, and on rectangles with an even or graded lattice, too, where that is nearer to the
    flow on a finer mesh. OpenFOAM's own is not used: it is wrong where no face of the boundary is without
    flux and at single points of other meshes. `origin` says how far the field is off U.

    Raises InputError for a velocity that is not finite, or that the field is more than
    `LARGEST_MISFIT` off, unless that is allowed.
    """
    if not np.isfinite(mesh.velocity).all():
        bad = int(np.count_nonzero(~np.isfinite(mesh.velocity)))
        raise InputError(
            mesh.where, "finite values of U", f"{bad} NaN or infinite ones",
            "Solve the case again; its run has diverged.",
        )  # fmt: skip
    at = lattice(mesh)
    stream = _by_velocity(mesh, "psi from U") if at is not None else _stream(mesh)
    mesh = stream.mesh
    outline, walls = _outline(mesh, stream.psi)
    if at is None:
        field = fitted(mesh, stream.psi, outline, walls)
    else:
        field = replace(rectangle(mesh, at, stream.psi), outline=outline)
    told = f"{mesh.origin}, {_told(mesh, field, walls, allow_misfit)}; {stream.source}"
    return replace(_moved(field, mesh.corner), origin=told)


def _stream(mesh: MeshFlow) -> _Stream:
    """From phi, where that is there and closes, else from U."""
    if mesh.flux is None:
        return _by_velocity(mesh, "psi from U as there is no phi")
    flux = np.where(_no_flux(mesh, mesh.flux), 0.0, mesh.flux)
    psi, gap = from_fluxes(mesh.edges, flux, len(mesh.points))
    if gap > LARGEST_GAP:
        return _by_velocity(mesh, f"psi from U as phi does not close by {_percent(gap)}")
    of_phi = velocity_of_fluxes(mesh.points, mesh.edges, flux, len(mesh.velocity))
    doubt = float(np.linalg.norm(mesh.velocity - of_phi)) / (float(np.linalg.norm(of_phi)) or 1.0)
    if doubt <= LARGEST_DOUBT:
        return _Stream(psi, "psi from phi", mesh)
    off = _percent(doubt) if doubt < 1.0 else "more than 100 %"
    source = f"psi and U from phi, as the case's U is {off} off it"
    return _Stream(psi, source, replace(mesh, velocity=of_phi))


def _by_velocity(mesh: MeshFlow, source: str) -> _Stream:
    psi = from_velocity(mesh.points, mesh.edges, mesh.centres, mesh.velocity, mesh.given)
    return _Stream(psi, source, mesh)


def _no_flux(mesh: MeshFlow, jump: Array) -> NDArray[np.bool_]:
    """(E,), the edges of the boundary that no fluid crosses, by psi's jump (E,) along each."""
    through = np.abs(jump) / mesh.lengths()
    small: NDArray[np.bool_] = through <= NO_FLUX * through.max()
    return small & (mesh.edges.cells[:, 1] < 0)


def _outline(mesh: MeshFlow, psi: Array) -> tuple[Outline, WallEdges]:
    """Where the fluid ends, relative to the mesh's corner, and the part of it that no fluid crosses."""
    edge = np.flatnonzero(mesh.edges.cells[:, 1] < 0)
    start, stop = mesh.edges.points[edge].T
    way = mesh.points[stop] - mesh.points[start]
    aside = mesh.centres[mesh.edges.cells[edge, 0]] - mesh.points[start]
    turned = way[:, 0] * aside[:, 1] - way[:, 1] * aside[:, 0] < 0.0
    start, stop = np.where(turned, stop, start), np.where(turned, start, stop)
    jump = psi[mesh.edges.points[edge, 1]] - psi[mesh.edges.points[edge, 0]]
    closed = _no_flux(mesh, psi[mesh.edges.points[:, 1]] - psi[mesh.edges.points[:, 0]])[edge]
    jump = np.where(closed, 0.0, np.where(turned, -jump, jump))
    patch, names, types = _patches(mesh, edge, closed)
    ends = np.stack((mesh.points[start], mesh.points[stop]), axis=1)
    way = ends[:, 1] - ends[:, 0]
    speed = np.sum(mesh.given[edge] * way, axis=1) / np.hypot(way[:, 0], way[:, 1])
    walls = WallEdges(edge, start, stop, patch, speed).only(closed)
    return Outline(ends, patch, jump, names, types), walls


def _patches(
    mesh: MeshFlow, edge: Index, closed: NDArray[np.bool_]
) -> tuple[Index, tuple[str, ...], tuple[str, ...]]:
    """The patch of each edge of the boundary, names and types; a last one for edges without any."""
    by_edge = np.full(len(mesh.edges.points), len(mesh.patches))
    by_edge[mesh.rim.edge] = mesh.rim.patch
    patch = by_edge[edge]
    names, types = list(mesh.patches), [part.kind for part in mesh.patches.values()]
    if np.any(patch == len(names)):
        names.append("unnamed")
        types.append("")
    for number, kind in enumerate(types):
        if not kind:
            types[number] = "wall" if closed[patch == number].all() else "patch"
    return patch.astype(np.int64), tuple(names), tuple(types)


def _told(mesh: MeshFlow, field: FlowField, walls: WallEdges, allow_misfit: bool) -> str:
    """How far the field is off U, in words; InputError where that is another flow."""
    misfit, beside = _in_cells(mesh, field, walls)
    slip = _slip(mesh, field, walls)
    at_walls = float(np.sqrt(np.mean(slip**2))) if slip.size else 0.0
    if max(misfit, at_walls) > LARGEST_MISFIT and not allow_misfit:
        part = f"{_percent(misfit)} off (rms) in the cells"
        if misfit <= LARGEST_MISFIT:
            part = f"{_percent(at_walls)} off (rms) at walls"
        elif beside > 0.5:
            part += ", most of it beside walls whose layers are thinner than a cell"
        raise InputError(
            mesh.where, f"a velocity U without sources, resolved by the mesh to {LARGEST_MISFIT:.0%}",
            f"one whose best stream function is {part}",
            "Give a solved plane incompressible flow, or solve it on a finer mesh; "
            "--allow-misfit (allow_misfit=True) takes it as it is.",
        )  # fmt: skip
    told, top = f"{_percent(misfit)} off U (rms)", float(slip.max(initial=0.0))
    if top > SINGLE:
        told += f", up to {_percent(top)} of its largest at walls"
    if top > LARGEST_MISFIT:
        told += f" ({', '.join(_worst_walls(mesh, walls, slip))})"
    return told


def _worst_walls(mesh: MeshFlow, walls: WallEdges, slip: Array) -> list[str]:
    """The patches where the field slips most, three at most, by name."""
    largest = {
        name: float(slip[walls.patch == number].max(initial=0.0))
        for number, name in enumerate(mesh.patches)
    }
    ordered = sorted(largest, key=lambda name: largest[name], reverse=True)
    return [name for name in ordered[:3] if largest[name] > LARGEST_MISFIT]


def _percent(part: float) -> str:
    return f"{100.0 * part:.2g} %" if part < 1.0 else f"{100.0 * part:.0f} %"


def _in_cells(mesh: MeshFlow, field: FlowField, walls: WallEdges) -> tuple[float, float]:
    """How far the field is off U, rms / rms over the area; and the part of that beside walls, squared."""
    weight = mesh.cells.areas(mesh.points)
    off = weight * np.sum(_misfit(mesh, field) ** 2, axis=1)
    speed, total = float(weight @ np.sum(mesh.velocity**2, axis=1)), float(off.sum())
    if not (speed > 0.0 and total > 0.0):
        return 0.0, 0.0
    beside = np.unique(mesh.edges.cells[walls.edge[np.isfinite(walls.speed)], 0])
    return float(np.sqrt(total / speed)), float(off[beside].sum()) / total


def _misfit(mesh: MeshFlow, field: FlowField) -> Array:
    """(C, 2), the field's means over the cells less U, which solvers mean as such a mean."""
    at, owner = mesh.cells.scatter(mesh.points)
    sample = field.evaluate(at[:, 0], at[:, 1])
    means = [np.bincount(owner, part, len(mesh.velocity)) / mesh.cells.sizes for part in sample[:2]]
    return np.stack(means, axis=-1) - mesh.velocity


def _slip(mesh: MeshFlow, field: FlowField, walls: WallEdges) -> Array:
    """(n,), the error in the middle of walls' edges over the largest speed; 0 where they give none."""
    points = wall_points(mesh.points, walls)
    middle = np.s_[PLACES.size // 2 :: PLACES.size]
    way, speed = points.way[middle], points.speed[middle]
    sample = field.evaluate(*points.at[middle].T)
    off = np.hypot(sample.velocity_x - speed * way[:, 0], sample.velocity_y - speed * way[:, 1])
    known = np.isfinite(speed) & (mesh.top_speed > 0.0)
    return np.where(known, off, 0.0) / (mesh.top_speed or 1.0)


def _moved(field: FlowField, by: Array) -> FlowField:
    """The same field at another place, (2,) further."""
    old, (x, y) = field.arrays, by.tolist()
    arrays = old._replace(
        x0=old.x0 + x, x_low=old.x_low + x, x_high=old.x_high + x,
        y0=old.y0 + y, y_low=old.y_low + y, y_high=old.y_high + y,
    )  # fmt: skip
    outline = field.outline and field.outline._replace(ends=field.outline.ends + by)
    return replace(field, arrays=arrays, outline=outline)
