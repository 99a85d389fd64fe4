"""Decomposed cases: processor0, processor1, ..., put together as reconstructPar does, number for number.

decomposePar tells of each part where its points, faces, cells and patches are in the whole:

    pointProcAddressing     point p of the part is point a[p] of the whole
    faceProcAddressing      face f is face |a[f]| - 1; a[f] < 0: seen from its other side, whose part has it
    cellProcAddressing      cell c is cell a[c]
    boundaryProcAddressing  patch k is patch a[k]; -1 for patches between two parts

The whole goes into a scratch folder as an ordinary case, from where it is read, and checked, like any
other. The files of a stranger's parts are checked before: no number decides a size that the parts do
not fill.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_TIMES
from ellipsoid_coupling.files.reading import is_folder
from ellipsoid_coupling.flow.openfoam.case import Mesh
from ellipsoid_coupling.flow.openfoam.collated import split_parts
from ellipsoid_coupling.flow.openfoam.decomposed_fields import FIELDS, write_whole_field
from ellipsoid_coupling.flow.openfoam.decomposed_mesh import (
    ADDRESSING,
    Part,
    read_parts,
    whole_mesh,
)
from ellipsoid_coupling.flow.openfoam.files import packed
from ellipsoid_coupling.flow.openfoam.own_mesh import write_own_mesh
from ellipsoid_coupling.flow.openfoam.times import Chosen, Places, choose_time, solved_times

# Folders of parts: one each, or all in one (collated), or some in each of several.
PART = re.compile(r"processor\d{1,6}|processors\d{1,6}(_\d{1,6}-\d{1,6})?", re.ASCII)
_MESH = ("points", "faces", "owner", "neighbour", "boundary")


@contextmanager
def whole_case(case: Path, wanted: str | None) -> Iterator[Chosen]:
    """The time `wanted`, or the last one that has U, of a case that may be in parts.

    A decomposed case is put together for as long as the context lasts. The case's own times are taken
    where they are as new as the parts' (it has been reconstructed).

    Raises InputError where `choose_time` does, and for parts that do not make a whole.
    """
    folders = _folders(case)
    own = solved_times(case)
    if not folders or wanted in own or (wanted is None and _as_new(own, folders)):
        yield choose_time(case, wanted)
        return
    with TemporaryDirectory(prefix="ellipsoid-") as scratch:
        try:
            yield _put_together(case, folders, wanted, Path(scratch))
        except InputError as error:
            # A part, or the whole, in the scratch folder has its name in the case.
            places = (str(Path(scratch) / "whole"), scratch)
            texts = [error.where, error.expected, error.found, error.remedy]
            for place in places:
                texts = [text.replace(place, str(case)) for text in texts]
            raise InputError(*texts) from error


def times_folder(case: Path) -> Path:
    """Where a case has its times: in itself, or in the first of its parts, if these are newer.

    Raises InputError for the parts of two decompositions.
    """
    folders = _folders(case)
    if not folders or _as_new(solved_times(case), folders):
        return case
    _require_one(case, folders)
    return folders[0]


def _folders(case: Path) -> list[Path]:
    """The folders of parts, processor0 first."""
    inside = islice(case.iterdir(), MOST_TIMES)
    found = [path for path in inside if PART.fullmatch(path.name) and is_folder(path)]
    return sorted(found, key=lambda path: [int(digits) for digits in re.findall(r"\d+", path.name)])


def _require_one(case: Path, folders: list[Path]) -> None:
    """InputError for the parts of two decompositions, or for a gap in their numbers."""
    numbered = [path for path in folders if not path.name.startswith("processors")]
    counts = {path.name.partition("_")[0] for path in folders if path not in numbered}
    if len(counts) + bool(numbered) > 1:
        names = ", ".join(sorted(counts | {path.name for path in numbered[:1]}))
        raise InputError(
            str(case), "the parts of one decomposition", f"those of several ({names})",
            "Remove the older ones, or name the case itself after reconstructPar.",
        )  # fmt: skip
    if numbered and [path.name for path in folders] != [
        f"processor{k}" for k in range(len(folders))
    ]:
        found = f"{len(folders)} folders, the last {folders[-1].name}"
        raise InputError(str(case), "parts from processor0 on", found, "Copy the missing ones.")


def _as_new(own: list[str], folders: list[Path]) -> bool:
    """Whether the case itself has a time as new as the parts' newest."""
    theirs = [float(times[-1]) for times in map(solved_times, folders) if times]
    return not theirs or (bool(own) and float(own[-1]) >= max(theirs))


def _put_together(case: Path, folders: list[Path], wanted: str | None, scratch: Path) -> Chosen:
    """The whole in scratch/whole; the note of `Chosen` says of how many parts."""
    _require_one(case, folders)
    newest = max((t[-1] for t in map(solved_times, folders) if t), key=float, default=None)
    time = wanted or newest
    if time is not None and any(packed(folder / time / "U") is None for folder in folders):
        raise _missing(case, folders, Path(time) / "U")
    chosen = choose_time(folders[0], time)
    there = folders[0]

    def inner(path: Path) -> Path:
        return path.relative_to(there)

    places = Places(*map(inner, chosen.places))
    times = [places.time] + ([] if chosen.before is None else [inner(chosen.before)])
    if there.name.startswith("processors"):
        files = [places.points / "points"]
        files += [places.faces / name for name in (*_MESH[1:], *ADDRESSING)]
        files += [time / name for time in times for name in FIELDS]
        folders = split_parts(folders, files, scratch)
    parts = read_parts(case, folders, places)
    whole = scratch / "whole"
    mesh = whole_mesh(case, parts)
    write_own_mesh(mesh, whole)
    _write_fields(case, folders, parts, mesh, whole / places.time)
    before = None
    # Its change since then is told where that time can be read.
    for folder in times[1:]:
        with suppress(InputError):
            _write_fields(case, folders, parts, mesh, whole / folder)
            before = whole / folder
    mesh_folder = whole / "constant" / "polyMesh"
    note = f"{chosen.note}, in {len(parts)} parts"
    return Chosen(
        Places(whole / places.time, mesh_folder, mesh_folder), before, chosen.only_start, note
    )


def _missing(case: Path, folders: list[Path], name: Path) -> InputError:
    without = next(folder for folder in folders if packed(folder / name) is None)
    return InputError(
        str(case), f"{name} in all {len(folders)} parts", f"none in {without.name}",
        "Let the run write it in each part, or name a time that all of them have, CASE/processor0/TIME.",
    )  # fmt: skip


def _write_fields(
    case: Path, folders: list[Path], parts: list[Part], mesh: Mesh, target: Path
) -> None:
    """U and, where all parts have it, phi of a time; `target` is its folder in the whole."""
    time = Path(target.name)
    target.mkdir(parents=True)
    for name in FIELDS:
        if all(packed(folder / time / name) is not None for folder in folders):
            paths = [folder / time / name for folder in folders]
            write_whole_field(case, paths, parts, mesh, target / name)
        elif name == "U":
            raise _missing(case, folders, time / name)
