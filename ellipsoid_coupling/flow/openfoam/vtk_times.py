"""Which times foamToVTK has written, and where they lie.

    VTK/CASE_79.vtm            names the files of a time       CASE.vtm.series   names the times
    VTK/CASE_79/internal.vtu   the mesh, U in its cells, and the time; 79 is the time's index
    VTK/CASE_79/boundary/PATCH.vtp

A path may be any of these, or a folder of them; of a case that has `system` the case's own files are read.
"""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_TIMES
from ellipsoid_coupling.files.reading import is_folder, is_ordinary
from ellipsoid_coupling.flow.openfoam.vtk_files import read_told

_INTERNAL = "internal.vtu"
_NUMBERED = re.compile(r"_(\d{1,18})$", re.ASCII)


def is_vtk(path: Path) -> bool:
    """Whether a path means files of foamToVTK's that can be read: XML, and beside no case's system."""
    folder = vtk_folder(path)
    if not is_folder(folder) or is_folder(folder / "system"):
        return False
    return is_step(folder) or bool(vtk_steps(folder))


def vtk_folder(path: Path) -> Path:
    """The folder that a path means: of one time, or of all of them."""
    if path.name == _INTERNAL or path.suffix == ".series":
        return path.parent
    if path.suffix == ".vtm" and is_ordinary(path):
        # CASE_79.vtm beside CASE_79; boundary.vtm within it.
        return path.with_suffix("") if is_step(path.with_suffix("")) else path.parent
    return path


def is_step(folder: Path) -> bool:
    """Whether a folder holds one time."""
    return is_ordinary(folder / _INTERNAL)


def vtk_steps(folder: Path) -> list[Path]:
    """The folders of times in a folder, or in VTK below it, by their index; none where there is no time."""
    for parent in (folder, folder / "VTK"):
        found = islice(parent.glob(f"*_*/{_INTERNAL}"), MOST_TIMES)
        index = {file.parent: _NUMBERED.search(file.parent.name) for file in found}
        steps = {step: int(match[1]) for step, match in index.items() if match}
        if steps:
            return sorted(steps, key=lambda step: steps[step])
    return []


def last_step(folder: Path) -> Path:
    """The folder of the last time; InputError where there is none."""
    if is_step(folder):
        return folder
    steps = vtk_steps(folder)
    if not steps:
        raise InputError(
            str(folder), "what foamToVTK wrote (internal.vtu in it or below it)", "none",
            "Name the folder of the solved case itself.",
        )  # fmt: skip
    return steps[-1]


def vtk_times(folder: Path) -> dict[str, Path]:
    """The folder of each time, by the time in words, ascending; a uniform U at the start is none.

    Raises
    ------
    InputError
        For a file that is broken, or a time that is there twice.
    """
    times: dict[str, Path] = {}
    for step in vtk_steps(folder):
        time, uniform = read_told(step / _INTERNAL)
        if uniform and time <= 0.0 and not times:
            continue
        name = f"{time:.10g}"
        if name in times:
            raise InputError(
                str(step), "one folder for each time", f"time {name}, as in {times[name].name}",
                "Remove VTK and run foamToVTK again.",
            )  # fmt: skip
        times[name] = step
    return dict(sorted(times.items(), key=lambda item: float(item[0])))
