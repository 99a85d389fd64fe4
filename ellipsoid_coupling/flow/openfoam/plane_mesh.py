"""The plane problem in a solved case, or in foamToVTK's files: points, edges and cells of one plane.

A face between the two planes has two corners on either; those on the front plane are an edge:

    back  o-------o
          | face  |        beside the edge lie the one or two cells of its face
    front o=======o
            edge
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.case_plane import CasePlane
from ellipsoid_coupling.flow.mesh import MeshFlow
from ellipsoid_coupling.flow.openfoam.case import Mesh, Solution
from ellipsoid_coupling.flow.openfoam.plane import thin_axis
from ellipsoid_coupling.flow.plates import with_patches
from ellipsoid_coupling.flow.polygons import Edges, Index, Polygons, around_cells, polygons
from ellipsoid_coupling.flow.stream_function import Patch, Rim

Array = NDArray[np.float64]


class Raw(NamedTuple):
    """The contents of foamToVTK's files, all 3-D.

    corner : (3,), the place in the case from which points and centres are measured
    points : (P, 3);  the corners of cell k are corners[offsets[k]:offsets[k+1]], indices of points
    velocity : (C, 3) in the cells
    patches : by name, the faces' centres and the velocity there, (n, 3) each
    """

    corner: Array
    points: Array
    corners: Index
    offsets: Index
    velocity: Array
    patches: Mapping[str, tuple[Array, Array]]


class Plane(NamedTuple):
    """The points of the front plane (P,), the axes in it, and its distance to the one behind."""

    front: NDArray[np.bool_]
    axes: list[int]
    depth: float


def of_case(solution: Solution, where: str, origin: str) -> MeshFlow:
    """The plane problem in a checked case; InputError for a mesh that is not one cell thick."""
    corner = solution.mesh.points.min(axis=0)
    mesh = solution.mesh._replace(points=solution.mesh.points - corner)
    plane = _plane(mesh.points, where)
    points = mesh.points[plane.front][:, plane.axes]
    faces, ends = _between(mesh, plane, where)
    neighbour = np.full(mesh.owner.size, -1)
    neighbour[: mesh.neighbour.size] = mesh.neighbour
    beside = np.column_stack((mesh.owner[faces], neighbour[faces]))
    # In the order of their points, which is that of foamToVTK's cells, too.
    ends = np.sort(ends, axis=1)
    order = np.lexsort((beside[:, 0], ends[:, 1], ends[:, 0]))
    edges = Edges(ends[order], beside[order])
    cells = around_cells(points, edges, mesh.cells)
    _require_areas(points, cells, where)
    patches, rim = _patches(solution._replace(mesh=mesh), faces[order], plane)
    flux = None
    if solution.flux is not None:
        flux = solution.flux[faces[order]] / plane.depth * _rightwards(points, edges, cells)
    velocity = solution.velocity.values[:, plane.axes]
    return MeshFlow(
        points, edges, cells, velocity, patches, rim, flux, where, origin, corner[plane.axes],
        _case_plane(plane, corner),
    )  # fmt: skip


def of_vtk(raw: Raw, where: str, origin: str) -> MeshFlow:
    """The plane problem in foamToVTK's files; InputError for a mesh that is not one cell thick."""
    plane = _plane(raw.points, where)
    count = raw.offsets.size - 1
    owner = np.repeat(np.arange(count), np.diff(raw.offsets))
    kept = plane.front[raw.corners]
    number = (np.cumsum(plane.front) - 1)[raw.corners[kept]]
    points = raw.points[plane.front][:, plane.axes]
    cells = polygons(points, number, owner[kept], count)
    _require_areas(points, cells, where)
    patches = {}
    for name, (centres, velocity) in raw.patches.items():
        # Faces of the empty patch lie on the planes in front and behind, not between them.
        across = np.delete(centres, plane.axes, axis=1)[:, 0]
        between = np.abs(across - 0.5 * plane.depth) < 0.25 * plane.depth
        if between.any():
            patches[name] = Patch(centres[between][:, plane.axes], velocity[between][:, plane.axes])
    edges, rim = with_patches(points, cells.edges(), patches)
    velocity, corner = raw.velocity[:, plane.axes], raw.corner[plane.axes]
    return MeshFlow(
        points, edges, cells, velocity, patches, rim, None, where, origin, corner,
        _case_plane(plane, raw.corner),
    )  # fmt: skip


def _plane(points: Array, where: str) -> Plane:
    normal = thin_axis(points, where)
    depth = points[:, normal]
    front = depth < 0.5 * (depth.min() + depth.max())
    return Plane(front, [axis for axis in range(3) if axis != normal], float(np.ptp(depth)))


def _case_plane(plane: Plane, corner: Array) -> CasePlane:
    """The middle of the mesh; `corner` (3,) is where points are measured from."""
    normal = 3 - sum(plane.axes)
    return CasePlane(normal, float(corner[normal]) + 0.5 * plane.depth)


def _between(mesh: Mesh, plane: Plane, where: str) -> tuple[Index, Index]:
    """The faces between the planes (E,), and the ends of their edges (E, 2) on the front one."""
    on_front = plane.front[mesh.corners]
    count = np.add.reduceat(on_front.astype(np.int64), mesh.begins[:-1])
    sizes = np.diff(mesh.begins)
    faces = np.flatnonzero((count > 0) & (count < sizes))
    if np.any(count[faces] != 2) or np.any(sizes[faces] != 4):
        raise InputError(
            where, "faces of four corners between the two planes of the mesh, two on either",
            "others", "Solve the flow on a mesh that is extruded from a plane one.",
        )  # fmt: skip
    number = np.cumsum(plane.front) - 1
    kept = on_front & np.isin(np.repeat(np.arange(sizes.size), sizes), faces)
    return faces, number[mesh.corners[kept]].reshape(-1, 2)


def _patches(solution: Solution, faces: Index, plane: Plane) -> tuple[dict[str, Patch], Rim]:
    """The patches between the planes, and which of the edges are their faces."""
    mesh = solution.mesh
    edge_of = np.full(mesh.owner.size, -1)
    edge_of[faces] = np.arange(faces.size)
    patches: dict[str, Patch] = {}
    rims = []
    for patch in mesh.patches:
        edge = edge_of[patch.start : patch.start + patch.faces]
        kept = edge >= 0
        if patch.kind == "empty" or not kept.any():
            continue
        centres, velocity = mesh.face_centres(patch), solution.on_patch(patch)
        patches[patch.name] = Patch(
            centres[kept][:, plane.axes], velocity[kept][:, plane.axes], patch.kind
        )
        count = int(np.count_nonzero(kept))
        rims.append((edge[kept], np.full(count, len(patches) - 1), np.arange(count)))
    joined = [np.concatenate(part) for part in zip(*rims, strict=True)] or [
        np.zeros(0, np.int_)
    ] * 3
    return patches, Rim(*joined)


def _rightwards(points: Array, edges: Edges, cells: Polygons) -> Array:
    """(E,), 1 where the owner lies on the left of the way along an edge, else -1."""
    start, stop = points[edges.points[:, 0]], points[edges.points[:, 1]]
    aside = cells.centroids(points)[edges.cells[:, 0]] - start
    way = stop - start
    return np.where(way[:, 0] * aside[:, 1] - way[:, 1] * aside[:, 0] > 0.0, 1.0, -1.0)


def _require_areas(points: Array, cells: Polygons, where: str) -> None:
    """InputError unless every cell, seen along the mesh's thickness, has an area and no edge is 0."""
    ends = points[cells.edges().points]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    a, b, c = np.moveaxis(points[cells.triangles()], 1, 0)
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    area = np.bincount(cells.triangle_owners(), twice, cells.sizes.size)
    # Smaller ones are 0 but for the rounding of single precision.
    least = 1e-6 * float(np.ptp(points, axis=0).max(initial=0.0))
    flawed = np.count_nonzero(~(area > least**2))
    if flawed or not length.size or not length.min() > least:
        raise InputError(
            where, "cells with an area and edges with a length",
            f"{flawed} cells without, the shortest edge {length.min(initial=np.inf):g} long",
            "Mesh the case again.",
        )  # fmt: skip
