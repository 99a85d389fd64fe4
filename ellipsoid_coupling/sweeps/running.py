"""Run a sweep: check every point, find its flows, run what is missing, and put the results together."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import in_words, memory_left
from ellipsoid_coupling.flow import FlowField, Wanted
from ellipsoid_coupling.models import kind_named
from ellipsoid_coupling.models.memory import peak_memory
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.simulation import checked_setup, scene_flow
from ellipsoid_coupling.sweeps import dataset, wholes
from ellipsoid_coupling.sweeps.cluster import require_dask, run_on_cluster
from ellipsoid_coupling.sweeps.description import Sweep
from ellipsoid_coupling.sweeps.folder import (
    RESULTS_FILE,
    begin,
    claim,
    flow_file,
    flow_key,
    keep_flow,
    run_path,
)
from ellipsoid_coupling.sweeps.job import Job, load_flow
from ellipsoid_coupling.sweeps.local import cores, run_here, run_in_processes
from ellipsoid_coupling.sweeps.points import Point
from ellipsoid_coupling.sweeps.records import MISSING, Record, failed, record_of

if TYPE_CHECKING:
    import xarray as xr

Report = Callable[[str, float], None]
Records = Iterator[tuple[int, Record]]

# Seconds between two reports while nothing ends.
_PAUSE = 0.2


@dataclass(frozen=True)
class Where:
    """Where points run: on a cluster, or in processes of this machine, by default as many as fit.

    Attributes
    ----------
    workers : int or None
    scheduler : str or None
        Address of a Dask scheduler.
    collect : bool
        Nowhere: what is there is put together.
    """

    workers: int | None = None
    scheduler: str | None = None
    collect: bool = False

    def check(self) -> None:
        """Refuse what does not go together, or is not there."""
        if self.workers is not None and self.scheduler is not None:
            raise InputError("--workers", "--workers or --scheduler", "both", "Leave out one.")
        if self.workers is not None and not 1 <= self.workers <= cores():
            expected = f"1 to {cores()}, the cores that this process may use"
            raise InputError("--workers", expected, str(self.workers), "Change it.")
        if self.scheduler is not None:
            require_dask()


class Progress:
    """Tells how much of all points is done: those that have ended, and parts of those in hand.

    stage : what is told beside, such as how many points there are and where they run
    """

    def __init__(self, stage: str, total: int, report: Report | None) -> None:
        self._stage, self._total, self._report = stage, total, report
        self._ended, self._next = 0, 0.0

    def ended(self) -> None:
        """Another point has ended."""
        self._ended += 1
        self.in_hand(0.0)

    def in_hand(self, parts: float) -> None:
        """So much of the points in hand is done, in points."""
        if self._report is None or not self._total:
            return
        now = time.monotonic()
        if now >= self._next or self._ended == self._total:
            self._next = now + _PAUSE
            self._report(self._stage, min(1.0, (self._ended + parts) / self._total))


def run_sweep(
    sweep: Sweep,
    out: Path,
    where: Where,
    *,
    resume: bool = False,
    flow: FlowField | None = None,
    report: Report | None = None,
) -> xr.Dataset:
    """Run all points of a sweep that are not there yet, and write and return its results.nc.

    Parameters
    ----------
    out : Path
        The sweep's folder, see `sweep.folder`.
    resume : bool
        Go on with the sweep in `out`; failed points are run again.
    flow : FlowField, optional
        Instead of the scene's own, and of the one that the sweep names.
    report : callable, optional
        Called with the stage and its finished part.

    Returns
    -------
    xarray.Dataset
        See `dataset.assemble`; `status` tells of each point whether it has failed.

    Raises
    ------
    InputError
        For settings of any point that do not fit, before anything is run; for a folder of something else.
    Interrupted
        After a signal; what has ended stays, and points in hand have left checkpoints.
    """
    where.check()
    points = list(sweep.points())
    workers, place = _place(where, len(points), check_points(sweep, points))
    begin(out, sweep, resume=resume or where.collect)
    job, records = Job(out, sweep), dict[int, Record]()
    if not where.collect:
        keep_flows(job, points, flow, report)
    progress = Progress(f"{sweep.name}: {len(points)} points{place}", len(points), report)
    progress.in_hand(0.0)
    for number, record in _records(job, points, where, workers, progress):
        records[number] = record
        progress.ended()
    data = collect(job, points, records)
    dataset.save(data, out / RESULTS_FILE)
    return data


def _place(where: Where, points: int, need: float) -> tuple[int, str]:
    """How many processes of this machine, and in words where points run."""
    if where.collect:
        return 1, ""
    if where.scheduler is not None:
        return 1, f" on {where.scheduler}"
    workers = fitting_workers(where.workers, points, need)
    few = workers < min(cores(), points) and where.workers is None
    short = f", as each takes {in_words(need)} of memory" if few else ""
    return workers, f", {workers} {'worker' if workers == 1 else 'workers'}{short}"


def _records(
    job: Job, points: Sequence[Point], where: Where, workers: int, progress: Progress
) -> Records:
    """Number and record of all points as they end, wherever they run."""
    if where.collect:
        return ((point.number, _kept(job, point)) for point in points)
    if where.scheduler is not None:
        return run_on_cluster(job, points, where.scheduler)
    if workers == 1:
        return run_here(job, points, progress.in_hand)
    return run_in_processes(job, points, workers, progress.in_hand)


def run_task(
    sweep: Sweep,
    out: Path,
    task: tuple[int, int],
    *,
    resume: bool = False,
    flow: FlowField | None = None,
    report: Report | None = None,
) -> dict[str, str]:
    """Run a share of a sweep: task I of N of a batch queue; nothing is collected.

    A task takes its own points, every N-th one, and then those that nobody has taken. So any number of
    tasks, in any order, do all of them; a point is never computed by two.

    Parameters
    ----------
    task : (I, N), 1 <= I <= N
    resume : bool
        Take again what this task had taken before it was stopped.

    Returns
    -------
    dict
        The status of each of its points that has failed, by name.
    """
    number, tasks = task
    points = list(sweep.points())
    check_points(sweep, points)
    begin(out, sweep, resume=resume, shared=True)
    job = Job(out, sweep)
    keep_flows(job, points, flow, report)
    own = points[number - 1 :: tasks]
    others = [point for k, point in enumerate(points) if k % tasks != number - 1]
    stage = f"{sweep.name}: {len(points)} points, task {number} of {tasks}"
    progress, failures = Progress(stage, len(points), report), dict[str, str]()
    for point in (*own, *others):
        if claim(out, point.name, f"{number}/{tasks}", again=resume):
            record = job.run(point, progress.in_hand)
            if not record.completed:
                failures[point.name] = record.status
        progress.ended()
    return failures


def check_points(sweep: Sweep, points: Sequence[Point]) -> float:
    """Refuse a sweep of which any point does not fit; the memory in bytes that the largest takes."""
    needs = dict[tuple[object, ...], float]()
    for point in points:
        # Seeds make no difference.
        kind = point.model, repr(point.settings), len(point.numbers or ())
        if kind not in needs:
            try:
                needs[kind] = _checked_need(sweep, point)
            except InputError as error:
                where = f"point {point.name}: {error.where}"
                raise InputError(where, error.expected, error.found, error.remedy) from None
    return max(needs.values())


def _checked_need(sweep: Sweep, point: Point) -> float:
    """The memory that a point takes; InputError for one that cannot be run."""
    scene, kind = sweep.scene_of(point), kind_named(point.model)
    setup = checked_setup(scene, point.model, sweep.lists.scheme, point.seed, point.numbers)
    if point.numbers is not None and not kind.independent_realisations:
        expected = "a model with independent realisations"
        found = f"{point.model}, all of whose samples are one density"
        raise InputError("--realisations", expected, found, "Leave it out for this model.")
    if point.numbers is not None and scene.has_inflow:
        expected = "a scene without inlets, in which all realisations hold as many particles"
        remedy = "Leave it out; with inlets, runs of other seeds (--seeds A:B) can share the work."
        raise InputError("--realisations", expected, f"inlets in {scene.name}", remedy)
    if scene.flow is None:
        scene_flow(scene, _wanted(sweep))  # refuses a flow for a scene without a fluid
    return peak_memory(kind, setup)


def _wanted(sweep: Sweep) -> Wanted:
    """The flow that the sweep names; of no path where it is the scene's own."""
    path = sweep.lists.flow
    return Wanted(None if path is None else Path(path), sweep.lists.allow_misfit)


def fitting_workers(asked: int | None, points: int, need: float) -> int:
    """How many processes to use: as many as were asked for, have points to run and fit into the memory.

    need : bytes that the largest point takes
    """
    wanted = max(1, min(asked or cores(), points))
    fitting = max(1, int(memory_left() // need))
    if asked is not None and fitting < wanted:
        raise InputError(
            f"--workers {asked}", f"at most {fitting}, as a point takes {in_words(need)}",
            f"{in_words(memory_left())} of memory", "Use fewer.",
        )  # fmt: skip
    return min(wanted, fitting)


def keep_flows(
    job: Job, points: Sequence[Point], given: FlowField | None, report: Report | None
) -> None:
    """Solve or read every flow of the sweep once, into its folder."""
    seen = set[str | None]()
    for point in points:
        scene = job.sweep.scene_of(point)
        key = flow_key(scene)
        if key is not None and key not in seen:
            obtain = partial(scene_flow, scene, given or _wanted(job.sweep), report)
            keep_flow(job.path, key, obtain)
            _require_same_flow(flow_file(job.path, key), given)
        seen.add(key)


def _require_same_flow(file: Path, given: FlowField | None) -> None:
    """Refuse to go on with another flow than the sweep was started with."""
    if given is not None and (kept := load_flow(file)).digest != given.digest:
        expected = f"the flow that the sweep was started with, digest {kept.digest}"
        raise InputError(str(file), expected, f"digest {given.digest}", "Give that one.")


def _kept(job: Job, point: Point) -> Record:
    """The record of a point that is there; else whether it has failed or was never run."""
    result = job.finished(point, job.sweep.scene_of(point))
    if result is not None:
        return record_of(result)
    try:
        return failed(Result.load(run_path(job.path, point.name)).status.removeprefix("failed: "))
    except InputError:
        return MISSING


def collect(job: Job, points: Sequence[Point], records: Mapping[int, Record]) -> xr.Dataset:
    """The data set of a sweep; runs whose realisations were split are put together first."""
    found, names = dict[tuple[int, ...], Record](), dict[tuple[int, ...], str]()
    for place, group in groupby(points, key=lambda point: point.place):
        pieces = list(group)
        names[place] = f"runs/{pieces[0].name}"
        found[place] = next(
            (records[p.number] for p in pieces if not records[p.number].completed),
            records[pieces[0].number],
        )
        if len(pieces) > 1 and found[place].completed:
            name = pieces[0].name.partition("-realisations=")[0]
            names[place] = f"wholes/{name}"
            found[place] = _join(job, pieces, job.path / "wholes" / name)
    return dataset.assemble(job.sweep, found, names)


def _join(job: Job, pieces: Sequence[Point], path: Path) -> Record:
    """The record of a run whose realisations were split, and its run folder."""
    scene = job.sweep.scene_of(pieces[0])
    whole = wholes.join([Result.load(run_path(job.path, point.name)) for point in pieces])
    key = flow_key(scene)
    flow = None if key is None else load_flow(flow_file(job.path, key))
    first, last = pieces[0].numbers, pieces[-1].numbers
    assert first is not None
    assert last is not None
    wholes.keep(whole, range(first.start, last.stop), flow, path)
    return record_of(whole)
