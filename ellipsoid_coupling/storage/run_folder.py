"""The folder of a run: its lock, its run.toml and its checkpoint.

A kill at any moment loses at most the work since the last checkpoint, and the folder never holds a file
that does not load.
"""

from __future__ import annotations

import fcntl
import json
import os
import time
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ellipsoid_coupling.errors import InputError, WriteError
from ellipsoid_coupling.files.limits import (
    LONGEST_RUN,
    MOST_CHECKPOINT_ARRAYS,
    MOST_SCENE_BYTES,
    memory_limit,
)
from ellipsoid_coupling.files.reading import (
    exists,
    is_folder,
    open_ordinary,
    output_folder,
    read_arrays,
    read_text,
)
from ellipsoid_coupling.files.versions import version
from ellipsoid_coupling.files.writing import Arrays, cannot_write, halves, whole_file, write_arrays
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.scenes.files import parse_toml, table_to_toml
from ellipsoid_coupling.scenes.start import KEPT_START

_FILES = RUN_FILE, RESULT_FILE, CHECKPOINT_FILE, FLOW_FILE, START_FILE = (
    "run.toml",
    "result.nc",
    "checkpoint.npz",
    "flow.npz",
    KEPT_START,
)

# The largest part of a run's time that checkpoints may take; larger ones are written less often.
_WRITING_PART = 0.02
_PACKAGES = ("ellipsoid_coupling", "numpy", "numba", "scipy")
_FORMAT = 2
_MOST_META = 200  # characters; json reads nested parts by recursion
# In [run]: where the flow came from. The next one of the same numbers may come from elsewhere.
_IN_WORDS = "flow"


@dataclass
class RunFolder:
    """The folder that a run keeps its files in, and the rules of keeping them.

    Attributes
    ----------
    path : Path
        Becomes the folder's own, with its number, when a `numbered` one is claimed.
    resume : bool
        Continue from the checkpoint, bit for bit as if never stopped; from the start if there is none.
    force : bool
        Overwrite an earlier run in a folder that is not empty.
    checkpoint_seconds : float
        Between two checkpoints: about the most work that a kill loses.
    stop_after : float or None
        Seconds after which the run writes a checkpoint and stops (Interrupted), to be resumed.
    longest : float
        Seconds that the run may take in all by its present pace; it stops likewise.
    numbered : bool
        A new folder: `path` with the first free number behind it, found and taken when it is claimed.
    """

    path: Path
    resume: bool = False
    force: bool = False
    checkpoint_seconds: float = 15.0
    stop_after: float | None = None
    longest: float = LONGEST_RUN
    numbered: bool = False
    # The folder's identity in the file system while it is claimed.
    _claimed: list[os.stat_result] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def check(self) -> None:
        """Refuse, before anything is computed, a path that cannot become this run's folder.

        Raises
        ------
        InputError
            If the path is a file, cannot be written, holds something already, or is to be resumed and
            holds no run.
        """
        if self.numbered and not self._claimed:
            output_folder(self.path.parent)
            return
        require_free(self.path, force=self.force or self.resume)
        if not self.path.is_dir():
            return
        for name in _FILES:
            if is_folder(self.path / name):
                raise InputError(
                    str(self.path / name), "a file or nothing", "a folder", "Choose another --out."
                )
        half = {path.name for path in halves(self.path, _FILES)}
        held = sorted({path.name for path in self.path.iterdir()} - half)
        if self.resume and not self.force and held and RUN_FILE not in held:
            raise InputError(
                f"--out {self.path}",
                f"a run folder to resume, with a {RUN_FILE}",
                f"one that holds {_some(held)}",
                "Name the run's folder, or start again with --force.",
            )

    def check_same(self, run: Mapping[str, object], scene: Mapping[str, object]) -> None:
        """Refuse to resume another run, before a flow is looked for.

        `run` and `scene` as in `claimed`; the flow's entries in `run` are not compared.
        """
        if self.resume and exists(self.path / RUN_FILE):
            self._require_same({"run": run, "scene": scene}, but=("flow_digest",))

    @contextmanager
    def claimed(
        self, run: Mapping[str, object], scene: Mapping[str, object], flow: FlowField | None = None
    ) -> Iterator[None]:
        """Inside, the folder is this process's alone and holds the run.toml and flow of this run.

        Parameters
        ----------
        run, scene : mapping
            The parts of run.toml that a resumed run must have in common with the one started.
        flow : FlowField or None
            The one that the run uses; its digest stands in `run`.

        Raises
        ------
        InputError
            As `check`; or if another process works in the folder, or it holds another run.
        """
        self.check()
        if self.numbered:
            self.path = _new_folder(self.path)
        else:
            _make_folder(self.path)
        handle = os.open(self.path, os.O_RDONLY)
        try:
            _lock(handle, self.path)
            self._claimed.append(os.fstat(handle))
            self.require_ours()  # it may have been removed before the lock
            self.check()
            for half in halves(self.path, _FILES):
                half.unlink()  # left by a killed run: no other process holds the lock
            if self.resume and exists(self.path / RUN_FILE):
                self._require_same({"run": run, "scene": scene})
            else:
                self._begin({"run": run, "versions": _versions(), "scene": scene})
            # After run.toml: a run that is killed in between writes the flow when it is resumed.
            if flow is not None and not exists(self.path / FLOW_FILE):
                flow.save(self.path / FLOW_FILE)
            yield
        finally:
            self._claimed.clear()
            os.close(handle)  # and with it the lock, which a kill releases as well

    def require_ours(self) -> None:
        """Refuse to write into a path that is no longer the claimed folder; called before every file.

        Raises
        ------
        WriteError
            If the folder was removed or moved. A new folder at its path is not locked by this run.
        """
        ours = self._claimed[-1] if self._claimed else None
        try:
            there = self.path.stat()
        except OSError as error:
            raise cannot_write(self.path, error) from error
        if ours is not None and not os.path.samestat(ours, there):
            raise WriteError(
                f"{self.path} could not be written: it is no longer the folder that this run has "
                "claimed, which was removed or moved. Run again with another --out."
            )

    def _begin(self, table: Mapping[str, object]) -> None:
        # The start may be that of the run to come; see `start_file.keep_start`.
        for name in (RESULT_FILE, CHECKPOINT_FILE, FLOW_FILE):
            (self.path / name).unlink(missing_ok=True)
        with whole_file(self.path / RUN_FILE, new_folder=False) as file:
            file.write_text(table_to_toml(table), encoding="utf-8")

    def _require_same(self, wanted: Mapping[str, object], but: tuple[str, ...] = ()) -> None:
        file = self.path / RUN_FILE
        before = read_run_file(file)
        same = tomllib.loads(table_to_toml(wanted))
        for part, values in same.items():
            keys = set(values) | set(before.get(part, {}))
            # `but` names keys of [run]; [scene] has a section flow of its own.
            for key in sorted(keys - ({_IN_WORDS, *but} if part == "run" else set())):
                old, new = before.get(part, {}).get(key), values.get(key)
                if old != new:
                    raise InputError(
                        f"{file}, [{part}] {key}",
                        f"the run that was started, {_short(old)}",
                        _short(new),
                        "Resume with the same settings, or use another --out.",
                    )
        if before.get("versions") != _versions():
            raise InputError(
                f"{file}, [versions]",
                f"the versions that the run was started with, {_short(before.get('versions'))}",
                _short(_versions()),
                "Install those, or start again in another --out: it would not be the same bits.",
            )

    @property
    def keeps_flow(self) -> bool:
        """Whether the run to be resumed has left its flow here."""
        return self.resume and exists(self.path / RUN_FILE) and exists(self.path / FLOW_FILE)

    @property
    def result(self) -> Path:
        """result.nc; call `require_ours` before it is written."""
        return self.path / RESULT_FILE

    def save(self, arrays: Arrays) -> None:
        """Write a checkpoint; the previous one stays until the new one is complete."""
        self.require_ours()
        meta = json.dumps({"format": _FORMAT, "package": version("ellipsoid_coupling")})
        file = self.path / CHECKPOINT_FILE
        write_arrays(file, {"meta": np.array(meta), **arrays}, new_folder=False)

    def load(self) -> Arrays | None:
        """The arrays of the checkpoint; None if there is none yet.

        Raises
        ------
        InputError
            If it is damaged, or not a checkpoint of this package.
        """
        file = self.path / CHECKPOINT_FILE
        if not self.resume or not exists(file):
            return None
        # Checkpoints are not compressed: arrays larger than the file are not from this package.
        with open_ordinary(file, "a whole checkpoint", memory_limit()) as opened:
            size = opened.seek(0, os.SEEK_END)
        arrays = read_arrays(file, "a whole checkpoint", size, MOST_CHECKPOINT_ARRAYS)
        try:
            meta = str(arrays.pop("meta"))
            known = len(meta) < _MOST_META and json.loads(meta)["format"] == _FORMAT
        except (KeyError, ValueError, TypeError):
            known = False
        if not known:
            raise InputError(
                str(file), f"a checkpoint of format {_FORMAT}", "another file", "Start again."
            )
        return arrays

    def clear(self) -> None:
        """Remove the checkpoint of a run that has ended."""
        self.require_ours()
        (self.path / CHECKPOINT_FILE).unlink(missing_ok=True)


class Keeper:
    """Decides when the next checkpoint is due, from the interval and the time that writing one takes."""

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._next = time.perf_counter() + interval

    @property
    def due(self) -> bool:
        """Whether it is time."""
        return time.perf_counter() >= self._next

    def written(self, started: float) -> None:
        """A checkpoint was begun at `started` (of perf_counter) and is written now."""
        now = time.perf_counter()
        pause = self._interval if self._interval == 0.0 else (now - started) / _WRITING_PART
        self._next = now + max(self._interval, pause)


def _make_folder(path: Path) -> None:
    """Make a folder with those above it, where it is missing; WriteError where that cannot be."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(path, error) from error


@contextmanager
def numbered_folder(path: Path) -> Iterator[Path]:
    """A new folder called `path`, or `path` with the first free number behind it.

    Commands that ask at the same time get different folders. The folder is removed again if it is still
    empty at the end.

    Raises
    ------
    WriteError
        If none can be made there.
    """
    folder = _new_folder(path)
    try:
        yield folder
    finally:
        with suppress(OSError):  # it is not empty, or was removed
            folder.rmdir()


def _new_folder(path: Path) -> Path:
    """`path`, or with the first free number behind it, made."""
    _make_folder(path.parent)
    folder, count = path, 1
    while not _made(folder):
        count += 1
        folder = path.with_name(f"{path.name}-{count}")
    return folder


def _made(folder: Path) -> bool:
    """Whether this call has made the folder; the system lets only one of several calls succeed."""
    try:
        folder.mkdir()
    except FileExistsError:
        return False
    except OSError as error:
        raise cannot_write(folder, error) from error
    return True


def require_free(path: Path, *, force: bool, option: str = "--out ") -> None:
    """Refuse an output folder that is a file, cannot be written, or holds something (unless forced).

    `option` is the command's option that named it.

    Raises
    ------
    InputError
    """
    output_folder(path)
    held = sorted(entry.name for entry in path.iterdir()) if path.exists() else []
    if held and not force:
        other = "Choose another --out, or overwrite" if option else "Overwrite"
        raise InputError(
            f"{option}{path}",
            "a new or empty folder",
            f"one that holds {_some(held)}",
            f"{other} with --force{' (a run: continue with --resume)' if option else ''}.",
        )


def read_run_file(file: Path) -> dict[str, dict[str, object]]:
    """The tables of a run.toml; InputError where it is none."""
    text = read_text(file, "the run.toml of a run", MOST_SCENE_BYTES)
    table = parse_toml(text, str(file))
    for part, values in table.items():
        if not isinstance(values, dict):
            raise InputError(
                f"{file}, {part}", "a section", repr(values), "Take the run.toml of a run."
            )
    return table


def _lock(handle: int, path: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            f"--out {path}", "a folder that no other run uses", "one in use by a running process",
            "Wait for it to end, or choose another --out.",
        ) from None  # fmt: skip
    except OSError as error:
        raise cannot_write(path, error) from error


def _versions() -> dict[str, str]:
    return {name: version(name) for name in _PACKAGES}


def _some(names: list[str]) -> str:
    return ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")


def _short(value: object) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
