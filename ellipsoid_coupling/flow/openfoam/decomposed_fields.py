"""The fields of a decomposed case, put together from its parts, see `decomposed`: U and phi."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.files.limits import MOST_CASE_FILE_BYTES
from ellipsoid_coupling.flow.openfoam.case import Mesh, foam_list, write_foam
from ellipsoid_coupling.flow.openfoam.decomposed_mesh import Part, unfit, whole_patch
from ellipsoid_coupling.flow.openfoam.fields import Field, PatchFaces, read_field
from ellipsoid_coupling.flow.openfoam.files import Array, Index, open_file, require_finite
from ellipsoid_coupling.flow.openfoam.own_mesh import patch_word


class _Kind(NamedTuple):
    """A field's class, its components, and whether it has its values on faces."""

    name: str
    width: int
    on_faces: bool


FIELDS = {"U": _Kind("volVectorField", 3, False), "phi": _Kind("surfaceScalarField", 1, True)}
# A field's file: text around the numbers, and a vector in ascii.
_TEXT_BYTES, _VECTOR_BYTES = 1_000_000, 100


def write_whole_field(
    case: Path, files: Sequence[Path], parts: Sequence[Part], mesh: Mesh, target: Path
) -> None:
    """Put the field in `files`, one a part, together, and write it to `target`, in double precision.

    mesh : of the whole

    Raises InputError for a file that does not fit its part, or for parts of different fields.
    """
    kind = FIELDS[target.name]
    fields = [_read(path, kind, part) for path, part in zip(files, parts, strict=True)]
    if any(field.dimensions != fields[0].dimensions for field in fields):
        raise unfit(case, f"{target.name}, key dimensions", "others in another part")
    inside = mesh.neighbour.size
    values = np.full((inside if kind.on_faces else mesh.cells, kind.width), np.nan)
    rim = np.full((mesh.owner.size - inside, kind.width), np.nan)
    for field, part in zip(fields, parts, strict=True):
        own = part.faces[: part.mesh.neighbour.size] - 1 if kind.on_faces else part.cells
        values[own] = field.values
        for faces, given in _on_faces(field, part, mesh, kind):
            values[faces[faces < inside]] = given[faces < inside]
            rim[faces[faces >= inside] - inside] = given[faces >= inside]
    if np.isnan(values).any():
        raise unfit(case, target.name, "one without values for all of it")
    uniform = all(f.uniform for f in fields) and len({f.values[:1].tobytes() for f in fields}) == 1
    types = _types(fields, parts)
    on_patches = {p.name: rim[p.start - inside : p.start - inside + p.faces] for p in mesh.patches}
    whole = Field(
        fields[0].dimensions, values, uniform, types,
        {n: None if np.isnan(v).any() or not v.size else v for n, v in on_patches.items()},
    )  # fmt: skip
    _write(target, kind, whole, mesh.patches)


def _read(path: Path, kind: _Kind, part: Part) -> Field:
    """A part's field; NaN, which stands for "not given" here, is refused as U's reader does."""
    mesh = part.mesh
    entries = mesh.owner.size + mesh.cells
    most = min(_TEXT_BYTES + _VECTOR_BYTES * entries, MOST_CASE_FILE_BYTES)
    file = open_file(path, kind.name, most=most)
    count = mesh.neighbour.size if kind.on_faces else mesh.cells
    # An empty patch has no values, whatever its faces.
    patches = [p._replace(faces=0) if p.kind == "empty" else p for p in mesh.patches]
    field = read_field(file, kind.width, count, patches)
    require_finite(file, field.values, "internalField")
    for name, values in field.on_patches.items():
        if values is not None:
            require_finite(file, values, f"boundaryField, {name}")
    return field


def _on_faces(field: Field, part: Part, mesh: Mesh, kind: _Kind) -> Iterator[tuple[Index, Array]]:
    """(faces of the whole, values) of a part's patches.

    Patches between parts have values in their faces for a field on faces only: cells beyond are the
    other part's.
    """
    names = [patch.name for patch in mesh.patches]
    for local, patch in enumerate(part.mesh.patches):
        given = field.on_patches[patch.name]
        between = part.patches[local] < 0
        if given is None or not given.size or (between and not kind.on_faces):
            continue
        faces = part.faces[patch.start : patch.start + patch.faces]
        if whole_patch(part, local, names) < 0:
            # Seen from the owner's side, as in the whole.
            given, faces = given[faces > 0], faces[faces > 0]
        yield np.abs(faces) - 1, given


def _types(fields: Sequence[Field], parts: Sequence[Part]) -> dict[str, str]:
    """The types of the whole's patches, which all parts have."""
    return {
        patch.name: field.types[patch.name]
        for field, part in zip(fields, parts, strict=True)
        for local, patch in enumerate(part.mesh.patches)
        if part.patches[local] >= 0
    }


def _write(target: Path, kind: _Kind, field: Field, patches: Sequence[PatchFaces]) -> None:
    powers = " ".join(f"{power:g}" for power in field.dimensions)
    inner = _uniform(field.values[0]) if field.uniform and len(field.values) else None
    text = f"dimensions [{powers}];\n\ninternalField ".encode("ascii")
    text += inner or _values(field.values, kind)
    text += b";\n\nboundaryField\n{\n"
    for patch in patches:
        text += f"{patch_word(patch.name)} {{ type {field.types[patch.name]}; ".encode("latin-1")
        given = field.on_patches[patch.name]
        text += b"" if given is None else b"value " + _values(given, kind) + b"; "
        text += b"}\n"
    write_foam(target, kind.name, text + b"}\n")


def _uniform(value: Array) -> bytes:
    numbers = " ".join(map(repr, value.tolist()))
    return f"uniform {numbers if value.size == 1 else f'({numbers})'}".encode("ascii")


def _values(values: Array, kind: _Kind) -> bytes:
    name = b"scalar" if kind.width == 1 else b"vector"
    return b"nonuniform List<" + name + b">\n" + foam_list(values, "<f8")
