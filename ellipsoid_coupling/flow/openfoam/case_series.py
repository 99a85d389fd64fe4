"""A solved case at several of its times."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.files.reading import exists
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.kept_fields import kept_field
from ellipsoid_coupling.flow.misfit import LARGEST_MISFIT, Misfit, percent, require_near
from ellipsoid_coupling.flow.openfoam.case import read_solution
from ellipsoid_coupling.flow.openfoam.decomposed import times_folder, whole_case
from ellipsoid_coupling.flow.openfoam.locate import locate
from ellipsoid_coupling.flow.openfoam.times import (
    Series,
    choose_series,
    solved_times,
    time_named,
)
from ellipsoid_coupling.flow.series import FlowSeries, require_covered
from ellipsoid_coupling.flow.when import Divergence, When

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
    """The flow of a solved case at other times than its last one; a decomposed case is put together.

    Parameters
    ----------
    path : Path
        As of `reader.read_case`; a time's folder only without other times.
    when : When
        Sources are kept at all times, if there are any at one of them.
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
            "Name the folder that holds constant, system and the times (in parts as it is, or after "
            "reconstructPar).",
        )  # fmt: skip
    case, named = locate(path)
    if named is not None:
        found = f"its time {named}, and flow.time = {when.time!r}"
        raise InputError(str(path), "the folder of the case", found, "Leave one of them out.")
    if isinstance(when.time, int | float):
        own = any(float(name) == when.time for name in solved_times(case))
        there = case if own else times_folder(case)
        kept = Divergence.WHERE_OPEN if when.divergence else Divergence.NONE
        name = time_named(there, when.time)
        return kept_field(there / name, allow_misfit=allow_misfit, divergence=kept)
    interval = None if isinstance(when.time, str) else when.time
    there = times_folder(case)
    series = choose_series(there, interval, _start_of(case, there))
    times = series.times
    ends = float(series.names[0]), float(series.names[-1])
    if when.repeat and not isinstance(when.time, str) and tuple(when.time) != ends:
        raise InputError(
            f"{case}, flow.time", "with repeat, an interval from one time with U to another",
            f"{list(when.time)}, around which these are {list(ends)}", "Change it.",
        )  # fmt: skip
    covers = times[0], float("inf") if when.repeat else times[-1]
    require_covered(str(case), covers, when.until)
    note = series.note + ("" if there == case else ", in parts")
    head = f"OpenFOAM case {readable(case.resolve().name)}, {note}"
    return _read_series(_Reading(there, series, when.divergence, report), head, when, allow_misfit)


def _start_of(case: Path, there: Path) -> str | None:
    """The time with which a run began, if U is uniform there: that is no solution."""
    first = next(iter(solved_times(there)), None)
    if first is None or float(first) > 0.0:
        return None
    with whole_case(case, first) as chosen:
        uniform = read_solution(chosen.places).velocity.uniform
    return first if uniform else None


def _read_series(reading: _Reading, head: str, when: When, allow_misfit: bool) -> FlowField:
    """The series of what is read; `head` begins its origin."""
    series = reading.series
    flow = FlowSeries.of_fields(
        series.times,
        reading.fields(),
        f"{head}, linear in between",
        repeat=when.repeat,
        allow_jump=allow_misfit,
        told=reading.near_rest,
    )
    if not allow_misfit:
        reading.require_near()
    if reading.report is not None:
        reading.report(f"reading time {series.names[-1]}", 1.0)
    if len(set(flow.digests)) > 1:
        return flow
    # Nothing changes: a run need not stop at these times.
    (one, *_) = flow.steady_fields()
    return FlowField(one.arrays, f"{head}, the same at all of them", one.outline)


@dataclass
class _Reading:
    """How the times of a case are read, one by one.

    there : the case, or the first of its parts
    misfits : of the times that have been read
    """

    there: Path
    series: Series
    divergence: bool
    report: Report | None
    misfits: dict[str, Misfit] = field(default_factory=dict)

    def fields(self) -> Iterator[FlowField]:
        """The field of each time."""
        names = self.series.names
        kept = self._kept()
        for number, name in enumerate(names):
            self._tell(name, number)
            found = self._field(name, kept[name])
            if found.misfit is not None:
                self.misfits[name] = found.misfit
            yield found

    def _kept(self) -> dict[str, Divergence]:
        """Whether each time keeps its sources: each does, where one of them has any."""
        names = self.series.names
        if not self.divergence:
            return dict.fromkeys(names, Divergence.NONE)
        has = {}
        for number, name in enumerate(names):
            self._tell(name, number)
            has[name] = self._field(name, Divergence.WHERE_OPEN).arrays.chi is not None
        closed = Divergence.ALWAYS if any(has.values()) else Divergence.WHERE_OPEN
        return {name: Divergence.WHERE_OPEN if has[name] else closed for name in names}

    def _tell(self, name: str, number: int) -> None:
        if self.report is not None:
            self.report(f"reading time {name}", number / len(self.series.names))

    def _field(self, name: str, divergence: Divergence) -> FlowField:
        """The field of a time, however far off; what is refused names it."""
        try:
            return kept_field(self.there / name, allow_misfit=True, divergence=divergence)
        except InputError as error:
            where = error.where if f"/{name}/" in error.where else f"{error.where}, time {name}"
            raise InputError(where, error.expected, error.found, error.remedy) from None

    def require_near(self) -> None:
        """Refuse a time that is too far off the solver's U, by the largest of all times; InputError.

        A flow that starts from rest, or passes through it, has times of which a small part is a lot.
        """
        for name, misfit in self.misfits.items():
            require_near(f"{self.there}, time {name}", misfit, self._largest())

    def near_rest(self) -> str:
        """In words, how far off the worst of those times is that alone would be too far off; or nothing."""
        own = {name: max(one.cells, one.walls) for name, one in self.misfits.items()}
        name = max(own, key=lambda name: own[name], default=None)
        if name is None or own[name] <= LARGEST_MISFIT:
            return ""
        largest = self._largest()
        part = max(self.misfits[name].of(largest.speed, largest.top))
        told = f"{percent(own[name])} off U (rms) at time {name}, near rest"
        return f", {told}: {percent(part)} of the largest U"

    def _largest(self) -> Misfit:
        """With the largest rms and the largest speed of all times."""
        every = self.misfits.values()
        speed, top = max(one.speed for one in every), max(one.top for one in every)
        return next(iter(every))._replace(speed=speed, top=top)
