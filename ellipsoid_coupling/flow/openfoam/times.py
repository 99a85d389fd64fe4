"""Which time of a case is read, and where its mesh lies: TIME/polyMesh, an earlier one, constant."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import islice, pairwise
from pathlib import Path
from statistics import median
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import MOST_TIMES
from ellipsoid_coupling.files.reading import is_folder
from ellipsoid_coupling.flow.openfoam.files import packed

# 0, 0.5, 12, 1e-05, -0.1, but not 0.orig
_TIME = re.compile(r"-?\d+(\.\d+)?([eE][-+]?\d+)?", re.ASCII)
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
    times = times_of(case)
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
    return [time for time in times_of(case) if packed(case / time / "U") is not None]


class Series(NamedTuple):
    """Several times of a case.

    names : (n,), of their folders, ascending
    start : the time that is the scene's 0
    note : in words: "41 times from 0 to 8"
    """

    names: list[str]
    start: float
    note: str

    @property
    def times(self) -> list[float]:
        """In the scene's time."""
        return [float(name) - self.start for name in self.names]


def time_named(case: Path, solved: Sequence[str], time: float) -> str:
    """The name of a time among those with U; InputError, listing those that there are, without it."""
    for name in solved:
        if float(name) == time:
            return name
    raise InputError(
        f"{case}, flow.time", f"a time with U ({_some(solved)})", f"{time:g}", "Name another."
    )


def choose_series(
    case: Path, interval: tuple[float, float] | None, begun: str | None = None
) -> Series:
    """All times of a case that have U, or those that it takes to cover an interval; all on one mesh.

    The scene's time 0 is the first of them, or the interval's start. `begun` is the name of a time that
    is no solution, with which a run began.

    Raises
    ------
    InputError
        For fewer than two times, an interval that goes beyond them, or a mesh that changes in between.
    """
    times = times_of(case)
    solved = [name for name in solved_times(case) if name != begun]
    series = series_of(case, solved, interval, times)
    _require_one_mesh(case, times, series.names)
    return series


def series_of(
    where: Path,
    solved: list[str],
    interval: tuple[float, float] | None,
    times: Sequence[str] = (),
) -> Series:
    """As `choose_series`, of the names of times with U; those without it among `times` are told.

    where : the case, for messages
    """
    if len(solved) < 2:
        raise InputError(
            f"{where}, flow.time", "a case with U at several times", _some(solved),
            'Let the solver write more of them (writeInterval), or set flow.time = "latest".',
        )  # fmt: skip
    if interval is not None:
        solved = _around(where, solved, interval)
    first, last = float(solved[0]), float(solved[-1])
    note = f"{len(solved)} times from {solved[0]} to {solved[-1]}"
    start = first if interval is None else interval[0]
    if start != 0.0:
        note += f", of which {start:g} is the scene's 0"
    without = [time for time in times if first < float(time) < last and time not in solved]
    if without:
        note += f", none of {_some(without)}, which has no U"
    return Series(solved, start, note + _gap(solved))


def _around(case: Path, solved: list[str], interval: tuple[float, float]) -> list[str]:
    """From the last time up to an interval's start to the first one from its end on."""
    low, high = interval
    if not float(solved[0]) <= low < high <= float(solved[-1]):
        raise InputError(
            f"{case}, flow.time", f"an interval within [{solved[0]}, {solved[-1]}], where U is known",
            f"[{low:g}, {high:g}]", "Change it, or solve on.",
        )  # fmt: skip
    before = sum(float(name) <= low for name in solved) - 1
    behind = sum(float(name) < high for name in solved)
    return solved[before : behind + 1]


def _gap(solved: list[str]) -> str:
    """Where a step between two times is more than twice as long as most are, in words."""
    steps = [float(b) - float(a) for a, b in pairwise(solved)]
    longest = max(steps)
    if longest <= 2.0 * median(steps):
        return ""
    place = steps.index(longest)
    return f", the longest step from {solved[place]} to {solved[place + 1]}"


def _require_one_mesh(case: Path, times: list[str], solved: list[str]) -> None:
    """InputError where a time after the first one has a mesh of its own."""
    for time in times:
        for part in ("points", "faces"):
            file = case / time / "polyMesh" / part
            if float(solved[0]) < float(time) <= float(solved[-1]) and packed(file) is not None:
                raise InputError(
                    str(file), "one mesh for all times of a flow that changes in time",
                    f"another one from time {time} on",
                    "Name an interval without it (flow.time), or solve the case on a mesh at rest.",
                )  # fmt: skip


def _some(names: Sequence[str]) -> str:
    if len(names) > 4:
        return f"{', '.join(names[:2])}, ..., {names[-1]}"
    return ", ".join(names) or "none"


def times_of(case: Path) -> list[str]:
    """The names of all times of a case, ascending."""
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
