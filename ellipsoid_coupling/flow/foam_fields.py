"""Fields and patches of a checked case: what stands between the numbers, see `foam_files`.

Of a field, its dimensions, internalField and the type and value of every patch are taken. Everything
else that a file may hold (expressions, code, other libraries' entries) is passed over and not run.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.foam_files import (
    REMEDY,
    Array,
    FoamFile,
    open_file,
    read_count,
    read_entry,
    read_numbers,
)
from ellipsoid_coupling.flow.foam_tokens import Token, after_space, line_of
from ellipsoid_coupling.limits import MOST_NAME

_WORD = re.compile(r"[A-Za-z_][\w.:<>-]*", re.ASCII)
_DIMENSIONS = re.compile(rb"\s*\[\s*((?:[-+]?[\d.]{1,9}\s*){7})\]\s*;")
# Components of what stands in List<...>, in the file's scalars or labels.
_COMPONENTS = {
    "scalar": 1, "vector": 3, "sphericalTensor": 1, "symmTensor": 6, "tensor": 9, "label": 1,
}  # fmt: skip
_LIST = re.compile(r"List<(\w+)>")


class PatchFaces(NamedTuple):
    """A patch: its name and type, its first face and their number."""

    name: str
    kind: str
    start: int
    faces: int


@dataclass(frozen=True)
class Field:
    """dimensions (7,); values (n, width); per patch its type and its values (faces, width), if any."""

    dimensions: tuple[float, ...]
    values: Array
    types: dict[str, str]
    on_patches: dict[str, Array | None]


def read_boundary(path: Path, inside: int, faces: int) -> list[PatchFaces]:
    """The patches in polyMesh/boundary; they must cover the faces from `inside` to `faces`."""
    file = open_file(path, "polyBoundaryMesh")
    number, at = read_count(file, file.start, "patches")
    at = file.mark(at, "(")
    patches: list[PatchFaces] = []
    expected = inside
    while (token := file.token(at, "a patch or ')'")).text != ")":
        name = _name(file, token)
        entries, at = _plain_entries(file, file.mark(token.end, "{"))
        start, count = (_whole(file, name, entries, key) for key in ("startFace", "nFaces"))
        kind = entries.get("type", "none")
        if start != expected or not _WORD.fullmatch(kind) or name in {p.name for p in patches}:
            raise InputError(
                f"{file.path}, patch {name}", f"one patch of that name and a type, from face {expected} on",
                f"type {kind}, startFace {start}", REMEDY,
            )  # fmt: skip
        patches.append(PatchFaces(name, kind, start, count))
        expected += count
    if expected != faces or len(patches) != number:
        raise InputError(
            str(file.path), f"{number} patches up to face {faces}",
            f"{len(patches)} up to face {expected}", REMEDY,
        )  # fmt: skip
    return patches


def _name(file: FoamFile, token: Token) -> str:
    """The name of a patch, as VTK can take it."""
    if token.kind != "word" or not _WORD.fullmatch(token.text) or len(token.text) > MOST_NAME:
        raise file.error(token.start, "the name of a patch", repr(token.text))
    return token.text


def _whole(file: FoamFile, patch: str, entries: dict[str, str], key: str) -> int:
    if not re.fullmatch(r"\d{1,9}", entries.get(key, "none")):
        found = entries.get(key, "none")
        raise InputError(f"{file.path}, patch {patch}, key {key}", "a number", found, REMEDY)
    return int(entries[key])


def _plain_entries(file: FoamFile, at: int) -> tuple[dict[str, str], int]:
    """The first word of every entry up to '}', and the byte behind that."""
    entries: dict[str, str] = {}
    while (key := file.token(at, "an entry or '}'")).text != "}":
        entries[key.text] = file.token(key.end, f"the value of {key.text}").text
        at = _passed(file, key)
    return entries, key.end


def read_field(
    file: FoamFile, width: int, count: int, patches: Sequence[PatchFaces] | None
) -> Field:
    """A field with `count` inner values of `width` components.

    patches : of the mesh; None for fields whose patches do not matter

    Raises InputError for values that are missing, broken or not as many as the mesh needs.
    """
    dimensions: tuple[float, ...] = ()
    values: Array | None = None
    types: dict[str, str] = {}
    on_patches: dict[str, Array | None] = {}
    at = file.start
    while (at := after_space(file.data, at)) < len(file.data):
        key = file.token(at, "an entry")
        if key.text == "dimensions":
            dimensions, at = _dimensions(file, key.end)
        elif key.text == "internalField":
            values, at = _values(file, key.end, width, count, "internalField")
        elif key.text == "boundaryField" and patches is not None:
            types, on_patches, at = _patches(file, key.end, width, patches)
        else:
            at = _passed(file, key)
    if values is None or not dimensions:
        name = "internalField" if values is None else "dimensions"
        raise InputError(str(file.path), f"an entry {name}", "none", REMEDY)
    return Field(dimensions, values, types, on_patches)


def _dimensions(file: FoamFile, at: int) -> tuple[tuple[float, ...], int]:
    found = _DIMENSIONS.match(file.data, at)
    try:
        if found is None:
            raise ValueError
        return tuple(float(part) for part in found[1].split()), found.end()
    except ValueError:
        raise file.error(at, "dimensions as in [0 1 -1 0 0 0 0];", "others") from None


def _values(file: FoamFile, at: int, width: int, count: int, what: str) -> tuple[Array, int]:
    """`uniform X;` or `nonuniform List<...> N (...);` as (count, width), and the byte behind."""
    form = file.token(at, f"uniform or nonuniform for {what}")
    if form.text == "uniform":
        value, at = read_entry(file, form.end, width, what)
        return np.repeat(value[None], count, axis=0), file.mark(at, ";")
    if form.text != "nonuniform":
        raise file.error(form.start, f"uniform or nonuniform for {what}", repr(form.text))
    kind = file.token(form.end, "List<...>")
    name = "List<scalar>" if width == 1 else "List<vector>"
    # An empty list is written without its kind.
    if kind.text != name and not (kind.text == "0" and count == 0):
        raise file.error(kind.start, f"{name} for {what}", repr(kind.text))
    start = kind.end if kind.text == name else kind.start
    values, at = read_numbers(file, start, width, count, f"values of {what}")
    if count == 0 and file.data[at : at + 2] == b"()":
        at += 2
    return values, file.mark(at, ";")


def _patches(
    file: FoamFile, at: int, width: int, patches: Sequence[PatchFaces]
) -> tuple[dict[str, str], dict[str, Array | None], int]:
    """Type and values of each of the mesh's patches, and the byte behind boundaryField."""
    faces = {patch.name: patch.faces for patch in patches}
    types: dict[str, str] = {}
    values: dict[str, Array | None] = {}
    at = file.mark(at, "{")
    while (key := file.token(at, "a patch or '}'")).text != "}":
        if key.text not in faces:  # a pattern for several, or an inclusion
            at = _passed(file, key)
            continue
        at = file.mark(key.end, "{")
        kind, found = "none", None
        while (entry := file.token(at, "an entry or '}'")).text != "}":
            if entry.text == "value":
                what = f"value of {key.text}"
                found, at = _values(file, entry.end, width, faces[key.text], what)
                continue
            if entry.text == "type":
                kind = file.token(entry.end, "a type").text.strip('"')
            at = _passed(file, entry)
        at = entry.end
        if not _WORD.fullmatch(kind):
            raise file.error(key.start, f"a type of patch {key.text}", repr(kind))
        types[key.text], values[key.text] = kind, found
    missing = [patch.name for patch in patches if patch.name not in types]
    if missing:
        raise InputError(
            f"{file.path}, boundaryField", f"an entry for patch {missing[0]}", "none", REMEDY
        )
    return types, values, key.end


def _passed(file: FoamFile, key: Token) -> int:
    """The byte behind the entry that begins with `key`; nothing in it is looked at."""
    if key.kind == "mark":
        raise file.error(key.start, "an entry", repr(key.text))
    if key.kind == "directive":  # it is not followed: #include "file"
        line_end = file.data.find(b"\n", key.end)
        return len(file.data) if line_end < 0 else line_end + 1
    token = file.token(key.end, f"the value of {key.text}")
    ends_with = "}" if token.text == "{" else ";"
    depth = 0
    while True:
        depth += (token.text in ("{", "(", "[")) - (token.text in ("}", ")", "]"))
        if depth < 0:
            raise file.error(token.start, f"the end of {key.text}", repr(token.text))
        if depth == 0 and token.text == ends_with:
            return token.end
        at = _behind_list(file, token)
        token = file.token(
            at, f"the end of {key.text}, which begins in line {line_of(file.data, key.start)}"
        )


def _behind_list(file: FoamFile, token: Token) -> int:
    """The byte behind a list's bytes in a binary file; that behind the token for anything else."""
    found = _LIST.fullmatch(token.text) if file.binary else None
    if found is None:
        return token.end
    components = _COMPONENTS.get(found[1])
    if components is None:
        raise file.error(token.start, "a list of numbers", token.text)
    number, at = read_count(file, token.end, f"entries of {token.text}")
    if number == 0 or file.data[at : at + 2].strip()[:1] == b"{":
        return at
    dtype = file.label if found[1] == "label" else file.scalar
    end = file.mark(at, "(") + number * components * dtype.itemsize
    if end > len(file.data):
        raise file.error(at, f"{number} entries of {token.text}", "the end of the file")
    return file.mark(end, ")")
