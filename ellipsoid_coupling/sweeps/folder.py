"""The folder of a sweep.

    sweep.toml      everything that repeats it
    flows/          each flow that its points use, once
    runs/NAME/      a run folder a point
    claims/NAME     which task has taken a point (batch queues only)
    wholes/NAME/    run folders of runs whose realisations were split among points
    results.nc      all points on common bins

Many processes, on many machines, may work in it at once: nothing here waits for a lock but the flows.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.reading import exists, is_folder, output_folder, read_text
from ellipsoid_coupling.files.writing import cannot_write
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.sweeps.description import Sweep

SWEEP_FILE, RESULTS_FILE = "sweep.toml", "results.nc"
_MOST_CLAIM_BYTES = 1000
# Between two looks whether another process has left a run folder.
_PAUSE = 0.1


def begin(path: Path, sweep: Sweep, *, resume: bool, shared: bool = False) -> None:
    """Make the folder of a sweep, or refuse one that holds something else.

    Parameters
    ----------
    resume : bool
        Go on in a folder that holds this very sweep.
    shared : bool
        Other tasks of this sweep may have begun: the folder may hold it already.

    Raises
    ------
    InputError
        For a folder that holds another sweep, or anything else; nothing is changed then.
    """
    file = path / SWEEP_FILE
    if not ((resume or shared) and exists(file)):
        _require_free(path, shared=shared)
        sweep.save(file)
    _require_same(file, sweep)


def _require_free(path: Path, *, shared: bool) -> None:
    """Refuse a folder that holds something; `shared`: but for what other tasks have just begun.

    A sweep that was refused before its first run (its flow could not be read) holds nothing.
    """
    output_folder(path)
    held = {entry.name for entry in path.iterdir()} if is_folder(path) else set[str]()
    if held <= {SWEEP_FILE, "flows"} and not any((path / "flows").glob("*")):
        return
    if shared and (SWEEP_FILE in held or all(name.startswith(".sweep.") for name in held)):
        return
    if held:
        raise InputError(
            f"--out {path}", "a new or empty folder", f"one that holds {min(held)}",
            "Choose another --out; a sweep goes on with --resume.",
        )  # fmt: skip


def _require_same(file: Path, sweep: Sweep) -> None:
    before = Sweep.load(file)
    if before.text() == sweep.text():
        return
    lines = zip(before.text().splitlines(), sweep.text().splitlines(), strict=False)
    old, new = next(((a, b) for a, b in lines if a != b), ("a shorter file", "a longer one"))
    remedy = "Resume with the same settings, or use another --out."
    raise InputError(str(file), f"the sweep that was started, {old}", new, remedy)


def run_path(path: Path, name: str) -> Path:
    """The run folder of a point."""
    return path / "runs" / name


def flow_key(scene: Scene) -> str | None:
    """What tells apart the flows of a sweep's scenes before they are there; None without a fluid."""
    if scene.flow is None:
        return None
    parts = [scene.flow.named, scene.domain.model_dump(mode="json")]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def keep_flow(path: Path, key: str, obtain: Callable[[], FlowField | None]) -> None:
    """Make `flows/KEY.npz`, unless it is there; of several processes the first one makes it."""
    file = flow_file(path, key)
    if exists(file):
        return
    with _locked(file.parent):
        if not exists(file) and (field := obtain()) is not None:
            field.save(file)


def flow_file(path: Path, key: str) -> Path:
    """Where `keep_flow` puts a flow."""
    return path / "flows" / f"{key}.npz"


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise cannot_write(folder, error) from error
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def wait_until_free(run: Path) -> None:
    """Wait for another process that computes the same point, which a lost sweep has left behind."""
    while is_folder(run):
        handle = os.open(run, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(_PAUSE)
        else:
            return
        finally:
            os.close(handle)


def claim(path: Path, name: str, task: str, *, again: bool) -> bool:
    """Take a point for a task; False if another has it.

    The system lets only one of several calls make the file.

    again : the task may have taken it before, and was stopped
    """
    file = path / "claims" / name
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    except FileExistsError:
        return again and _owner(file) == task
    except OSError as error:
        raise cannot_write(file, error) from error
    with os.fdopen(handle, "w", encoding="utf-8") as opened:
        opened.write(f"{task} {socket.gethostname()} {os.getpid()}\n")
    return True


def _owner(file: Path) -> str:
    return read_text(file, "the claim of a task", _MOST_CLAIM_BYTES).partition(" ")[0]
