"""Solve an OpenFOAM case: write it, mesh, start from a coarser solution, run to rest, stream function.

A case folder is laid out as ``foam_cases/cavity`` is: ``0.orig`` (or ``0``), ``constant`` and ``system``,
where ``system/parameters`` may hold `cells` and `atRest`. OpenFOAM gets files that
`trust` has written from the case's own.

Seconds to rest, all programs included, on two cores (the best of four; icoFoam alone took 28 s at
100 cells with 700 small steps, two correctors and a Gauss-Seidel smoother for U, see
``system/fvSolution``):

    cells, processes              64, 1   64, 2   100, 1   100, 2   200, 2
    directly                        1.4     3.2      3.8      3.3     37.0
    from half the cells, mapped     1.6     2.6      3.3      3.5     28.9

So a coarser solution is mapped from `MAPPED_FROM` cells on; the coarser run uses one process. It is
solved beside the finer one and not taken from the cache: a folder there may be somebody else's, and
mapFields would read its dictionaries.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import secrets
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.files.cache import cache_home
from ellipsoid_coupling.files.limits import (
    BYTES_PER_FLUID_CELL,
    MOST_SCENE_BYTES,
    in_words,
    memory_limit,
)
from ellipsoid_coupling.files.reading import exists, is_folder, is_ordinary, read_text
from ellipsoid_coupling.flow.openfoam.applications import APPLICATIONS
from ellipsoid_coupling.flow.openfoam.case import read_points
from ellipsoid_coupling.flow.openfoam.own_mesh import write_own_mesh
from ellipsoid_coupling.flow.openfoam.plane import thin_axis
from ellipsoid_coupling.flow.openfoam.programs import (
    Follow,
    failed,
    mpi_starts,
    require_openfoam,
    run_program,
    says,
    why_open,
)
from ellipsoid_coupling.flow.openfoam.run_control import Run
from ellipsoid_coupling.flow.openfoam.scratch import cleaned_up, move_to, scratch_folder
from ellipsoid_coupling.flow.openfoam.solved_cases import (
    MARK,
    case_folder,
    content_hash,
    inputs_hash,
    is_solved,
    solved_folder,
)
from ellipsoid_coupling.flow.openfoam.trust import (
    LEFT_OUT,
    MOST_CELLS,
    PlainCase,
    input_folders,
    plain_case,
    start_folder,
)

Report = Callable[[str, float], None]

_FEWEST_CELLS = 4
# The file that marks a kept folder of a failed run: holds the message.
FAILED = "failed.txt"
# Below this many cells a coarser run saves less than meshing it and mapping it costs.
MAPPED_FROM = 80
COARSE_SHARE = 0.25
# Written into the log by the case's function object when it ends the run.
AT_REST = "velocity condition satisfied"
# Written into the log by streamFunction before it computes a wrong one.
NO_START = "Zero flux boundary face not found"
_RESIDUAL = re.compile(r"Solving for Ux, Initial residual = ([^,\s]+),")
_TIME = re.compile(r"(?m)^Time = ([\d.eE+-]+)s?$")


def parameter(folder: Path, name: str) -> str:
    """One entry of a case's system/parameters; InputError where it is missing."""
    path = folder / "system" / "parameters"
    text = read_text(path, "numbers of a case", MOST_SCENE_BYTES) if is_ordinary(path) else ""
    match = re.search(rf"(?m)^{name}\s+([^;]+);", text)
    if not match:
        raise InputError(
            str(path), f"an entry '{name} VALUE;'", "none",
            "Lay the case out as foam_cases/cavity is.",
        )  # fmt: skip
    return match[1].strip()


def _number(folder: Path, name: str, below: float) -> float:
    """A number of system/parameters between 0 and `below`; InputError for any other entry."""
    entry = parameter(folder, name)
    try:
        value = float(entry)
    except ValueError:
        value = math.nan
    if not 0.0 < value < below:
        raise InputError(
            f"{folder / 'system' / 'parameters'}, key {name}",
            f"a number above 0 and below {below:g}", entry, "Change the entry.",
        )  # fmt: skip
    return value


def _set_parameter(folder: Path, name: str, value: int) -> None:
    parameter(folder, name)
    path = folder / "system" / "parameters"
    text = path.read_text(encoding="utf-8")
    path.write_text(re.sub(rf"(?m)^{name}\s+[^;]+;", f"{name} {value};", text), encoding="utf-8")


def solve_case(
    case: str | Path,
    cells: int | None = None,
    processes: int = 1,
    out: Path | None = None,
    report: Report | None = None,
    *,
    trust: bool = False,
    to_rest: bool = True,
) -> Path:
    """Run a case, or find that it has been run; the folder of the solved case.

    A flow in time is run to rest, others to the endTime of their controlDict.

    Parameters
    ----------
    case : built-in name, or a folder laid out as foam_cases/cavity is; it is not written to
    cells : per direction, instead of the number in the case's system/parameters
    processes : for icoFoam; they do not change the solution beyond the solvers' tolerances
    out : where the solved case goes, instead of the cache; new, or this very case solved
    report : called with the stage, "flow CASE, N cells: what", and the fraction done, 0 to 1
    to_rest : whether a case that has no atRest ends at rest (at `trust.AT_REST`); else it goes to its
        endTime and writes on the way as its controlDict says
    trust : give the case's own files to OpenFOAM, which runs what they ask for, see `openfoam.trust`

    Raises InputError for a folder that is no such case, or for an untrusted case with more than a plane
    laminar case needs; RunError if OpenFOAM is missing, a program fails or the flow has not come to rest
    at endTime. The failed run is kept beside the result's folder.
    """
    source = case_folder(case)
    _check_numbers(str(case), cells, processes)
    _check_place(source, out)
    content = content_hash(source)
    plain = None if trust else plain_case(source, cells, processes, to_rest=to_rest)
    if plain is not None:
        number = plain.cells
    else:
        number = int(_number(source, "cells", 1e9)) if cells is None else cells
        _number(source, "atRest", 1.0)
    _check_size(str(case), number, float(number) ** 2 if plain is None else plain.mesh_cells)
    require_openfoam(() if plain is None else (plain.run.application.name,))
    solving = _Solving(source, content, number, processes, plain, to_rest)
    target = solved_folder(source, number, solving.kept_as) if out is None else out
    if target.exists():
        if is_solved(target, inputs_hash(source, number, solving.kept_as)):
            return target
        raise InputError(
            str(target), "no such folder yet, or this very case solved", "something else",
            "Name another folder, or remove this one.",
        )  # fmt: skip
    tell = report or _silent
    stage = f"flow {source.name}, {number} cells"
    if out is None and target.parent != cache_home() / "flows":
        tell(f"{stage}: {cache_home()} cannot be written, so into {target.parent}", 0.0)
    with cleaned_up():
        _solve_into(target, solving, lambda what, done: tell(f"{stage}: {what}", done))
    tell(f"{stage}: {'at rest' if solving.run.at_rest else 'solved'}", 1.0)
    return target


@dataclass(frozen=True)
class _Solving:
    """One solution to compute: the case, its content, its numbers, and its files as they were read."""

    source: Path
    content: str
    cells: int
    processes: int
    plain: PlainCase | None
    to_rest: bool

    @property
    def run(self) -> Run:
        """The solver, and how far it goes; a trusted case goes to rest, and has its endTime to itself."""
        if self.plain is not None:
            return self.plain.run
        return Run(APPLICATIONS["icoFoam"], math.inf, _number(self.source, "atRest", 1.0))

    @property
    def kept_as(self) -> str:
        """A hash of the case's files, other for a run to endTime where they could run to rest."""
        if self.to_rest or self.run.at_rest:
            return self.content
        return hashlib.sha256(f"{self.content} to endTime".encode()).hexdigest()

    def coarser(self) -> _Solving | None:
        """The run on half the cells a side whose solution is the start, where that pays."""
        scales = self.plain is None or (self.plain.scales and self.run.at_rest > 0.0)
        if self.cells < MAPPED_FROM or not scales:
            return None
        cells = self.cells // 2
        plain = None
        if self.plain is not None:
            plain = plain_case(self.source, cells, 1, to_rest=self.to_rest)
        return _Solving(self.source, self.content, cells, 1, plain, self.to_rest)


def _check_numbers(case: str, cells: int | None, processes: int) -> None:
    """InputError for more cells a side or processes than any run has, before a file is read."""
    if cells is not None and cells > MOST_CELLS:
        expected = f"at most {MOST_CELLS} cells a side"
        raise InputError(case, expected, f"{cells} cells", "Take fewer.")
    cores = os.cpu_count() or 1
    if not 1 <= processes <= cores:
        raise InputError(
            case, f"1 to {cores} processes, the cores of this machine", f"{processes} processes",
            "Change the number.",
        )  # fmt: skip


def _check_place(source: Path, out: Path | None) -> None:
    """InputError for an output folder among the files of the case itself."""
    parts = [(source / name).resolve() for name in input_folders(source)]
    if out is not None and any(out.resolve().is_relative_to(part) for part in parts):
        raise InputError(
            str(out), f"a folder that is no part of the case {source}", "one in it",
            "Name another folder.",
        )  # fmt: skip


def _check_size(case: str, cells: int, mesh_cells: float) -> None:
    """InputError for too few cells, or for a mesh that this machine cannot hold."""
    if cells < _FEWEST_CELLS:
        raise InputError(case, f"at least {_FEWEST_CELLS} cells", f"{cells} cells", "Take more.")
    needed, limit = mesh_cells * BYTES_PER_FLUID_CELL, memory_limit()
    if needed > limit:
        raise InputError(
            case, f"a mesh that fits into the {in_words(limit)} of this machine",
            f"{mesh_cells:.3g} cells, which take about {in_words(needed)}", "Take fewer cells.",
        )  # fmt: skip


def _silent(stage: str, fraction: float) -> None:
    """The report for callers without one."""


def _solve_into(target: Path, solving: _Solving, tell: Report) -> None:
    """Solve in a scratch folder and move it to the target, so that nobody finds half a solution."""
    with scratch_folder(target) as scratch:
        try:
            _solve(scratch, solving, tell)
            if solving.run.at_rest:
                tell("stream function", 0.95)
                _stream_function(scratch, solving)
        except RunError as error:
            kept = _failed_place(target)
            (scratch / FAILED).write_text(f"{error}\n", encoding="utf-8")
            move_to(scratch, kept)
            raise RunError(str(error).replace(str(scratch), str(kept))) from error
        if content_hash(solving.source) != solving.content:
            raise RunError(f"{solving.source} has changed while it was solved. Solve it again.")
        key = inputs_hash(solving.source, solving.cells, solving.kept_as)
        (scratch / MARK).write_text(key + "\n", encoding="utf-8")
        # A solution that somebody else has moved there first is as good, and stays.
        move_to(scratch, target)
    if not is_solved(target):
        raise RunError(f"The solved case could not be moved to {target}; is the disk full?")


def _failed_place(target: Path) -> Path:
    """A name beside the target for a failed run; one that was kept there before is removed."""
    kept = target.with_name(f"{target.name}-failed")
    if is_ordinary(kept / FAILED) and not kept.is_symlink():
        shutil.rmtree(kept, ignore_errors=True)
    # Anything else of that name is not ours.
    return kept.with_name(f"{kept.name}-{secrets.token_hex(4)}") if exists(kept) else kept


def _prepare(solving: _Solving, scratch: Path) -> None:
    """Write a case's inputs; of a trusted one, copy them, with these numbers in system/parameters."""
    if solving.plain is not None:
        if solving.plain.mesh is not None:
            write_own_mesh(solving.plain.mesh, scratch)
        for name, text in solving.plain.files.items():
            (scratch / name).parent.mkdir(exist_ok=True)
            (scratch / name).write_text(text, encoding="ascii")
        return
    start = start_folder(solving.source)
    for part, place in ((start, "0.orig"), (start, "0"), ("constant", ""), ("system", "")):
        shutil.copytree(
            solving.source / part, scratch / (place or part),
            ignore=_not_copied,
        )  # fmt: skip
    _set_parameter(scratch, "cells", solving.cells)
    _set_parameter(scratch, "processes", solving.processes)


def _not_copied(folder: str, names: list[str]) -> list[str]:
    """Among names in a folder: the mesh, and those of neither files nor folders (broken links)."""
    paths = {name: Path(folder, name) for name in names}
    return [
        name for name, path in paths.items()
        if name == LEFT_OUT or not (is_ordinary(path) or is_folder(path))
    ]  # fmt: skip


def _solve(case: Path, solving: _Solving, tell: Report) -> None:
    """Write the case into an empty folder, mesh, map a coarser solution and run it."""
    processes, walled = solving.processes, solving.plain is not None
    coarser, beside, share = solving.coarser(), case / "coarse", 0.0
    if coarser is not None:
        share, what = COARSE_SHARE, f"first on {coarser.cells} cells"
        beside.mkdir()
        _solve(beside, coarser, lambda step, done: tell(f"{what}, {step}", share * done))
    _prepare(solving, case)

    def run(*command: str, follow: Follow | None = None, walled: bool = walled) -> Path:
        return run_program(case, command, follow, walled=walled)

    tell("mesh", share)
    application = solving.run.application
    has_mesh = solving.plain is not None and solving.plain.mesh is not None
    why = why_open(run(application.name, "-help") if has_mesh else run("blockMesh"))
    if solving.plain is not None:
        # Refused before hours go by: no flow can be read from another mesh.
        thin_axis(read_points(case / "constant" / LEFT_OUT), str(solving.source))
    if coarser is not None:
        run("mapFields", str(beside), "-consistent", "-sourceTime", "latestTime")
        shutil.rmtree(beside)
    command = [application.name, *application.arguments]
    if processes > 1:
        run("decomposePar")
        command = ["mpirun", "-np", str(processes), *command, "-parallel"]
        if walled and not why and not mpi_starts(case, processes):
            walled, why = False, "mpirun does not start in one"
    note = f"{application.name} (no wall around it: {why})" if why else application.name
    follow = _follow(
        solving.run, lambda done: tell(note, share + (1.0 - share) * (0.05 + 0.85 * done))
    )
    log = run(*command, follow=follow, walled=walled)
    if solving.run.at_rest and not says(log, AT_REST):
        end = parameter(case, "endTime") if solving.plain is None else f"{solving.run.end_time:g}"
        why = "a longer run is needed, or smaller tolerances of the solvers"
        raise failed(f"{application.name} was not at rest at endTime {end}: {why}", log)
    if processes > 1:
        run("reconstructPar", *(["-latestTime"] if solving.run.at_rest else []))
        for part in case.glob("processor*"):
            shutil.rmtree(part)


def _stream_function(case: Path, solving: _Solving) -> None:
    """Compute the stream function of a case at rest; a wrong one is removed."""
    command = ["postProcess", "-func", "streamFunction", "-latestTime"]
    log = run_program(case, command, walled=solving.plain is not None)
    if says(log, NO_START):
        for wrong in case.glob("*/streamFunction*"):
            wrong.unlink()


def _follow(run: Run, tell: Callable[[float], None]) -> Follow:
    """A follower of the solver's log.

    Towards rest the residual of U falls geometrically from 1 to `at_rest`; else the time goes to endTime.
    """

    def at_rest(grown: str) -> float | None:
        found = _RESIDUAL.findall(grown)
        return (
            None
            if not found
            else math.log(max(float(found[-1]), run.at_rest)) / math.log(run.at_rest)
        )

    def in_time(grown: str) -> float | None:
        found = _TIME.findall(grown)
        return None if not found else float(found[-1]) / run.end_time

    part = at_rest if run.at_rest else in_time

    def follow(grown: str) -> None:
        fraction = part(grown)
        if fraction is not None:
            tell(min(max(fraction, 0.0), 1.0))

    return follow
