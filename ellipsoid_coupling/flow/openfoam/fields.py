"""Fields and patches of a checked case: the text between the numbers, see `files`.

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
from ellipsoid_coupling.files.limits import MOST_DICTIONARY_BYTES, MOST_NAME, MOST_PATCHES
from ellipsoid_coupling.flow.openfoam.entries import read_dimensions, skip_entry, words_of
from ellipsoid_coupling.flow.openfoam.files import (
    REMEDY,
    Array,
    FoamFile,
    open_file,
    read_count,
    read_entry,
    read_numbers,
)
from ellipsoid_coupling.flow.openfoam.patterns import matches
from ellipsoid_coupling.flow.openfoam.tokens import Token, after_space

# Of patterns on patches: each takes up to a millisecond.
_MOST_TRIES = 10_000
_TYPE = re.compile(r"[A-Za-z_][\w.:-]*", re.ASCII)
# Patches whose condition follows from the mesh: OpenFOAM needs no entry for them.
_CONSTRAINTS = ("empty", "symmetry", "symmetryPlane", "wedge", "cyclic", "processor")
_INTERNAL = re.compile(r"\$(?:\{[:.]*internalField\}|[:.]*internalField)")


class PatchFaces(NamedTuple):
    """A patch: its name and type, its first face and their number, the groups it belongs to."""

    name: str
    kind: str
    start: int
    faces: int
    groups: tuple[str, ...] = ()


@dataclass(frozen=True)
class Field:
    """dimensions (7,); values (n, width), and whether the file gives one for all (`uniform`); per
    patch its type and its values (faces, width), None where it has none.
    """

    dimensions: tuple[float, ...]
    values: Array
    uniform: bool
    types: dict[str, str]
    on_patches: dict[str, Array | None]


def read_boundary(path: Path, inside: int, faces: int) -> list[PatchFaces]:
    """The patches in polyMesh/boundary; they must cover the faces from `inside` to `faces`."""
    file = open_file(path, "polyBoundaryMesh", most=MOST_DICTIONARY_BYTES)
    number, at = read_count(file, file.start, "patches")
    if number > MOST_PATCHES:
        raise file.error(file.start, f"at most {MOST_PATCHES} patches", f"{number}")
    at = file.mark(at, "(")
    patches: dict[str, PatchFaces] = {}
    expected = inside
    while (token := file.name(at, "a patch or ')'")).text != ")":
        name = _name(file, token)
        entries, groups, at = _plain_entries(file, file.mark(token.end, "{"))
        start, count = (_whole(file, name, entries, key) for key in ("startFace", "nFaces"))
        kind = entries.get("type", "none")
        if start != expected or not _TYPE.fullmatch(kind) or name in patches:
            raise InputError(
                f"{file.path}, patch {name}", f"one patch of that name and a type, from face {expected} on",
                f"type {kind}, startFace {start}", REMEDY,
            )  # fmt: skip
        patches[name] = PatchFaces(name, kind, start, count, groups)
        expected += count
    if expected != faces or len(patches) != number:
        raise InputError(
            str(file.path), f"{number} patches up to face {faces}",
            f"{len(patches)} up to face {expected}", REMEDY,
        )  # fmt: skip
    return list(patches.values())


def _name(file: FoamFile, token: Token) -> str:
    """The name of a patch: any word, or the text between quotes."""
    name = token.text.strip('"') if token.kind == "string" else token.text
    if token.kind not in ("word", "string") or not 0 < len(name) <= MOST_NAME:
        raise file.error(token.start, "the name of a patch", repr(token.text))
    return name


def _whole(file: FoamFile, patch: str, entries: dict[str, str], key: str) -> int:
    if not re.fullmatch(r"\d{1,9}", entries.get(key, "none")):
        found = entries.get(key, "none")
        raise InputError(f"{file.path}, patch {patch}, key {key}", "a number", found, REMEDY)
    return int(entries[key])


def _plain_entries(file: FoamFile, at: int) -> tuple[dict[str, str], tuple[str, ...], int]:
    """The first word of every entry up to '}', the words of inGroups, and the byte behind that."""
    entries: dict[str, str] = {}
    groups: tuple[str, ...] = ()
    while (key := file.token(at, "an entry or '}'")).text != "}":
        entries[key.text] = file.token(key.end, f"the value of {key.text}").text
        at = skip_entry(file, key)
        if key.text == "inGroups":
            groups = words_of(file, key.end, at)
    return entries, groups, key.end


def read_field(
    file: FoamFile, width: int, count: int, patches: Sequence[PatchFaces] | None
) -> Field:
    """A field with `count` inner values of `width` components.

    patches : of the mesh; None for fields whose patches do not matter

    Raises InputError for values that are missing, broken or not as many as the mesh needs.
    """
    dimensions: tuple[float, ...] = ()
    values: Array | None = None
    uniform, at, boundary = False, file.start, -1
    while (at := after_space(file.data, at)) < len(file.data):
        key = file.token(at, "an entry")
        if key.text == "dimensions":
            dimensions, at = read_dimensions(file, key.end)
        elif key.text == "internalField":
            uniform = file.token(key.end, "internalField").text == "uniform"
            values, at = _values(file, key.end, width, count, "internalField")
        else:
            boundary = key.end if key.text == "boundaryField" else boundary
            at = skip_entry(file, key)
    if values is None or not dimensions:
        name = "internalField" if values is None else "dimensions"
        raise InputError(str(file.path), f"an entry {name}", "none", REMEDY)
    types: dict[str, str] = {}
    on_patches: dict[str, Array | None] = {}
    if patches is not None:
        everywhere = values[0] if uniform and count else None
        types, on_patches = _on_patches(file, boundary, patches, everywhere, width)
    return Field(dimensions, values, uniform, types, on_patches)


def _values(file: FoamFile, at: int, width: int, count: int, what: str) -> tuple[Array, int]:
    """`uniform X;` or `nonuniform List<...> N (...);` as (count, width), and the byte behind."""
    form = file.token(at, f"uniform or nonuniform for {what}")
    if form.kind in ("variable", "directive"):
        raise InputError(
            f"{file.path}, {what}", "values written out, or value $internalField of a patch",
            f"{form.text}, which is not read",
            "Let the solver write U, or expand it: foamDictionary -expand.",
        )  # fmt: skip
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


class _Keys(NamedTuple):
    """Where the parts of boundaryField begin: by name, and by pattern, in the file's order."""

    names: dict[str, int]
    patterns: dict[str, int]

    def place(self, file: FoamFile, patch: PatchFaces) -> int | None:
        """The part for a patch, as OpenFOAM chooses it: name, last group, last pattern; or none."""
        if patch.name in self.names:
            return self.names[patch.name]
        of_groups = [self.names[name] for name in patch.groups if name in self.names]
        if of_groups:
            return max(of_groups)
        for pattern, place in reversed(self.patterns.items()):
            try:
                if matches(pattern, patch.name):
                    return place
            except ValueError as error:
                raise InputError(
                    f"{file.path}, boundaryField", f"patterns that are read here, for {patch.name}",
                    f'"{pattern}" ({error})', "Write an entry for the patch itself.",
                ) from None  # fmt: skip
        # Quoted for its odd characters, not as a pattern.
        return self.patterns.get(patch.name)


def _on_patches(
    file: FoamFile, at: int, patches: Sequence[PatchFaces], everywhere: Array | None, width: int
) -> tuple[dict[str, str], dict[str, Array | None]]:
    """Type and values of each of the mesh's patches.

    at : the byte behind `boundaryField`, negative if there is none
    everywhere : the uniform internalField (width,), if it is one
    """
    if at < 0:
        raise InputError(str(file.path), "an entry boundaryField", "none", REMEDY)
    keys = _keys(file, at)
    if len(keys.patterns) * len(patches) > _MOST_TRIES:
        found = f"{len(keys.patterns)} for {len(patches)} patches"
        raise file.error(at, "a few patterns in boundaryField", found)
    types: dict[str, str] = {}
    values: dict[str, Array | None] = {}
    for patch in patches:
        place = keys.place(file, patch)
        if place is None:
            if not patch.kind.startswith(_CONSTRAINTS):
                raise InputError(
                    f"{file.path}, boundaryField",
                    f"an entry for patch {patch.name}",
                    "none",
                    REMEDY,
                )
            types[patch.name], values[patch.name] = patch.kind, None
            continue
        types[patch.name], value_at = _part(file, patch.name, place)
        values[patch.name] = None
        if value_at is not None:
            values[patch.name] = _patch_values(file, value_at, patch, everywhere, width)
        elif types[patch.name] == "fixedValue":
            raise file.error(place, f"a value of patch {patch.name}", "none")
    return types, values


def _keys(file: FoamFile, at: int) -> _Keys:
    keys = _Keys({}, {})
    at = file.mark(at, "{")
    while (key := file.name(at, "a patch or '}'")).text != "}":
        at = skip_entry(file, key)
        if key.kind in ("word", "string") and file.token(key.end, "{").text == "{":
            # The last one holds, also in the order: it is put behind the others.
            known = keys.names if key.kind == "word" else keys.patterns
            known.pop(key.text.strip('"'), None)
            known[key.text.strip('"')] = key.end
    return keys


def _part(file: FoamFile, name: str, at: int) -> tuple[str, int | None]:
    """The type in a part of boundaryField, and the byte where its value stands, if it has one."""
    kind, value_at = "", None
    begin = at = file.mark(at, "{")
    while (entry := file.token(at, "an entry or '}'")).text != "}":
        if entry.kind == "variable":
            raise file.error(entry.start, f"entries written out for {name}", repr(entry.text))
        if entry.text == "type":
            kind = file.token(entry.end, "a type").text.strip('"')
        if entry.text == "value":
            value_at = entry.end
        at = skip_entry(file, entry)
    if not _TYPE.fullmatch(kind):
        raise file.error(begin, f"a type of patch {name}", repr(kind))
    return kind, value_at


def _patch_values(
    file: FoamFile, at: int, patch: PatchFaces, everywhere: Array | None, width: int
) -> Array:
    """The values of a patch (faces, width), `$internalField` where that is uniform."""
    form = file.token(at, f"value of {patch.name}")
    if form.kind == "variable" and _INTERNAL.fullmatch(form.text) and everywhere is not None:
        return np.repeat(everywhere[None], patch.faces, axis=0)
    return _values(file, at, width, patch.faces, f"value of {patch.name}")[0]
