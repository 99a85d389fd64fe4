"""A solved case, or what foamToVTK wrote of one, at several of its times."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError, readable
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.kept_fields import kept_field
from ellipsoid_coupling.flow.misfit import LARGEST_MISFIT, Misfit, percent, require_near
from ellipsoid_coupling.flow.openfoam.case import read_solution
from ellipsoid_coupling.flow.openfoam.decomposed import times_folder, whole_case
from ellipsoid_coupling.flow.openfoam.locate import locate
from ellipsoid_coupling.flow.openfoam.times import (
    Series,
    choose_series,
    series_of,
    solved_times,
    time_named,
)
from ellipsoid_coupling.flow.openfoam.vtk_times import is_step, is_vtk, vtk_folder, vtk_times
from ellipsoid_coupling.flow.series import FlowSeries, require_covered
from ellipsoid_coupling.flow.when import Divergence, When

Report = Callable[[str, float], None]


def read_times(
    path: Path,
    when: When,
    *,
    allow_misfit: bool = False,
    report: Report | None = None,
) -> FlowField:
    """The flow of a solved case, or of what foamToVTK wrote of one, at other times than the last one.

    A decomposed case is put together.

    Parameters
    ----------
    path : Path
        As of `reader.read_flow`; a time's folder only without other times.
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
    found = _vtk_found(path, when) if is_vtk(path) else _case_found(path, when)
    if isinstance(when.time, int | float):
        kept = Divergence.WHERE_OPEN if when.divergence else Divergence.NONE
        name = time_named(found.where, sorted(found.folders, key=float), when.time)
        return kept_field(found.folders[name], allow_misfit=allow_misfit, divergence=kept)
    interval = None if isinstance(when.time, str) else when.time
    series = found.series(interval)
    times = series.times
    ends = float(series.names[0]), float(series.names[-1])
    if when.repeat and not isinstance(when.time, str) and tuple(when.time) != ends:
        raise InputError(
            f"{found.where}, flow.time", "with repeat, an interval from one time with U to another",
            f"{list(when.time)}, around which these are {list(ends)}", "Change it.",
        )  # fmt: skip
    covers = times[0], float("inf") if when.repeat else times[-1]
    require_covered(str(found.where), covers, when.until)
    head = f"{found.told}, {series.note}"
    return _read_series(_Reading(found, series, when.divergence, report), head, when, allow_misfit)


class _Found(NamedTuple):
    """The times at a path.

    Attributes
    ----------
    where : Path
        The case, or foamToVTK's folder, for messages.
    told : str
        The same in words, which begin `FlowField.origin`.
    folders : dict
        Of each time with U, by its name.
    series : callable
        Gives those that cover an interval, or all of them.
    has_types : bool
        Whether the files tell the types of patches.
    """

    where: Path
    told: str
    folders: dict[str, Path]
    series: Callable[[tuple[float, float] | None], Series]
    has_types: bool


def _case_found(path: Path, when: When) -> _Found:
    """The times of a case."""
    case, named = locate(path)
    if named is not None:
        found = f"its time {named}, and flow.time = {when.time!r}"
        raise InputError(str(path), "the folder of the case", found, "Leave one of them out.")
    there = times_folder(case)
    folders = {name: there / name for name in solved_times(there)}
    if isinstance(when.time, int | float):
        # Of one time, what has been put together is read as it is.
        folders |= {name: case / name for name in solved_times(case)}
    told = f"OpenFOAM case {readable(case.resolve().name)}"
    return _Found(case, told, folders, partial(_series_of_case, case, there), has_types=True)


def _series_of_case(case: Path, there: Path, interval: tuple[float, float] | None) -> Series:
    """`choose_series` in a case or in the first of its parts, `there`."""
    series = choose_series(there, interval, _start_of(case, there))
    return series if there == case else series._replace(note=f"{series.note}, in parts")


def _vtk_found(path: Path, when: When) -> _Found:
    """The times that foamToVTK wrote."""
    folder = vtk_folder(path)
    if is_step(folder):
        found = f"one of its times, and flow.time = {when.time!r}"
        raise InputError(str(path), "the folder of all times", found, "Leave one of them out.")
    folders = vtk_times(folder)
    told = f"foamToVTK folder {readable(folder.resolve().name)}"
    chosen = partial(series_of, folder, list(folders))
    return _Found(folder, told, folders, chosen, has_types=False)


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
    return replace(one, origin=f"{head}, the same at all of them")


@dataclass
class _Reading:
    """How the times of a case are read, one by one.

    found : where they lie
    misfits : of the times that have been read
    """

    found: _Found
    series: Series
    divergence: bool
    report: Report | None
    misfits: dict[str, Misfit] = field(default_factory=dict)

    def fields(self) -> Iterator[FlowField]:
        """The field of each time."""
        names = self.series.names
        kept, types = self._kept(), self._types()
        for number, name in enumerate(names):
            self._tell(name, number)
            found = self._field(name, kept[name])
            if types is not None and found.outline is not None:
                found = replace(found, outline=found.outline._replace(types=types))
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

    def _types(self) -> tuple[str, ...] | None:
        """The types of patches, where no file tells them: walls are what no fluid ever crosses.

        None where files tell them.
        """
        if self.found.has_types:
            return None
        found: tuple[str, ...] | None = None
        for number, name in enumerate(self.series.names):
            self._tell(name, number)
            outline = self._field(name, Divergence.NONE).outline
            if outline is not None:
                pairs = zip(outline.types, found or outline.types, strict=True)
                found = tuple("wall" if pair == ("wall", "wall") else "patch" for pair in pairs)
        return found

    def _tell(self, name: str, number: int) -> None:
        if self.report is not None:
            self.report(f"reading time {name}", number / len(self.series.names))

    def _field(self, name: str, divergence: Divergence) -> FlowField:
        """The field of a time, however far off; what is refused names it."""
        try:
            return kept_field(self.found.folders[name], allow_misfit=True, divergence=divergence)
        except InputError as error:
            where = error.where if f"/{name}/" in error.where else f"{error.where}, time {name}"
            raise InputError(where, error.expected, error.found, error.remedy) from None

    def require_near(self) -> None:
        """Refuse a time that is too far off the solver's U, by the largest of all times; InputError.

        A flow that starts from rest, or passes through it, has times of which a small part is a lot.
        """
        for name, misfit in self.misfits.items():
            require_near(f"{self.found.where}, time {name}", misfit, self._largest())

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
