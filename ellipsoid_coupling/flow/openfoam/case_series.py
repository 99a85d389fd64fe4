"""A solved case at several of its times."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.files.reading import exists
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.kept_fields import kept_field
from ellipsoid_coupling.flow.openfoam.case import read_solution
from ellipsoid_coupling.flow.openfoam.locate import locate
from ellipsoid_coupling.flow.openfoam.times import (
    Series,
    choose_series,
    choose_time,
    solved_times,
    time_named,
)
from ellipsoid_coupling.flow.series import FlowSeries, require_covered
from ellipsoid_coupling.flow.when import When

Report = Callable[[str, float], None]

# Where foamToVTK leaves its times, below the folder that is named.
_VTK = ("internal.vtu", "*_*/internal.vtu", "VTK/*_*/internal.vtu")


def read_times(
    path: Path,
    when: When,
    *,
    allow_misfit: bool = False,
    report: Report | None = None,
) -> FlowField:
    """The flow of a solved case at other times than its last one.

    Parameters
    ----------
    path : Path
        As of `reader.read_case`; a time's folder only without other times.
    when : When
    allow_misfit : bool
        As of `reader.read_case`; and take a flow that repeats although it is another one after a period.
    report : callable, optional
        Called with the stage and its finished part.

    Returns
    -------
    FlowField for one time, or where the flow is the same at all of them; else FlowSeries.

    Raises
    ------
    InputError
        As `reader.read_case`, for any of the times; or if the times do not cover the scene, or the mesh
        changes.
    """
    if not exists(path / "system") and any(next(path.glob(file), None) for file in _VTK):
        raise InputError(
            str(path), "the case itself, for a flow at times of its own", "what foamToVTK made of it",
            "Name the folder that holds constant, system and the times.",
        )  # fmt: skip
    case, named = locate(path)
    if named is not None:
        found = f"its time {named}, and flow.time = {when.time!r}"
        raise InputError(str(path), "the folder of the case", found, "Leave one of them out.")
    if isinstance(when.time, int | float):
        return kept_field(case / time_named(case, when.time), allow_misfit=allow_misfit)
    interval = None if isinstance(when.time, str) else when.time
    series = choose_series(case, interval, _start_of(case))
    times = series.times
    ends = float(series.names[0]), float(series.names[-1])
    if when.repeat and not isinstance(when.time, str) and tuple(when.time) != ends:
        raise InputError(
            f"{case}, flow.time", "with repeat, an interval from one time with U to another",
            f"{list(when.time)}, around which these are {list(ends)}", "Change it.",
        )  # fmt: skip
    covers = times[0], float("inf") if when.repeat else times[-1]
    require_covered(str(case), covers, when.until)
    return _read_series(case, series, when, allow_misfit, report)


def _start_of(case: Path) -> str | None:
    """The time with which a run began, if U is uniform there: that is no solution."""
    first = next(iter(solved_times(case)), None)
    if first is None or float(first) > 0.0:
        return None
    uniform = read_solution(choose_time(case, first).places).velocity.uniform
    return first if uniform else None


def _read_series(
    case: Path,
    series: Series,
    when: When,
    allow_misfit: bool,
    report: Report | None,
) -> FlowField:
    name = readable(case.resolve().name)
    reading = _Reading(case, series, allow_misfit, report)
    head = f"OpenFOAM case {name}, {series.note}"
    flow = FlowSeries.of_fields(
        series.times,
        reading.fields(),
        f"{head}, linear in between",
        repeat=when.repeat,
        allow_jump=allow_misfit,
    )
    if report is not None:
        report(f"reading time {series.names[-1]}", 1.0)
    if len(set(flow.digests)) > 1:
        return flow
    # Nothing changes: a run need not stop at these times.
    (field, *_) = flow.steady_fields()
    return FlowField(field.arrays, f"{head}, the same at all of them", field.outline)


class _Reading(NamedTuple):
    """How the times of a case are read, one by one."""

    case: Path
    series: Series
    allow_misfit: bool
    report: Report | None

    def fields(self) -> Iterator[FlowField]:
        """The field of each time."""
        names = self.series.names
        for number, name in enumerate(names):
            if self.report is not None:
                self.report(f"reading time {name}", number / len(names))
            yield self._field(name)

    def _field(self, name: str) -> FlowField:
        """The field of a time; what is refused names it."""
        try:
            return kept_field(self.case / name, allow_misfit=self.allow_misfit)
        except InputError as error:
            where = error.where if f"/{name}/" in error.where else f"{error.where}, time {name}"
            raise InputError(where, error.expected, error.found, error.remedy) from None
