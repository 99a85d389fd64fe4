"""Which case, and which of its times, a path means."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_TIMES
from ellipsoid_coupling.files.reading import exists, is_folder, is_ordinary
from ellipsoid_coupling.flow.openfoam.decomposed import PART
from ellipsoid_coupling.flow.openfoam.files import packed
from ellipsoid_coupling.flow.openfoam.times import is_time

# Paths that stand for the case around them.
_CASE_FILES = (".foam", ".OpenFOAM")
_VTK_FILES = (".vtk", ".vtu", ".vtp", ".vtm", ".pvd", ".series")
# Folders around such files, of which one may be the case: CASE/VTK/PATCH.
_MOST_AROUND = 3


def locate(path: Path) -> tuple[Path, str | None]:
    """The case that a path means, and the time, if it names one; InputError if it means none."""
    case, wanted = path, None
    if path.suffix in _CASE_FILES:
        case = path.parent
    elif path.parts[-2:] == ("system", "controlDict"):
        case = path.parent.parent
    elif is_folder(path) and is_time(path.resolve().name):
        around = path.resolve().parent
        if is_folder(around / "constant"):
            case, wanted = around, path.resolve().name
    if (
        is_folder(case)
        and PART.fullmatch(case.resolve().name)
        and is_folder(case.resolve().parent / "system")
    ):
        case = case.resolve().parent
    if not is_folder(case):
        if path.suffix in _VTK_FILES and is_ordinary(path):
            raise _legacy(path)
        found = "something else" if exists(case) else "no such folder"
        raise InputError(str(path), "a solved OpenFOAM case folder", found, "Check the path.")
    if packed(case / "system/controlDict") is None:
        if any(file.suffix in _VTK_FILES for file in islice(case.iterdir(), MOST_TIMES)):
            raise _legacy(case)
        remedy = "Name the folder that holds constant, system and the times; mesh and solve it."
        if PART.fullmatch(case.resolve().name):
            remedy = "It is a part of a case: name the folder with all of them and system beside."
        raise InputError(
            str(case), "an OpenFOAM case folder", "no system/controlDict in it", remedy
        )
    return case, wanted


def _legacy(path: Path) -> InputError:
    """The error for files that are not read: the legacy format, or a series without its files."""
    around = (folder for folder in islice(path.resolve().parents, _MOST_AROUND))
    case = next((one for one in around if packed(one / "system/controlDict") is not None), None)
    named = "" if case is None else f", {case}"
    return InputError(
        str(path), "a solved OpenFOAM case folder, or foamToVTK's XML files", "files for ParaView",
        f"Name the folder of the case itself{named}: its mesh and U are read in full precision.",
    )  # fmt: skip
