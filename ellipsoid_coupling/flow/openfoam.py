"""Solve an OpenFOAM case: copy, mesh, start from a coarser solution, run to rest, stream function.

A case folder is laid out as ``foam_cases/cavity`` is: ``0.orig``, ``constant`` and ``system``,
where ``system/parameters`` holds `cells`, `processes`, `endTime` and `atRest`.

Seconds to rest, all programs included, on two cores (the best of four; icoFoam alone took 28 s at
100 cells with 700 small steps, two correctors and a Gauss-Seidel smoother for U, see
``system/fvSolution``):

    cells, processes              64, 1   64, 2   100, 1   100, 2   200, 2
    directly                        1.4     3.2      3.8      3.3     37.0
    from half the cells, mapped     1.6     2.6      3.3      3.5     28.9

So a coarser solution is mapped from `MAPPED_FROM` cells on; the coarser run uses one process.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow.cases import BUILT_IN
from ellipsoid_coupling.flow.programs import (
    Follow,
    failed,
    openfoam_version,
    require_openfoam,
    run_program,
)
from ellipsoid_coupling.flow.trust import INPUT_FOLDERS, LEFT_OUT, refuse_code
from ellipsoid_coupling.inputs import is_folder, is_ordinary, read_bytes, read_text
from ellipsoid_coupling.kernels import cache_home
from ellipsoid_coupling.limits import (
    BYTES_PER_FLUID_CELL,
    MOST_CASE_FILE_BYTES,
    MOST_SCENE_BYTES,
    in_words,
    memory_limit,
)

Report = Callable[[str, float], None]

# What a solved case is recognised by: written last, holds the hash of the case's inputs.
MARK = "case.foam"
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
    for name in INPUT_FOLDERS:
        if not is_folder(folder / name):
            raise InputError(
                str(case), f"a built-in case ({', '.join(known)}) or a folder with 0.orig, "
                "constant and system", f"no {name} in {folder}", "Correct the name or the path.",
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


def inputs_hash(folder: Path, cells: int) -> str:
    """A hash of everything that the solution depends on; the number of processes is not in it."""
    digest = hashlib.sha256(f"{cells} {openfoam_version()}".encode())
    for part in INPUT_FOLDERS:
        for path in sorted((folder / part).rglob("*")):
            if path.is_file() and LEFT_OUT not in path.parts:
                content = read_bytes(path, "a file of a case", MOST_CASE_FILE_BYTES)
                if path.name == "parameters":
                    content = re.sub(rb"(?m)^(cells|processes)\s+[^;]+;", b"", content)
                digest.update(str(path.relative_to(folder)).encode() + b"\0" + content)
    return digest.hexdigest()[:16]


def solved_folder(case: str | Path, cells: int) -> Path:
    """Where the cache keeps, or would keep, the solution; RunError without OpenFOAM."""
    source = case_folder(case)
    return cache_home() / "flows" / f"{source.name}-{cells}-{inputs_hash(source, cells)}"


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
    trust : run it even if something in it can run code, see `flow.trust`

    Raises InputError for what is no such case, or can run code and is not trusted; RunError if
    OpenFOAM is missing, a program fails or the flow has not come to rest at endTime. The failed run
    is kept beside the result's place.
    """
    source = case_folder(case)
    number = int(_number(source, "cells", 1e9)) if cells is None else cells
    _check_size(str(case), number, processes)
    _number(source, "atRest", 1.0)
    if not trust:
        refuse_code(source)
    require_openfoam()
    target = solved_folder(source, number) if out is None else out
    if is_solved(target, inputs_hash(source, number)):
        return target
    if target.exists():
        raise InputError(
            str(target), "no such folder yet, or this very case solved", "something else",
            "Name another folder, or remove this one.",
        )  # fmt: skip
    tell = report or _silent
    coarse, share = None, 0.0
    if number >= MAPPED_FROM:
        share = COARSE_SHARE
        coarse = solve_case(
            source, number // 2, report=lambda s, f: tell(s, share * f), trust=trust
        )
    stage = f"flow {source.name}, {number} cells"
    _solve_into(
        target, source, number, processes, coarse,
        lambda what, done: tell(f"{stage}: {what}", share + (1.0 - share) * done),
    )  # fmt: skip
    tell(f"{stage}: at rest", 1.0)
    return target


def _check_size(case: str, cells: int, processes: int) -> None:
    """InputError for a mesh or a number of processes that this machine cannot hold."""
    cores = os.cpu_count() or 1
    if cells < 4 or not 1 <= processes <= cores:
        raise InputError(
            case, f"at least 4 cells and 1 to {cores} processes, the cores of this machine",
            f"{cells} cells, {processes} processes", "Change the numbers.",
        )  # fmt: skip
    needed, limit = float(cells) ** 2 * BYTES_PER_FLUID_CELL, memory_limit()
    if needed > limit:
        raise InputError(
            case, f"a mesh that fits into the {in_words(limit)} of this machine",
            f"{cells} cells a side, which take about {in_words(needed)}", "Take fewer cells.",
        )  # fmt: skip


def _silent(stage: str, fraction: float) -> None:
    """The report of a caller who wants none."""


def _solve_into(
    target: Path, source: Path, cells: int, processes: int, coarse: Path | None, tell: Report
) -> None:
    """Solve beside the target and move the whole folder there, so that no half of one is found."""
    scratch = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        _prepare(source, scratch, cells, processes)
        _run_programs(scratch, coarse, processes, tell)
        key = inputs_hash(source, cells)
        (scratch / MARK).write_text(key + "\n", encoding="utf-8")
        with contextlib.suppress(OSError):  # somebody else was faster: theirs is as good
            scratch.rename(target)
    except RunError as error:
        kept = target.with_name(f"{target.name}-failed")
        shutil.rmtree(kept, ignore_errors=True)
        scratch.rename(kept)
        raise RunError(str(error).replace(str(scratch), str(kept))) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    if not is_solved(target):
        raise RunError(f"The solved case could not be moved to {target}; is the disk full?")


def _prepare(source: Path, scratch: Path, cells: int, processes: int) -> None:
    """Copy a case's inputs, with these numbers in system/parameters."""
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir(parents=True)
    for part in INPUT_FOLDERS:
        shutil.copytree(source / part, scratch / part, ignore=shutil.ignore_patterns(LEFT_OUT))
    shutil.copytree(scratch / "0.orig", scratch / "0")
    _set_parameter(scratch, "cells", cells)
    _set_parameter(scratch, "processes", processes)


def _run_programs(case: Path, coarse: Path | None, processes: int, tell: Report) -> None:
    """Mesh, map, run to rest and compute the stream function, in an own copy of the case."""
    tell("mesh", 0.0)
    run_program(case, ["blockMesh"])
    if coarse is not None:
        run_program(case, ["mapFields", str(coarse), "-consistent", "-sourceTime", "latestTime"])
    command = ["icoFoam"]
    if processes > 1:
        run_program(case, ["decomposePar"])
        command = ["mpirun", "-np", str(processes), "icoFoam", "-parallel"]
    follow = _follow_residual(_number(case, "atRest", 1.0), tell)
    log = run_program(case, command, follow)
    if AT_REST not in log.read_text(encoding="utf-8"):
        end = parameter(case, "endTime")
        raise failed(f"icoFoam was not at rest at endTime {end}: a longer run is needed", log)
    if processes > 1:
        run_program(case, ["reconstructPar", "-latestTime"])
        for part in case.glob("processor*"):
            shutil.rmtree(part)
    tell("stream function", 0.95)
    log = run_program(case, ["postProcess", "-func", "streamFunction", "-latestTime"])
    if NO_START in log.read_text(encoding="utf-8"):
        for wrong in case.glob("*/streamFunction*"):
            wrong.unlink()


def _follow_residual(at_rest: float, tell: Report) -> Follow:
    """A follower of icoFoam's log: the residual of U falls geometrically from 1 to `at_rest`."""

    def follow(grown: str) -> None:
        residuals = re.findall(r"Solving for Ux, Initial residual = ([^,\s]+),", grown)
        if residuals:
            fraction = math.log(max(float(residuals[-1]), at_rest)) / math.log(at_rest)
            tell("icoFoam", 0.05 + 0.85 * min(max(fraction, 0.0), 1.0))

    return follow
