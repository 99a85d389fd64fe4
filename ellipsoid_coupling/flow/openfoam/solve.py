"""Solve an OpenFOAM case: write it, mesh, start from a coarser solution, run to rest, stream function.

A case folder is laid out as ``foam_cases/cavity`` is: ``0.orig`` (or ``0``), ``constant`` and ``system``,
where ``system/parameters`` may hold `cells` and `atRest`. OpenFOAM does not get the case's own files but
what `trust` has written from them.

Seconds to rest, all programs included, on two cores (the best of four; icoFoam alone took 28 s at
100 cells with 700 small steps, two correctors and a Gauss-Seidel smoother for U, see
``system/fvSolution``):

    cells, processes              64, 1   64, 2   100, 1   100, 2   200, 2
    directly                        1.4     3.2      3.8      3.3     37.0
    from half the cells, mapped     1.6     2.6      3.3      3.5     28.9

So a coarser solution is mapped from `MAPPED_FROM` cells on; the coarser run uses one process. It is
solved beside the finer one and not taken from the cache: what lies there may be somebody else's, and
mapFields would read its dictionaries.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.files.cache import cache_home
from ellipsoid_coupling.files.limits import (
    BYTES_PER_FLUID_CELL,
    MOST_CASE_FILE_BYTES,
    MOST_CASE_FILES,
    MOST_SCENE_BYTES,
    in_words,
    memory_limit,
)
from ellipsoid_coupling.files.reading import exists, is_folder, is_ordinary, read_bytes, read_text
from ellipsoid_coupling.flow.cases import BUILT_IN
from ellipsoid_coupling.flow.openfoam.case import read_points
from ellipsoid_coupling.flow.openfoam.files import packed
from ellipsoid_coupling.flow.openfoam.own_mesh import write_own_mesh
from ellipsoid_coupling.flow.openfoam.plane import thin_axis
from ellipsoid_coupling.flow.openfoam.programs import (
    Follow,
    failed,
    mpi_starts,
    openfoam_version,
    require_openfoam,
    run_program,
    says,
    why_open,
)
from ellipsoid_coupling.flow.openfoam.scratch import cleaned_up, move_to, scratch_folder
from ellipsoid_coupling.flow.openfoam.trust import (
    LEFT_OUT,
    PlainCase,
    input_folders,
    plain_case,
    start_folder,
)

Report = Callable[[str, float], None]

_FEWEST_CELLS = 4
_LONGEST_NAME = 60
# Entries of system/parameters that are told apart from a case's content.
_COUNTS = re.compile(rb"(?m)^(cells|processes)[ \t]+[0-9.]+[ \t]*;")
# What a solved case is recognised by: written last, holds the hash of the case's inputs.
MARK = "case.foam"
# What a failed run that was kept is recognised by: holds the message.
FAILED = "failed.txt"
# Below this many cells a coarser run saves less than meshing it and mapping it costs.
MAPPED_FROM = 80
COARSE_SHARE = 0.25
# What the case's function object writes into the log when it ends the run.
AT_REST = "velocity condition satisfied"
# What streamFunction writes into the log before it computes a wrong one.
NO_START = "Zero flux boundary face not found"


def case_folder(case: str | Path) -> Path:
    """The folder of a built-in case, or of the case at a path; InputError if it is neither."""
    known = sorted(folder.parent.name for folder in BUILT_IN.glob("*/system"))
    folder = BUILT_IN / case if str(case) in known else Path(case)
    for name in input_folders(folder):
        if not is_folder(folder / name):
            missing = "0.orig or 0" if name == "0" else name
            raise InputError(
                str(case), f"a built-in case ({', '.join(known)}) or a folder with 0.orig (or 0), "
                "constant and system", f"no {missing} in {folder}", "Correct the name or the path.",
            )  # fmt: skip
    return folder


def parameter(folder: Path, name: str) -> str:
    """One entry of a case's system/parameters; InputError where it is missing."""
    path = folder / "system" / "parameters"
    text = read_text(path, "numbers of a case", MOST_SCENE_BYTES) if is_ordinary(path) else ""
    found = re.search(rf"(?m)^{name}\s+([^;]+);", text)
    if not found:
        raise InputError(
            str(path), f"an entry '{name} VALUE;'", "none",
            "Lay the case out as foam_cases/cavity is.",
        )  # fmt: skip
    return found[1].strip()


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


def inputs_hash(folder: Path, cells: int, content: str = "") -> str:
    """A hash of everything that the solution depends on; the number of processes is not in it.

    content : of the case's files, where it is known
    """
    content = content or content_hash(folder)
    return hashlib.sha256(f"{cells} {openfoam_version()} {content}".encode()).hexdigest()[:16]


def content_hash(folder: Path) -> str:
    """A hash of a case's files, but for the numbers of cells and processes."""
    digest = hashlib.sha256()
    left, makes_mesh = MOST_CASE_FILE_BYTES, packed(folder / "system" / "blockMeshDict") is not None
    for part in input_folders(folder):
        for path in _files_below(folder / part):
            name = path.relative_to(folder)
            if path.is_file() and not (makes_mesh and LEFT_OUT in name.parts):
                content = read_bytes(path, "a file of a case", left)
                left -= len(content)
                if path.name == "parameters":
                    content = _COUNTS.sub(b"", content)
                # With the length, so that no file's content can pass for two files.
                digest.update(os.fsencode(name) + b"\0%d\0" % len(content) + content)
    return digest.hexdigest()


def _files_below(folder: Path) -> list[Path]:
    """What lies in a folder and below, links to other folders followed; InputError for too much."""
    found: list[Path] = []
    for place, folders, files in os.walk(folder, followlinks=True):
        found += [Path(place, name) for name in (*folders, *files)]
        if len(found) > MOST_CASE_FILES:
            raise InputError(
                str(folder), f"at most {MOST_CASE_FILES} files", "more",
                "Name the case alone, without other data in its folders.",
            )  # fmt: skip
    return sorted(found)


def solved_folder(case: str | Path, cells: int, content: str = "") -> Path:
    """Where the cache keeps, or would keep, the solution; RunError without OpenFOAM.

    A cache that cannot be written serves what it has; the rest lies among this user's temporary files.

    content : a hash of the case's files, where it is known
    """
    source = case_folder(case)
    name = f"{_plain_name(source.name)}-{cells}-{inputs_hash(source, cells, content)}"
    kept = cache_home() / "flows" / name
    return kept if is_solved(kept) or _is_writable(kept.parent) else _private_folder() / name


def kept_folders(name: str, cells: int) -> list[Path]:
    """All solutions that the cache keeps of cases of that name; no program is started."""
    places = [cache_home() / "flows"]
    places += [_private_folder()] if _private_place().exists() else []
    return [
        found for place in places
        for found in sorted(place.glob(f"{_plain_name(name)}-{cells}-*")) if is_solved(found)
    ]  # fmt: skip


def _plain_name(name: str) -> str:
    """A case's name as part of a folder's, where OpenFOAM shall find it."""
    return re.sub(r"[^\w.+-]", "_", name, flags=re.ASCII)[:_LONGEST_NAME]


def _is_writable(folder: Path) -> bool:
    """Whether a folder can be written to, or made."""
    there = folder.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    try:
        with tempfile.TemporaryFile(dir=there):
            return True
    except OSError:
        return False


def _private_place() -> Path:
    return Path(tempfile.gettempdir()) / f"ellipsoid_coupling-{os.geteuid()}"


def _private_folder() -> Path:
    """A folder among the temporary files that is this user's alone."""
    folder = _private_place()
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o022:
        raise InputError(
            str(folder), "a folder that is this user's alone", "another",
            "Set ELLIPSOID_CACHE to a folder that can be written.",
        )  # fmt: skip
    return folder


def is_solved(folder: Path, key: str | None = None) -> bool:
    """Whether `solve_case` made this folder, to its end (and from the inputs with this hash)."""
    mark = folder / MARK
    if not is_ordinary(mark):
        return False
    made_from = read_bytes(mark, "the mark of a solved case", MOST_SCENE_BYTES).strip()
    return key is None or made_from == key.encode()


def solve_case(
    case: str | Path,
    cells: int | None = None,
    processes: int = 1,
    out: Path | None = None,
    report: Report | None = None,
    *,
    trust: bool = False,
) -> Path:
    """Run a case to rest, or find that it has been run; the folder of the solved case.

    Parameters
    ----------
    case : built-in name, or a folder laid out as foam_cases/cavity is; it is not written to
    cells : per direction, instead of the number in the case's system/parameters
    processes : for icoFoam; they do not change the solution beyond the solvers' tolerances
    out : where the solved case goes, instead of the cache; new, or this very case solved
    report : called with the stage, "flow CASE, N cells: what", and the fraction done, 0 to 1
    trust : give the case's own files to OpenFOAM, which runs what they ask for, see `openfoam.trust`

    Raises InputError for what is no such case, or holds more than a plane laminar case needs and is not
    trusted; RunError if OpenFOAM is missing, a program fails or the flow has not come to rest at endTime.
    The failed run is kept beside the result's place.
    """
    source = case_folder(case)
    _check_processes(str(case), processes)
    _check_place(source, out)
    content = content_hash(source)
    plain = None if trust else plain_case(source, cells, processes)
    if plain is not None:
        number = plain.cells
    else:
        number = int(_number(source, "cells", 1e9)) if cells is None else cells
        _number(source, "atRest", 1.0)
    _check_size(str(case), number, float(number) ** 2 if plain is None else plain.mesh_cells)
    require_openfoam()
    target = solved_folder(source, number, content) if out is None else out
    if target.exists():
        if is_solved(target, inputs_hash(source, number, content)):
            return target
        raise InputError(
            str(target), "no such folder yet, or this very case solved", "something else",
            "Name another folder, or remove this one.",
        )  # fmt: skip
    tell = report or _silent
    stage = f"flow {source.name}, {number} cells"
    if out is None and target.parent != cache_home() / "flows":
        tell(f"{stage}: {cache_home()} cannot be written, so into {target.parent}", 0.0)
    solving = _Solving(source, content, number, processes, plain)
    with cleaned_up():
        _solve_into(target, solving, lambda what, done: tell(f"{stage}: {what}", done))
    tell(f"{stage}: at rest", 1.0)
    return target


@dataclass(frozen=True)
class _Solving:
    """What is to be solved: the case, its content, its numbers, and what was understood of it."""

    source: Path
    content: str
    cells: int
    processes: int
    plain: PlainCase | None

    def coarser(self) -> _Solving | None:
        """The run on half the cells a side whose solution is the start, where that pays."""
        if self.cells < MAPPED_FROM or (self.plain is not None and not self.plain.scales):
            return None
        cells = self.cells // 2
        plain = None if self.plain is None else plain_case(self.source, cells, 1)
        return _Solving(self.source, self.content, cells, 1, plain)


def _check_processes(case: str, processes: int) -> None:
    cores = os.cpu_count() or 1
    if not 1 <= processes <= cores:
        raise InputError(
            case, f"1 to {cores} processes, the cores of this machine", f"{processes} processes",
            "Change the number.",
        )  # fmt: skip


def _check_place(source: Path, out: Path | None) -> None:
    """InputError for a place among the files that the case is made of."""
    parts = [(source / name).resolve() for name in input_folders(source)]
    if out is not None and any(out.resolve().is_relative_to(part) for part in parts):
        raise InputError(
            str(out), f"a folder that is no part of the case {source}", "one in it",
            "Name another folder.",
        )  # fmt: skip


def _check_size(case: str, cells: int, mesh_cells: float) -> None:
    """InputError for a mesh that is none, or that this machine cannot hold."""
    if cells < _FEWEST_CELLS:
        raise InputError(case, f"at least {_FEWEST_CELLS} cells", f"{cells} cells", "Take more.")
    needed, limit = mesh_cells * BYTES_PER_FLUID_CELL, memory_limit()
    if needed > limit:
        raise InputError(
            case, f"a mesh that fits into the {in_words(limit)} of this machine",
            f"{mesh_cells:.3g} cells, which take about {in_words(needed)}", "Take fewer cells.",
        )  # fmt: skip


def _silent(stage: str, fraction: float) -> None:
    """The report of a caller who wants none."""


def _solve_into(target: Path, solving: _Solving, tell: Report) -> None:
    """Solve in a folder of its own and move it to the target, so that no half of one is found."""
    with scratch_folder(target) as scratch:
        try:
            _run_to_rest(scratch, solving, tell)
            tell("stream function", 0.95)
            _stream_function(scratch, solving)
        except RunError as error:
            kept = _failed_place(target)
            (scratch / FAILED).write_text(f"{error}\n", encoding="utf-8")
            move_to(scratch, kept)
            raise RunError(str(error).replace(str(scratch), str(kept))) from error
        if content_hash(solving.source) != solving.content:
            raise RunError(f"{solving.source} has changed while it was solved. Solve it again.")
        key = inputs_hash(solving.source, solving.cells, solving.content)
        (scratch / MARK).write_text(key + "\n", encoding="utf-8")
        # Where somebody else was faster, theirs is as good.
        move_to(scratch, target)
    if not is_solved(target):
        raise RunError(f"The solved case could not be moved to {target}; is the disk full?")


def _failed_place(target: Path) -> Path:
    """A name beside the target for a failed run; one that was kept there before is removed."""
    kept = target.with_name(f"{target.name}-failed")
    if is_ordinary(kept / FAILED) and not kept.is_symlink():
        shutil.rmtree(kept, ignore_errors=True)
    # Whatever else is called so is not ours.
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
    """Of names in a folder: the mesh, and what is neither file nor folder, as links to nowhere are."""
    paths = {name: Path(folder, name) for name in names}
    return [
        name for name, path in paths.items()
        if name == LEFT_OUT or not (is_ordinary(path) or is_folder(path))
    ]  # fmt: skip


def _run_to_rest(case: Path, solving: _Solving, tell: Report) -> None:
    """Write the case into an empty folder, mesh, map a coarser solution and run to rest."""
    processes, walled = solving.processes, solving.plain is not None
    coarser, beside, share = solving.coarser(), case / "coarse", 0.0
    if coarser is not None:
        share, what = COARSE_SHARE, f"first on {coarser.cells} cells"
        beside.mkdir()
        _run_to_rest(beside, coarser, lambda step, done: tell(f"{what}, {step}", share * done))
    _prepare(solving, case)

    def run(*command: str, follow: Follow | None = None, walled: bool = walled) -> Path:
        return run_program(case, command, follow, walled=walled)

    tell("mesh", share)
    has_mesh = solving.plain is not None and solving.plain.mesh is not None
    why = why_open(run("icoFoam", "-help") if has_mesh else run("blockMesh"))
    if solving.plain is not None:
        # Before hours go by: no flow can be read from another mesh.
        thin_axis(read_points(case / "constant" / LEFT_OUT), str(solving.source))
    if coarser is not None:
        run("mapFields", str(beside), "-consistent", "-sourceTime", "latestTime")
        shutil.rmtree(beside)
    command = ["icoFoam"]
    if processes > 1:
        run("decomposePar")
        command = ["mpirun", "-np", str(processes), "icoFoam", "-parallel"]
        if walled and not why and not mpi_starts(case, processes):
            walled, why = False, "mpirun does not start in one"
    at_rest = _number(case, "atRest", 1.0) if solving.plain is None else solving.plain.at_rest
    note = f"icoFoam (no wall around it: {why})" if why else "icoFoam"
    follow = _follow_residual(
        at_rest, lambda done: tell(note, share + (1.0 - share) * (0.05 + 0.85 * done))
    )
    log = run(*command, follow=follow, walled=walled)
    if not says(log, AT_REST):
        end = parameter(case, "endTime") if solving.plain is None else f"{solving.plain.end_time:g}"
        why = "a longer run is needed, or smaller tolerances of the solvers"
        raise failed(f"icoFoam was not at rest at endTime {end}: {why}", log)
    if processes > 1:
        run("reconstructPar", "-latestTime")
        for part in case.glob("processor*"):
            shutil.rmtree(part)


def _stream_function(case: Path, solving: _Solving) -> None:
    """Compute the stream function of a case at rest; a wrong one is removed."""
    command = ["postProcess", "-func", "streamFunction", "-latestTime"]
    log = run_program(case, command, walled=solving.plain is not None)
    if says(log, NO_START):
        for wrong in case.glob("*/streamFunction*"):
            wrong.unlink()


def _follow_residual(at_rest: float, tell: Callable[[float], None]) -> Follow:
    """A follower of icoFoam's log: the residual of U falls geometrically from 1 to `at_rest`."""

    def follow(grown: str) -> None:
        residuals = re.findall(r"Solving for Ux, Initial residual = ([^,\s]+),", grown)
        if residuals:
            fraction = math.log(max(float(residuals[-1]), at_rest)) / math.log(at_rest)
            tell(min(max(fraction, 0.0), 1.0))

    return follow
