"""The mesh of a decomposed case, put together from its parts, see `decomposed`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_MESH_ENTRIES
from ellipsoid_coupling.flow.openfoam.case import Mesh, read_mesh
from ellipsoid_coupling.flow.openfoam.fields import PatchFaces
from ellipsoid_coupling.flow.openfoam.files import Array, Index, open_file, read_labels
from ellipsoid_coupling.flow.openfoam.times import Places

ADDRESSING = tuple(f"{what}ProcAddressing" for what in ("point", "face", "cell", "boundary"))
# A patch between two parts that are neighbours through a periodic one.
_THROUGH = re.compile(r"procBoundary\d+to\d+through(.+)")


class Part(NamedTuple):
    """A part: its mesh, and where its points, faces, cells and patches are in the whole."""

    mesh: Mesh
    points: Index
    faces: Index
    cells: Index
    patches: Index


def read_parts(case: Path, folders: Sequence[Path], places: Places) -> list[Part]:
    """Every part in its folder, `places` below it; InputError for more than a mesh may have in all."""
    parts: list[Part] = []
    faces = 0
    for folder in folders:
        parts.append(_read_part(folder, places))
        faces += parts[-1].faces.size
        if faces > MOST_MESH_ENTRIES:
            expected = f"parts with at most {MOST_MESH_ENTRIES} faces in all"
            raise InputError(str(case), expected, "more", "Take a coarser mesh.")
    return parts


def _read_part(folder: Path, places: Places) -> Part:
    """A part's mesh and addressing, every number in range of what the part itself has."""
    at = folder / places.faces
    mesh = read_mesh(Places(folder / places.time, folder / places.points, at))
    sizes = (len(mesh.points), mesh.owner.size, mesh.cells, len(mesh.patches))
    whats = ("points", "faces", "cells", "patches")
    lists = []
    for name, size, what in zip(ADDRESSING, sizes, whats, strict=True):
        file = open_file(at / name, "labelList")
        values, _ = read_labels(file, file.start, size, f"numbers, one for each of the {what}")
        lists.append(values)
    return Part(mesh, *lists)


def _count(case: Path, numbers: Sequence[Index], what: str) -> int:
    """How many there are in the whole; InputError unless the parts have each of 0, 1, ... of them."""
    every = np.concatenate(numbers)
    least, most = int(every.min(initial=0)), int(every.max(initial=-1))
    if least < 0 or most >= min(every.size, MOST_MESH_ENTRIES):
        raise unfit(case, what, f"the number {least if least < 0 else most} among {every.size}")
    missing = np.flatnonzero(np.bincount(every, minlength=most + 1) == 0)
    if missing.size:
        raise unfit(case, what, f"none with the number {missing[0]} ({missing.size} missing)")
    return most + 1


def unfit(case: Path, what: str, found: str) -> InputError:
    """The error for parts that do not fit together."""
    return InputError(
        f"{case}, {what}", "parts that make a whole", found,
        "Copy all parts of one decomposition, or give the case after reconstructPar.",
    )  # fmt: skip


def whole_mesh(case: Path, parts: Sequence[Part]) -> Mesh:
    """The mesh of the whole; InputError where the parts do not fit together."""
    cells = _count(case, [part.cells for part in parts], "cells")
    if cells != sum(part.mesh.cells for part in parts):
        raise unfit(case, "cells", "cells that two parts have")
    if any(np.any(part.faces == 0) for part in parts):
        raise unfit(case, "faces", "a face without a number")
    count = _count(case, [np.abs(part.faces) - 1 for part in parts], "faces")
    owner, neighbour = _cells_beside(case, parts, count)
    inside = int(np.count_nonzero(neighbour >= 0))
    if (neighbour[inside:] >= 0).any():
        raise unfit(case, "faces", "faces inside behind those of patches")
    corners, begins = _corners(parts, count)
    patches = _patches(case, parts, inside, count)
    return Mesh(_points(case, parts), corners, begins, owner, neighbour[:inside], patches)


def _points(case: Path, parts: Sequence[Part]) -> Array:
    """(P, 3); InputError where two parts have a point at two places."""
    points = np.empty((_count(case, [part.points for part in parts], "points"), 3))
    for part in parts:
        points[part.points] = part.mesh.points
    for part in parts:
        if not np.array_equal(points[part.points], part.mesh.points):
            raise unfit(case, "points", "one at two places: the mesh of one part is another time's")
    return points


def _cells_beside(case: Path, parts: Sequence[Part], count: int) -> tuple[Index, Index]:
    """Owner and neighbour of every face, -1 where it has no neighbour.

    Of a face between two parts, the owner's has it with its own sign.
    """
    owner, neighbour = np.full(count, -1), np.full(count, -1)
    for part in parts:
        face, mesh = np.abs(part.faces) - 1, part.mesh
        same = part.faces > 0
        inner = mesh.neighbour.size
        if not same[:inner].all():
            raise unfit(case, "faces", "a face inside a part that is turned round")
        if (owner[face[same]] >= 0).any() or (neighbour[face[~same]] >= 0).any():
            raise unfit(case, "faces", "a face that two parts have")
        owner[face[same]] = part.cells[mesh.owner[same]]
        neighbour[face[~same]] = part.cells[mesh.owner[~same]]
        neighbour[face[:inner]] = part.cells[mesh.neighbour]
    if (owner < 0).any():
        raise unfit(case, "faces", "a face of whose two sides one is missing")
    return owner, neighbour


def _corners(parts: Sequence[Part], count: int) -> tuple[Index, Index]:
    """The corners of all faces, and where each begins, from the parts that have them as they are."""
    sizes = np.zeros(count, np.int64)
    for part in parts:
        same = part.faces > 0
        sizes[part.faces[same] - 1] = np.diff(part.mesh.begins)[same]
    begins = np.concatenate(([0], np.cumsum(sizes)))
    corners = np.empty(begins[-1], np.int64)
    for part in parts:
        same = np.repeat(part.faces > 0, np.diff(part.mesh.begins))
        shift = begins[np.abs(part.faces) - 1] - part.mesh.begins[:-1]
        at = np.arange(part.mesh.corners.size) + np.repeat(shift, np.diff(part.mesh.begins))
        corners[at[same]] = part.points[part.mesh.corners[same]]
    return corners, begins


def whole_patch(part: Part, local: int, names: Sequence[str]) -> int:
    """The number in the whole of a part's patch, one between parts through a periodic one included.

    -1 for a patch between two parts; `names` are those of the whole's patches.
    """
    number = int(part.patches[local])
    if number >= 0:
        return number
    through = _THROUGH.fullmatch(part.mesh.patches[local].name)
    return names.index(through[1]) if through and through[1] in names else -1


def _patches(case: Path, parts: Sequence[Part], inside: int, count: int) -> list[PatchFaces]:
    """The patches of the whole, which cover its faces from `inside` on, in their order."""
    named: dict[int, PatchFaces] = {}
    for part in parts:
        for local, patch in enumerate(part.mesh.patches):
            known = named.setdefault(int(part.patches[local]), patch)
            if part.patches[local] >= 0 and (known.name, known.kind) != (patch.name, patch.kind):
                raise unfit(case, "patches", f"{known.name} and {patch.name} for the same one")
    named.pop(-1, None)
    if sorted(named) != list(range(len(named))):
        raise unfit(case, "patches", "numbers with gaps")
    ordered = [named[number] for number in range(len(named))]
    names = [patch.name for patch in ordered]
    patch_of = np.full(count, -1)
    for part in parts:
        for local, patch in enumerate(part.mesh.patches):
            faces = np.abs(part.faces[patch.start : patch.start + patch.faces]) - 1
            number = whole_patch(part, local, names)
            if number < 0:
                continue
            patch_of[faces] = number
    rim = patch_of[inside:]
    if (rim < 0).any() or (np.diff(rim) < 0).any() or (patch_of[:inside] >= 0).any():
        raise unfit(case, "patches", "faces that are on no patch, or not in the patches' order")
    ends = inside + np.searchsorted(rim, np.arange(len(ordered)), side="right")
    starts = np.concatenate(([inside], ends[:-1]))
    return [
        patch._replace(start=int(start), faces=int(end - start))
        for patch, start, end in zip(ordered, starts, ends, strict=True)
    ]
