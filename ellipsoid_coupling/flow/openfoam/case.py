"""A solved case, checked: mesh, U and phi; and a plain copy of the mesh.

`write_mesh` writes the checked mesh and nothing else of a case, always in the same binary form.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_CASE_FILE_BYTES
from ellipsoid_coupling.flow.openfoam.fields import Field, PatchFaces, read_boundary, read_field
from ellipsoid_coupling.flow.openfoam.files import (
    REMEDY,
    Array,
    FoamFile,
    Index,
    decimal,
    open_file,
    packed,
    read_faces,
    read_labels,
    read_numbers,
    require_finite,
)
from ellipsoid_coupling.flow.openfoam.times import Places

_U_DIMENSIONS = (0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0)
_FLUX_DIMENSIONS = (0.0, 3.0, -1.0, 0.0, 0.0, 0.0, 0.0)
# Conditions under which a patch's velocity follows from the cells': it says nothing of its own.
_FREE = ("zeroGradient", "slip", "symmetry", "symmetryPlane", "cyclic")
_LEAST_CORNERS, _LEAST_FACES = 3, 4
# A field's file: text around the numbers, a vector in ascii, lists that a patch may have.
_TEXT_BYTES, _VECTOR_BYTES, _LISTS = 1_000_000, 100, 10


class Mesh(NamedTuple):
    """points (P, 3); faces by their corners (K,) and where each begins (F + 1,); the cell on either
    side, owner (F,) and neighbour (those inside); patches of the faces that are left.
    """

    points: Array
    corners: Index
    begins: Index
    owner: Index
    neighbour: Index
    patches: list[PatchFaces]

    @property
    def cells(self) -> int:
        """The number of cells."""
        return int(self.owner.max()) + 1

    def face_centres(self, patch: PatchFaces) -> Array:
        """(faces, 3), the mean of each face's corners: in a plane mesh the middle of an edge."""
        begins = self.begins[patch.start : patch.start + patch.faces + 1]
        if patch.faces == 0:
            return np.zeros((0, 3))
        corners = self.points[self.corners[begins[0] : begins[-1]]]
        centres: Array = (
            np.add.reduceat(corners, begins[:-1] - begins[0]) / np.diff(begins)[:, None]
        )
        return centres


class Solution(NamedTuple):
    """The mesh, U with its values on patches, and phi from owners through faces (F,), if there is one."""

    mesh: Mesh
    velocity: Field
    flux: Array | None

    def on_patch(self, patch: PatchFaces) -> Array:
        """(faces, 3), U on a patch: as written, 0 where it does not slip, else the cells' own."""
        cells = self.velocity.values[self.mesh.owner[patch.start : patch.start + patch.faces]]
        if self.velocity.types[patch.name] in _FREE:
            return cells
        given = self.velocity.on_patches[patch.name]
        if given is not None:
            return given
        if self.velocity.types[patch.name] == "noSlip":
            return np.zeros((patch.faces, 3))
        return cells


def read_solution(places: Places) -> Solution:
    """Mesh, U and phi of a case, every number checked.

    Raises InputError, with file and place, for anything that is missing, broken or inconsistent.
    """
    mesh = read_mesh(places)
    velocity = _read_velocity(places.time / "U", mesh, mesh.patches)
    return Solution(mesh, velocity, read_flux(places.time / "phi", mesh))


def read_cells(path: Path, mesh: Mesh) -> Array:
    """U in the cells, (C, 3), of another time than the mesh's: the file at `path`, checked."""
    return _read_velocity(path, mesh, None).values


def _read_velocity(path: Path, mesh: Mesh, patches: list[PatchFaces] | None) -> Field:
    file = open_file(path, "volVectorField", most=_field_room(mesh))
    velocity = read_field(file, 3, mesh.cells, patches)
    if velocity.dimensions != _U_DIMENSIONS:
        found = "[" + " ".join(f"{d:g}" for d in velocity.dimensions) + "]"
        remedy = "Name the case of an incompressible flow; its U is a velocity."
        raise InputError(f"{file.path}, key dimensions", "[0 1 -1 0 0 0 0]", found, remedy)
    require_finite(file, velocity.values, "internalField")
    for name, values in velocity.on_patches.items():
        if values is not None:
            require_finite(file, values, f"boundaryField, {name}")
    return velocity


def read_flux(path: Path, mesh: Mesh) -> Array | None:
    """Phi from owners through faces, (F,), in m3/s; None where there is none, or one of a mass flux.

    Patches follow the faces inside as they do in the mesh; empty ones have no flux.

    Raises InputError for a file that is there and broken.
    """
    if packed(path) is None:
        return None
    file = open_file(path, "surfaceScalarField", most=_field_room(mesh))
    patches = [patch for patch in mesh.patches if patch.kind != "empty"]
    field = read_field(file, 1, mesh.neighbour.size, patches)
    if field.dimensions != _FLUX_DIMENSIONS:
        return None
    flux = np.zeros(mesh.owner.size)
    flux[: mesh.neighbour.size] = field.values[:, 0]
    for patch in patches:
        values = field.on_patches[patch.name]
        if values is None:
            raise InputError(f"{file.path}, boundaryField, {patch.name}", "a value", "none", REMEDY)
        flux[patch.start : patch.start + patch.faces] = values[:, 0]
    require_finite(file, flux[:, None], "phi")
    return flux


def _field_room(mesh: Mesh) -> int:
    """The bytes that a field on this mesh may take."""
    on_patches = sum(patch.faces for patch in mesh.patches if patch.kind != "empty")
    entries = mesh.owner.size + _LISTS * on_patches
    return min(_TEXT_BYTES + _VECTOR_BYTES * entries, MOST_CASE_FILE_BYTES)


def read_mesh(places: Places) -> Mesh:
    """The mesh at `places`, every number checked; InputError, with file and place, for a broken one."""
    points = read_points(places.points)
    folder = places.faces
    file = open_file(folder / "faces", "faceList", "faceCompactList")
    corners, begins = read_faces(file)
    _require_faces(file, corners, begins, len(points))
    faces = begins.size - 1
    file = open_file(folder / "owner", "labelList")
    owner, _ = read_labels(file, file.start, faces, "owners, one a face")
    other = open_file(folder / "neighbour", "labelList")
    neighbour, _ = read_labels(other, other.start, None, "neighbours")
    _require_cells(file, other, owner, neighbour)
    patches = read_boundary(folder / "boundary", neighbour.size, faces)
    mesh = Mesh(points, corners, begins, owner, neighbour, patches)
    _require_closed(file, mesh)
    return mesh


def read_points(folder: Path) -> Array:
    """The points of a mesh in its folder polyMesh, (P, 3), all of them finite."""
    file = open_file(folder / "points", "vectorField")
    points, _ = read_numbers(file, file.start, 3, None, "points")
    require_finite(file, points, "points")
    return decimal(points) if file.binary and file.scalar.itemsize == 4 else points


def _require_faces(file: FoamFile, corners: Index, begins: Index, points: int) -> None:
    """Every face has three corners or more, all of them points of the mesh, none twice."""
    sizes = np.diff(begins)
    _require(file, sizes >= _LEAST_CORNERS, "faces of three corners or more", "face")
    _require(
        file,
        (corners >= 0) & (corners < points),
        f"corners below {points}, the number of points",
        "corner",
    )
    face = np.repeat(np.arange(sizes.size), sizes)
    order = np.lexsort((corners, face))
    twice = (np.diff(corners[order]) == 0) & (np.diff(face[order]) == 0)
    _require(file, ~twice, "faces whose corners differ", "corner")


def _require_cells(file: FoamFile, other: FoamFile, owner: Index, neighbour: Index) -> None:
    """Cells are numbered from 0 without gaps; a face inside lies between two of them."""
    _require(file, (owner >= 0) & (owner < owner.size), "cells below the number of faces", "face")
    cells = int(owner.max(initial=-1)) + 1
    _require(file, np.bincount(owner, minlength=cells) > 0, "a face of every cell", "cell")
    if neighbour.size > owner.size:
        raise other.error(other.start, f"at most {owner.size} neighbours", f"{neighbour.size}")
    inside = (neighbour >= 0) & (neighbour < cells) & (neighbour != owner[: neighbour.size])
    _require(other, inside, f"another cell than the owner, below {cells}", "face")


def _require_closed(file: FoamFile, mesh: Mesh) -> None:
    """The faces of every cell close it: each edge of a cell lies on two of its faces."""
    sizes = np.diff(mesh.begins)
    following = np.arange(1, mesh.corners.size + 1)
    following[mesh.begins[1:] - 1] = mesh.begins[:-1]
    ends = np.sort(np.stack((mesh.corners, mesh.corners[following])), axis=0)
    edge = ends[0] * len(mesh.points) + ends[1]
    inside = np.repeat(np.arange(sizes.size) < mesh.neighbour.size, sizes)
    first = np.repeat(mesh.owner, sizes)
    second = np.repeat(mesh.neighbour, sizes[: mesh.neighbour.size])
    cell, edge = np.concatenate((first, second)), np.concatenate((edge, edge[inside]))
    order = np.lexsort((edge, cell))
    cell, edge = cell[order], edge[order]
    new = np.concatenate(([True], (np.diff(cell) != 0) | (np.diff(edge) != 0), [True]))
    count = np.diff(np.flatnonzero(new))
    bad = cell[new[:-1]][count != 2]
    faces = np.bincount(mesh.owner, minlength=mesh.cells)
    faces += np.bincount(mesh.neighbour, minlength=mesh.cells)
    # Euler: corners - edges + faces = 2 for each cell.
    corner_cell = np.concatenate((first, second))
    corner = np.concatenate((mesh.corners, mesh.corners[inside]))
    corner_order = np.lexsort((corner, corner_cell))
    distinct = np.concatenate((
        [True],
        (np.diff(corner_cell[corner_order]) != 0) | (np.diff(corner[corner_order]) != 0),
    ))  # fmt: skip
    corners = np.bincount(corner_cell[corner_order][distinct], minlength=mesh.cells)
    edges = np.bincount(cell[new[:-1]], minlength=mesh.cells)
    wrong = np.union1d(bad, np.flatnonzero((corners - edges + faces != 2) | (faces < _LEAST_FACES)))
    if wrong.size:
        raise InputError(
            str(file.path.parent), "cells closed by their faces",
            f"cell {wrong[0]}, which is not ({wrong.size} such cells)", "Mesh the case again.",
        )  # fmt: skip


def _require(file: FoamFile, good: NDArray[np.bool_], expected: str, item: str) -> None:
    bad = np.flatnonzero(~good)
    if bad.size:
        raise InputError(
            f"{file.path}, {item} {bad[0]}", expected, f"another ({bad.size} such places)",
            "Mesh the case again.",
        )  # fmt: skip


def write_mesh(mesh: Mesh, folder: Path) -> None:
    """A case that holds nothing but the mesh, its boundary one patch."""
    for part in ("system", "constant/polyMesh", "1"):
        (folder / part).mkdir(parents=True)
    at = folder / "constant" / "polyMesh"
    write_foam(folder / "system" / "controlDict", "dictionary", b"")
    write_foam(at / "points", "vectorField", foam_list(mesh.points, "<f8"))
    write_foam(
        at / "faces",
        "faceCompactList",
        foam_list(mesh.begins, "<i4") + foam_list(mesh.corners, "<i4"),
    )
    write_foam(at / "owner", "labelList", foam_list(mesh.owner, "<i4"))
    write_foam(at / "neighbour", "labelList", foam_list(mesh.neighbour, "<i4"))
    start = mesh.neighbour.size
    text = f"1\n(\nrim {{ type patch; nFaces {mesh.owner.size - start}; startFace {start}; }}\n)\n"
    write_foam(at / "boundary", "polyBoundaryMesh", text.encode("ascii"))


def foam_list(values: NDArray[np.generic], dtype: str) -> bytes:
    """A list in OpenFOAM's binary form."""
    raw = b"(" + values.astype(dtype).tobytes() + b")" if len(values) else b""
    return f"{len(values)}\n".encode("ascii") + raw


def write_foam(path: Path, kind: str, body: bytes) -> None:
    """A file of this class, in binary where it is no dictionary, with OpenFOAM's header."""
    written = "ascii" if kind in ("dictionary", "polyBoundaryMesh") else "binary"
    header = (
        f'FoamFile\n{{\nversion 2.0;\nformat {written};\narch "LSB;label=32;scalar=64";\n'
        f"class {kind};\nobject {path.name};\n}}\n\n"
    )
    path.write_bytes(header.encode("ascii") + body + b"\n")
