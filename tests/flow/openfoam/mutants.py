"""Relatives of a solved case: the same flow in other numbers, orders, planes and places.

case -> Whole -> renumbered, reordered, turned, moved ... -> case
"""

from __future__ import annotations

import gzip
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.openfoam.case import read_solution
from ellipsoid_coupling.flow.openfoam.times import choose_time

Array = NDArray[np.float64]
Index = NDArray[np.int_]


class Form(NamedTuple):
    """How files are written."""

    binary: bool = False
    packed: bool = False
    label: int = 32
    time: str = "1"


class Part(NamedTuple):
    """A patch: its name, its type, its faces; of U there the condition and the values, if any."""

    name: str
    kind: str
    faces: Index
    condition: str
    values: Array | None


@dataclass(frozen=True)
class Whole:
    """A mesh and what was solved on it.

    points (P, 3); faces, their corners each; owner (F,), neighbour (F,) with -1 on the boundary; patches;
    velocity (C, 3); flux (F,) out of owners, None without phi
    """

    points: Array
    faces: list[Index]
    owner: Index
    neighbour: Index
    patches: list[Part]
    velocity: Array
    flux: Array | None


def whole_of(case: Path) -> Whole:
    """A solved case at its last time."""
    solution = read_solution(choose_time(case, None).places)
    mesh, field = solution.mesh, solution.velocity
    faces = np.split(mesh.corners, mesh.begins[1:-1])
    neighbour = np.full(len(faces), -1)
    neighbour[: mesh.neighbour.size] = mesh.neighbour
    patches = [
        Part(
            patch.name, patch.kind, np.arange(patch.start, patch.start + patch.faces),
            field.types[patch.name], field.on_patches[patch.name],
        )
        for patch in mesh.patches
    ]  # fmt: skip
    return Whole(
        mesh.points, faces, mesh.owner, neighbour, patches, field.values, solution.flux
    )  # fmt: skip


# Other numbers and orders.


def renumbered(case: Whole, seed: int = 0) -> Whole:
    """Other numbers of points and of cells."""
    random = np.random.default_rng(seed)
    point, cell = random.permutation(len(case.points)), random.permutation(len(case.velocity))
    points, velocity = np.empty_like(case.points), np.empty_like(case.velocity)
    points[point], velocity[cell] = case.points, case.velocity
    neighbour = np.where(case.neighbour < 0, -1, cell[case.neighbour])
    return replace(
        case, points=points, velocity=velocity, faces=[point[face] for face in case.faces],
        owner=cell[case.owner], neighbour=neighbour,
    )  # fmt: skip


def reordered(case: Whole, seed: int = 0) -> Whole:
    """Faces inside in another order, those of patches too, each begun at another corner."""
    random = np.random.default_rng(seed)
    faces = [np.roll(face, random.integers(len(face))) for face in case.faces]
    shuffled = replace(case, faces=faces)
    parts = []
    for part in case.patches:
        order = random.permutation(part.faces.size)
        values = None if part.values is None or not len(part.values) else part.values[order]
        parts.append(part._replace(faces=part.faces[order], values=values))
    return replace(shuffled, patches=parts)


def turned_faces(case: Whole, seed: int = 0) -> Whole:
    """Half of the faces inside seen from their other side."""
    random = np.random.default_rng(seed)
    turn = (case.neighbour >= 0) & (random.random(len(case.faces)) < 0.5)
    faces = [face[::-1] if seen else face for face, seen in zip(case.faces, turn, strict=True)]
    owner = np.where(turn, case.neighbour, case.owner)
    neighbour = np.where(turn, case.owner, case.neighbour)
    flux = None if case.flux is None else np.where(turn, -case.flux, case.flux)
    return replace(case, faces=faces, owner=owner, neighbour=neighbour, flux=flux)


def patches_in(case: Whole, order: Sequence[int]) -> Whole:
    """Patches in another order; numbers beyond their count are left out."""
    count = len(case.patches)
    return replace(case, patches=[case.patches[k] for k in order if k < count])


def with_empty_patches_first(case: Whole) -> Whole:
    """The empty patch in two, one in front of all others and one behind, and one without faces between."""
    (at,) = (k for k, part in enumerate(case.patches) if part.kind == "empty")
    empty, others = case.patches[at], [p for p in case.patches if p.kind != "empty"]
    half = empty.faces.size // 2
    front, back = (
        empty._replace(name=name, faces=faces)
        for name, faces in (("front", empty.faces[:half]), ("back", empty.faces[half:]))
    )
    nothing = empty._replace(name="defaultFaces", faces=empty.faces[:0])
    return replace(case, patches=[front, others[0], nothing, *others[1:], back])


# Other places.


def mapped(case: Whole, matrix: Array, by: Sequence[float] = (0.0, 0.0, 0.0)) -> Whole:
    """With x -> A x + b for a turn or a reflection A, which sees all faces from the other side."""
    mirrored = float(np.linalg.det(matrix)) < 0.0
    patches = [
        part._replace(values=None if part.values is None else part.values @ matrix.T)
        for part in case.patches
    ]
    return replace(
        case, points=case.points @ matrix.T + np.array(by), velocity=case.velocity @ matrix.T,
        faces=[face[::-1] for face in case.faces] if mirrored else case.faces, patches=patches,
    )  # fmt: skip


def turned(angle: float) -> Array:
    """In the plane x-y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def scaled(case: Whole, length: float, depth: float = 1.0) -> Whole:
    """Lengths in another unit, and the thickness along z in another one; velocities stay."""
    factor = np.array([length, length, depth])
    flux = None if case.flux is None else case.flux * length * depth
    return replace(case, points=case.points * factor, flux=flux)


# Writing.


def write(case: Whole, folder: Path, form: Form | None = None) -> Path:
    """The case in `folder`."""
    how = form or Form()
    inside = np.flatnonzero(case.neighbour >= 0)
    order = np.concatenate((inside, *(part.faces for part in case.patches)))
    assert order.size == len(case.faces)
    mesh, time = folder / "constant" / "polyMesh", folder / how.time
    faces = [case.faces[k] for k in order]
    _save(mesh / "points", "vectorField", _numbers(case.points, how), how)
    _save(mesh / "faces", "faceList", _corners(faces, how), how)
    _save(mesh / "owner", "labelList", _labels(case.owner[order], how), how)
    _save(mesh / "neighbour", "labelList", _labels(case.neighbour[inside], how), how)
    plain, start, text = Form(packed=how.packed), inside.size, f"{len(case.patches)}\n(\n"
    for part in case.patches:
        text += (
            f"{part.name} {{ type {part.kind}; nFaces {part.faces.size}; startFace {start}; }}\n"
        )
        start += part.faces.size
    _save(mesh / "boundary", "polyBoundaryMesh", (text + ")\n").encode(), plain)
    _save(folder / "system" / "controlDict", "dictionary", b"", Form())
    body = b"dimensions [0 1 -1 0 0 0 0];\ninternalField nonuniform List<vector> "
    body += _numbers(case.velocity, how) + b";\nboundaryField\n{\n"
    for part in case.patches:
        body += f"{part.name} {{ type {part.condition}; ".encode()
        if part.values is not None and len(part.values):
            body += b"value nonuniform List<vector> " + _numbers(part.values, how) + b"; "
        body += b"}\n"
    _save(time / "U", "volVectorField", body + b"}\n", how)
    if case.flux is not None:
        _save(time / "phi", "surfaceScalarField", _fluxes(case, case.flux, inside, how), how)
    return folder


def _fluxes(case: Whole, flux: Array, inside: Index, how: Form) -> bytes:
    body = b"dimensions [0 3 -1 0 0 0 0];\ninternalField nonuniform List<scalar> "
    body += _numbers(flux[inside][:, None], how) + b";\nboundaryField\n{\n"
    for part in case.patches:
        if part.kind == "empty":
            body += part.name.encode() + b" { type empty; value nonuniform List<scalar> 0(); }\n"
            continue
        values = _numbers(flux[part.faces][:, None], how)
        body += part.name.encode() + b" { type calculated; value nonuniform List<scalar> "
        body += values + b"; }\n"
    return body + b"}\n"


def _numbers(values: Array, how: Form) -> bytes:
    count = f"{len(values)}\n(".encode()
    if how.binary:
        return count + values.astype("<f8").tobytes() + b")\n"
    rows = [" ".join(map(repr, row)) for row in values.tolist()]
    rows = rows if values.shape[1] == 1 else [f"({row})" for row in rows]
    return count + "\n".join(rows).encode() + b")\n"


def _labels(values: Index, how: Form) -> bytes:
    count = f"{len(values)}\n(".encode()
    if how.binary:
        return count + values.astype(f"<i{how.label // 8}").tobytes() + b")\n"
    return count + "\n".join(map(str, values.tolist())).encode() + b")\n"


def _corners(faces: list[Index], how: Form) -> bytes:
    if how.binary:
        begins = np.concatenate(([0], np.cumsum([face.size for face in faces])))
        return _labels(begins, how) + _labels(np.concatenate(faces), how)
    rows = [f"{face.size}({' '.join(map(str, face.tolist()))})" for face in faces]
    return f"{len(faces)}\n(".encode() + "\n".join(rows).encode() + b")\n"


def _save(path: Path, kind: str, body: bytes, how: Form) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    kind = "faceCompactList" if how.binary and kind == "faceList" else kind
    head = (
        f"FoamFile\n{{\nversion 2.0;\nformat {'binary' if how.binary else 'ascii'};\n"
        f'arch "LSB;label={how.label};scalar=64";\nclass {kind};\nobject {path.name};\n}}\n\n'
    ).encode()
    if how.packed:
        path.with_name(path.name + ".gz").write_bytes(gzip.compress(head + body, mtime=0))
    else:
        path.write_bytes(head + body)
