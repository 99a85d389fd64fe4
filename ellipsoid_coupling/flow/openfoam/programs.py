"""Start one OpenFOAM program, follow its log, and explain its failure."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.files.limits import MOST_LOG_BYTES, in_words
from ellipsoid_coupling.flow.openfoam import confine

PROGRAMS = ("blockMesh", "mapFields", "decomposePar", "icoFoam", "reconstructPar", "postProcess")
INSTALL = "apt-get install -y --no-install-recommends openfoam"
LAST_LINES = 12
POLL_SECONDS = 0.05
_TAIL_BYTES = 20_000
# 128 + SIGFPE, which OpenFOAM asks for.
_WHY = {
    136: ", a number that is not finite: the run has diverged; a smaller deltaT in system/controlDict, "
    "or other schemes, may help"
}
# "#3  Foam::PCG::solve(...) at ??:?" or "[host:405] [ 3] icoFoam(...)", where a program has crashed.
_FRAME = re.compile(r"\s*(?:#\d+ |\[[^\]]+\] \[ ?\d+\]).*")

Follow = Callable[[str], None]


def openfoam_available() -> bool:
    """Whether every OpenFOAM program that a case needs can be started."""
    return all(shutil.which(program) for program in PROGRAMS)


def require_openfoam(further: Sequence[str] = ()) -> None:
    """RunError with the line that installs OpenFOAM, where it, or one of `further` programs, is missing."""
    missing = [program for program in (*PROGRAMS, *further) if not shutil.which(program)]
    if missing:
        raise RunError(f"OpenFOAM is missing ({', '.join(missing)}). Install it: {INSTALL}")


def foam_environment() -> Mapping[str, str]:
    """The environment of OpenFOAM's programs: Debian's package needs this one variable."""
    environment = dict(os.environ)
    environment.setdefault("WM_PROJECT_DIR", "/usr/share/openfoam")
    if sys.platform != "win32" and os.geteuid() == 0:
        # Open MPI refuses to start for root unless told twice.
        environment["OMPI_ALLOW_RUN_AS_ROOT"] = "1"
        environment["OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
    return environment


def openfoam_version() -> str:
    """The version that icoFoam reports, for instance 1912; RunError without OpenFOAM."""
    require_openfoam()
    command = ["icoFoam", "-help"]
    # Not where a case may lie.
    text = subprocess.run(
        command, env=foam_environment(), capture_output=True, text=True, check=False, cwd="/"
    ).stdout
    match = re.search(r"Using: OpenFOAM\S* \(?([\w.]+)\)?", text)
    return match[1] if match else "unknown"


def run_program(
    case: Path, command: Sequence[str], follow: Follow | None = None, *, walled: bool = True
) -> Path:
    """Run one program in a case folder, its output in log.PROGRAM; return the log's path.

    It ends when this process ends, in whatever way, and so do the processes that it has started.

    Parameters
    ----------
    case : the case folder
    command : program and arguments, ``mpirun -np N`` before them for a parallel one
    follow : called with the new text of the log while the program runs
    walled : without network, and writing nowhere but in `case`, where the system can do that; where
        it cannot, the log begins with the reason, see `why_open`

    Raises RunError with the program's name, the log's last lines and its path if the program ends
    with any status but 0, or says more than any run has to say.
    """
    name = command[3] if command[0] == "mpirun" else Path(command[0]).name
    log = case / f"log.{name}"
    with (
        log.open("w", encoding="utf-8") as out,
        log.open(encoding="utf-8", errors="replace") as grown,
    ):
        process = subprocess.Popen(
            [*_beside(case if walled else None), *command], cwd=case,
            env={**foam_environment(), "PWD": str(case.resolve())},
            stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
        try:
            while process.poll() is None:
                time.sleep(POLL_SECONDS)
                if follow is not None:
                    follow(grown.read())
                if log.stat().st_size > MOST_LOG_BYTES:
                    raise failed(f"{name} said more than {in_words(MOST_LOG_BYTES)}", log)
        finally:
            # Nothing keeps running when this program is interrupted.
            process.terminate()
            process.wait()
    if process.returncode != 0:
        why = _WHY.get(process.returncode, "")
        raise failed(f"{name} ended with status {process.returncode}{why}", log)
    return log


def _beside(folder: Path | None) -> list[str]:
    """The start of a command whose program ends with this process, with a wall around `folder`."""
    place = confine.NO_FOLDER if folder is None else str(folder.absolute())
    return [sys.executable, "-I", "-S", str(Path(confine.__file__)), str(os.getpid()), place]


def why_open(log: Path) -> str:
    """Why the program of a log ran without a wall around it; empty if it had one."""
    with log.open(encoding="utf-8", errors="replace") as file:
        first = file.readline()
    return first.removeprefix(confine.NO_WALL).strip() if first.startswith(confine.NO_WALL) else ""


def mpi_starts(case: Path, processes: int) -> bool:
    """Whether mpirun starts within the wall: some of its ways to find itself need a real network."""
    command = [*_beside(case), "mpirun", "-np", str(processes), "true"]
    done = subprocess.run(
        command, cwd=case, env=foam_environment(), stdin=subprocess.DEVNULL, capture_output=True,
        check=False, start_new_session=True,
    )  # fmt: skip
    return done.returncode == 0


def says(log: Path, text: str) -> bool:
    """Whether a line of a log has this text in it; no more than a line is held in memory."""
    with log.open(encoding="utf-8", errors="replace") as file:
        return any(text in line for line in file)


def failed(what: str, log: Path) -> RunError:
    """The error for a failed program: a message, the last lines of its log, and the log's path."""
    with log.open("rb") as file:
        file.seek(max(log.stat().st_size - _TAIL_BYTES, 0))
        tail = file.read(_TAIL_BYTES).decode(errors="replace")
    lines = [line for line in tail.splitlines() if line.strip() and not _FRAME.fullmatch(line)]
    end = "\n    ".join(lines[-LAST_LINES:])
    return RunError(f"{what}. The end of {log}:\n    {end}")
