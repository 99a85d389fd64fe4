"""Which time of a case is read, and where its mesh lies: TIME/polyMesh, an earlier one, constant."""

from __future__ import annotations

import math
import re
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_TIMES
from ellipsoid_coupling.files.reading import is_folder
from ellipsoid_coupling.flow.openfoam.files import packed

# 0, 0.5, 12, 1e-05, -0.1, but not 0.orig
_TIME = re.compile(r"-?\d+(\.\d+)?([eE][-+]?\d+)?")
_LONGEST_NAME = 50


class Places(NamedTuple):
    """The folders that a time is read from: of its fields, of its points, of its faces."""

    time: Path
    points: Path
    faces: Path


class Chosen(NamedTuple):
    """A time and how it came to be chosen.

    places : where it and its mesh lie
    before : the folder of the solved time before it, None if there is none
    only_start : whether nothing was solved after this time, with which a run usually begins
    note : its description in `FlowField.origin`: "time 8, the last of 41"
    """

    places: Places
    before: Path | None
    only_start: bool
    note: str


def is_time(name: str) -> bool:
    """Whether a folder of this name is one of OpenFOAM's times."""
    return len(name) < _LONGEST_NAME and bool(_TIME.fullmatch(name)) and math.isfinite(float(name))


def choose_time(case: Path, wanted: str | None) -> Chosen:
    """The time `wanted`, or the last one that has U, and its mesh.

    Raises InputError where no time, or not the one wanted, has U, or where a mesh is missing.
    """
    times = _times(case)
    solved = solved_times(case)
    if not solved or (wanted is not None and wanted not in solved):
        raise _no_velocity(case, times, wanted)
    time = solved[-1] if wanted is None else wanted
    only_start = len(solved) == 1 and float(time) <= 0.0
    # The fields at the start of a run are no solution.
    counted = solved[1:] if float(solved[0]) <= 0.0 and len(solved) > 1 else solved
    note = f"time {time}"
    if only_start:
        note += ", the only one"
    elif len(counted) > 1:
        note += f", {'the last' if time == counted[-1] else 'one'} of {len(counted)}"
    later = [other for other in times if float(other) > float(time)]
    if later and wanted is None:
        note += f" (no U at time {later[-1]})"
    earlier = [case / other for other in counted if float(other) < float(time)]
    places, mesh_time = _places(case, time, times)
    note += "" if mesh_time is None else f", mesh of time {mesh_time}"
    return Chosen(places, earlier[-1] if earlier else None, only_start, note)


def solved_times(case: Path) -> list[str]:
    """The names of the times that have U, the last one last."""
    return [time for time in _times(case) if packed(case / time / "U") is not None]


def _times(case: Path) -> list[str]:
    folders = (path.name for path in islice(case.iterdir(), MOST_TIMES) if is_folder(path))
    return sorted((name for name in folders if is_time(name)), key=float)


def _places(case: Path, time: str, times: list[str]) -> tuple[Places, str | None]:
    """As OpenFOAM looks for a mesh: backwards from the time on, in the end in constant.

    Points may be newer than faces, where the mesh moves; the second is the newer one's time.
    """
    up_to = [other for other in times if float(other) <= float(time)]
    folders: dict[str, Path] = {}
    newest: str | None = None
    for part in ("points", "faces"):
        with_part = [t for t in up_to if packed(case / t / "polyMesh" / part) is not None]
        folder = case / (with_part[-1] if with_part else "constant") / "polyMesh"
        if packed(folder / part) is None:
            raise InputError(
                str(case), "an OpenFOAM case folder", f"no constant/polyMesh/{part} in it",
                "Name the folder that holds constant, system and the times; mesh and solve it, "
                "or add --solve.",
            )  # fmt: skip
        newest = newest or (with_part[-1] if with_part else None)
        folders[part] = folder
    return Places(case / time, folders["points"], folders["faces"]), newest


def _no_velocity(case: Path, times: list[str], wanted: str | None) -> InputError:
    if wanted is not None:
        return InputError(str(case / wanted), "a velocity field U", "none", "Name another time.")
    if not any(float(time) > 0.0 for time in times):
        return unsolved(case, "no time beyond 0")
    expected = f"a velocity field U at time {times[-1]}"
    return InputError(str(case), expected, "none, nor at an earlier one", "Let the solver write U.")


def unsolved(case: Path, found: str) -> InputError:
    """The error for a case that has been meshed, but not solved."""
    return InputError(str(case), "a solved case", found, "Run the solver, or add --solve.")
