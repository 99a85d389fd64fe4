"""From what a reader found on a plane mesh to a `FlowField` on a uniform grid."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.divergence import sources
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.fitted import fitted
from ellipsoid_coupling.flow.mesh import MeshFlow
from ellipsoid_coupling.flow.misfit import LARGEST_MISFIT, Misfit, percent, require_near
from ellipsoid_coupling.flow.openfoam.plane import SINGLE
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.rectangle import lattice, rectangle
from ellipsoid_coupling.flow.stream_function import (
    from_fluxes,
    from_velocity,
    velocity_of_fluxes,
)
from ellipsoid_coupling.flow.wall_curves import PLACES, WallEdges, wall_points
from ellipsoid_coupling.flow.when import Divergence

Array = NDArray[np.float64]
Index = NDArray[np.int_]

# Of psi's range: fluxes that close worse are those of a flow with sources, or of a moving mesh.
LARGEST_GAP = 1e-3
# A U in cells that is further off the fluxes, rms, is none: that of potentialFoam on oblique cells is 47 to
# 100 % off, that of coarse meshes 5 %.
LARGEST_DOUBT = 0.25
# Of the largest speed, between cyclic sides: a spline through a lattice does not know that they are one.
LARGEST_STEP = 1e-3
# Of the largest speed through an edge: one that is none, as single precision has it on walls.
NO_FLUX = 1e-6


class _Phi(NamedTuple):
    """The solver's fluxes (E,), 0 on walls, as jumps of psi; psi (P,) by them; how well they close."""

    flux: Array
    psi: Array
    gap: float


class _Made(NamedTuple):
    """A field, its walls, where it came from in words, and the case with the U to it."""

    field: FlowField
    walls: WallEdges
    source: str
    mesh: MeshFlow


def flow_field(
    mesh: MeshFlow, *, allow_misfit: bool = False, divergence: Divergence = Divergence.NONE
) -> FlowField:
    """The field of a solved plane case, walls honoured, free of divergence unless sources are asked for.

    The stream function adds up the solver's fluxes where they are there and close; else it is the one
    that fits U best, and on rectangles with an even or graded lattice, too, where that is nearer to the
    flow on a finer mesh, unless cyclic sides then differ. OpenFOAM's own is not used: it is wrong where no
    face of the boundary is without flux and at single points of other meshes. With `divergence`, fluxes
    that do not close give a potential besides, see `divergence`. `origin` says how far the field is off U.

    Raises InputError for a velocity that is not finite, for `divergence` without fluxes, or for a field
    that is more than `LARGEST_MISFIT` off U, unless that is allowed.
    """
    if not np.isfinite(mesh.velocity).all():
        bad = int(np.count_nonzero(~np.isfinite(mesh.velocity)))
        raise InputError(
            mesh.where, "finite values of U", f"{bad} NaN or infinite ones",
            "Solve the case again; its run has diverged.",
        )  # fmt: skip
    phi = _phi(mesh)
    if divergence != Divergence.NONE and phi is None:
        raise InputError(
            mesh.where, "fluxes phi in m3/s through the faces, for flow.divergence = true",
            "none (one of mass is none)",
            "Let the solver write phi (potentialFoam -writephi), name the case itself instead of what "
            "foamToVTK made of it, or leave flow.divergence out.",
        )  # fmt: skip
    is_open = phi is not None and phi.gap > LARGEST_GAP
    wanted = divergence == Divergence.ALWAYS or (is_open and divergence != Divergence.NONE)
    made = _without_sources(mesh, phi) if phi is None or not wanted else _with_sources(mesh, phi)
    misfit = _measured(made)
    if phi is not None and is_open and not wanted:
        misfit = misfit._replace(gap=phi.gap)
    if not allow_misfit:
        require_near(mesh.where, misfit)
    told = f"{mesh.origin}, {_told(made, misfit)}; {made.source}"
    moved = _moved(made.field, mesh.corner)
    return replace(moved, origin=told, misfit=misfit, plane=mesh.plane)


def _without_sources(mesh: MeshFlow, phi: _Phi | None) -> _Made:
    """Of psi from U on lattices, whose cyclic sides must then agree; else by a fit."""
    at = lattice(mesh)
    if at is not None:
        psi = _by_velocity(mesh)
        outline, walls = _outline(mesh, _jumps(mesh, psi))
        field = replace(rectangle(mesh, at, psi), outline=outline)
        if _is_periodic(mesh, field):
            return _Made(field, walls, "psi from U", mesh)
    if phi is not None and phi.gap <= LARGEST_GAP:
        mesh, doubt = _trusted(mesh, phi)
        psi, source = phi.psi, f"psi{' and U' if doubt else ''} from phi{doubt}"
    else:
        psi = _by_velocity(mesh)
        why = "there is no phi" if phi is None else f"phi does not close by {percent(phi.gap)}"
        source = f"psi from U as {why}"
    outline, walls = _outline(mesh, _jumps(mesh, psi))
    return _Made(fitted(mesh, psi, outline, walls), walls, source, mesh)


def _by_velocity(mesh: MeshFlow) -> Array:
    return from_velocity(mesh.points, mesh.edges, mesh.centres, mesh.velocity, mesh.given)


def _jumps(mesh: MeshFlow, psi: Array) -> Array:
    """(E,), of psi (P,) along the edges."""
    return np.asarray(psi[mesh.edges.points[:, 1]] - psi[mesh.edges.points[:, 0]])


def _is_periodic(mesh: MeshFlow, field: FlowField) -> bool:
    """Whether a field is the same at both of two cyclic sides of its rectangle; so too without any."""
    cyclic = [k for k, part in enumerate(mesh.patches.values()) if part.kind == "cyclic"]
    at = mesh.middles[mesh.rim.edge[np.isin(mesh.rim.patch, cyclic)]]
    for axis, (low, high) in enumerate(np.reshape(field.bounds, (2, 2)).tolist()):
        here = at[np.abs(at[:, axis] - low) <= SINGLE * (high - low)]
        there = here.copy()
        there[:, axis] = high
        one, other = field.evaluate(*here.T), field.evaluate(*there.T)
        jump = np.hypot(one.velocity_x - other.velocity_x, one.velocity_y - other.velocity_y)
        if jump.max(initial=0.0) > LARGEST_STEP * mesh.top_speed:
            return False
    return True


def _with_sources(mesh: MeshFlow, phi: _Phi) -> _Made:
    """Of psi and chi from phi."""
    mesh, doubt = _trusted(mesh, phi)
    outline, walls = _outline(mesh, phi.flux)
    found = sources(mesh, phi.flux, outline)
    rest = replace(mesh, velocity=found.without(mesh))
    field = found.joined(fitted(rest, found.psi, outline, found.along(mesh, walls)))
    added = float(np.linalg.norm(mesh.velocity - rest.velocity))
    part = percent(added / (float(np.linalg.norm(mesh.velocity)) or 1.0))
    source = f"psi and chi from phi{doubt}, of whose sources grad chi is {part} of U"
    return _Made(field, walls, source, mesh)


def _phi(mesh: MeshFlow) -> _Phi | None:
    """The fluxes of a case; None where it has none."""
    if mesh.flux is None:
        return None
    flux = np.where(_no_flux(mesh, mesh.flux), 0.0, mesh.flux)
    return _Phi(flux, *from_fluxes(mesh.edges, flux, len(mesh.points)))


def _trusted(mesh: MeshFlow, phi: _Phi) -> tuple[MeshFlow, str]:
    """The case, and nothing; or with the U of its fluxes, and why in words, where its own is none."""
    of_phi = velocity_of_fluxes(mesh.points, mesh.edges, phi.flux, len(mesh.velocity))
    doubt = float(np.linalg.norm(mesh.velocity - of_phi)) / (float(np.linalg.norm(of_phi)) or 1.0)
    if doubt <= LARGEST_DOUBT:
        return mesh, ""
    off = percent(doubt) if doubt < 1.0 else "more than 100 %"
    return replace(mesh, velocity=of_phi), f", as the case's U is {off} off it"


def _no_flux(mesh: MeshFlow, jump: Array) -> NDArray[np.bool_]:
    """(E,), the edges of the boundary that no fluid crosses, by psi's jump (E,) along each."""
    through = np.abs(jump) / mesh.lengths()
    small: NDArray[np.bool_] = through <= NO_FLUX * through.max()
    return small & (mesh.edges.cells[:, 1] < 0)


def _outline(mesh: MeshFlow, flux: Array) -> tuple[Outline, WallEdges]:
    """Where the fluid ends, relative to the mesh's corner, and the part of it that no fluid crosses.

    flux : (E,), through edges, as a jump of psi
    """
    edge = np.flatnonzero(mesh.edges.cells[:, 1] < 0)
    start, stop = mesh.edges.points[edge].T
    way = mesh.points[stop] - mesh.points[start]
    aside = mesh.centres[mesh.edges.cells[edge, 0]] - mesh.points[start]
    turned = way[:, 0] * aside[:, 1] - way[:, 1] * aside[:, 0] < 0.0
    start, stop = np.where(turned, stop, start), np.where(turned, start, stop)
    jump, closed = flux[edge], _no_flux(mesh, flux)[edge]
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


def _measured(made: _Made) -> Misfit:
    """How far the field is off U."""
    field, walls, _, mesh = made
    cells, beside = _in_cells(mesh, field, walls)
    slip, weight = _slip(mesh, field, walls), mesh.cells.areas(mesh.points)
    at_walls = float(np.sqrt(np.mean(slip**2))) if slip.size else 0.0
    speed = float(np.sqrt(weight @ np.sum(mesh.velocity**2, axis=1) / weight.sum()))
    return Misfit(cells, at_walls, beside, 0.0, speed, mesh.top_speed)


def _told(made: _Made, misfit: Misfit) -> str:
    """How far the field is off U, in words."""
    field, walls, _, mesh = made
    slip = _slip(mesh, field, walls)
    told, top = f"{percent(misfit.cells)} off U (rms)", float(slip.max(initial=0.0))
    if top > SINGLE:
        told += f", up to {percent(top)} of its largest at walls"
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
