"""The folder of a run: who may write into it, run.toml, and the checkpoint that a run goes on from.

Written so that a kill at any moment loses at most the work since the last checkpoint, and that the
folder never holds a file that does not load.
"""

from __future__ import annotations

import fcntl
import json
import os
import time
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files import (
    Arrays,
    cannot_write,
    halves,
    whole_file,
    write_arrays,
)
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.inputs import exists, is_folder, output_folder, read_arrays, read_text
from ellipsoid_coupling.limits import LONGEST_RUN, MOST_SCENE_BYTES, memory_limit
from ellipsoid_coupling.scenes.files import parse_toml, table_to_toml

_FILES = RUN_FILE, RESULT_FILE, CHECKPOINT_FILE, FLOW_FILE = (
    "run.toml",
    "result.nc",
    "checkpoint.npz",
    "flow.npz",
)

# Writing a checkpoint may take this part of a run's time; where it takes more, it is done less often.
_WRITING_PART = 0.02
_PACKAGES = ("ellipsoid_coupling", "numpy", "numba", "scipy")
_FORMAT = 2
_MOST_META = 200  # characters; json reads what is nested by recursion
# In [run]: where the flow came from. The next one of the same numbers may come from elsewhere.
_IN_WORDS = "flow"


@dataclass(frozen=True)
class RunFolder:
    """Where a run keeps its files, and how.

    Attributes
    ----------
    path : Path
    resume : bool
        Go on from the checkpoint, bit for bit as if never stopped; from the start if there is none.
    force : bool
        Overwrite an earlier run in a folder that is not empty.
    checkpoint_seconds : float
        Between two checkpoints; a kill loses at most about so much work.
    stop_after : float or None
        Seconds after which the run writes a checkpoint and stops (Interrupted), to be resumed.
    longest : float
        Seconds that the run may take in all, to judge by its present pace; it stops likewise.
    """

    path: Path
    resume: bool = False
    force: bool = False
    checkpoint_seconds: float = 15.0
    stop_after: float | None = None
    longest: float = LONGEST_RUN

    def check(self) -> None:
        """Refuse, before anything is computed, what cannot become this run's folder.

        Raises
        ------
        InputError
            If the path is a file, cannot be written, holds something already, or is to be resumed and
            holds no run.
        """
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

    def check_same(self, run: Mapping[str, Any], scene: Mapping[str, Any]) -> None:
        """Refuse, before a flow is looked for, to resume what is another run even without it.

        `run` and `scene` as in `claimed`; what `run` tells of the flow is left out.
        """
        if self.resume and exists(self.path / RUN_FILE):
            self._require_same({"run": run, "scene": scene}, but=("flow_digest",))

    @contextmanager
    def claimed(
        self, run: Mapping[str, Any], scene: Mapping[str, Any], flow: FlowField | None = None
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
        self.path.mkdir(parents=True, exist_ok=True)
        handle = os.open(self.path, os.O_RDONLY)
        try:
            _lock(handle, self.path)
            self.check()
            for half in halves(self.path, _FILES):
                half.unlink()  # a killed run's: nobody else writes here now
            if self.resume and exists(self.path / RUN_FILE):
                self._require_same({"run": run, "scene": scene})
            else:
                self._begin({"run": run, "versions": _versions(), "scene": scene})
            # After run.toml: a run that is killed in between gets it when it is resumed.
            if flow is not None and not exists(self.path / FLOW_FILE):
                flow.save(self.path / FLOW_FILE)
            yield
        finally:
            os.close(handle)  # and with it the lock, which a kill releases as well

    def _begin(self, table: Mapping[str, Any]) -> None:
        for name in _FILES[1:]:
            (self.path / name).unlink(missing_ok=True)
        with whole_file(self.path / RUN_FILE) as file:
            file.write_text(table_to_toml(table), encoding="utf-8")

    def _require_same(self, wanted: Mapping[str, Any], but: tuple[str, ...] = ()) -> None:
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
        """result.nc."""
        return self.path / RESULT_FILE

    def save(self, arrays: Arrays) -> None:
        """Write a checkpoint; the one before stays until it is whole."""
        meta = json.dumps({"format": _FORMAT, "package": version("ellipsoid_coupling")})
        write_arrays(self.path / CHECKPOINT_FILE, {"meta": np.array(meta), **arrays})

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
        # Stored as it is, what a checkpoint holds is less than its file; what is packed is not ours.
        size = min(file.stat().st_size, memory_limit())
        arrays = read_arrays(file, "a whole checkpoint", size)
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
        (self.path / CHECKPOINT_FILE).unlink(missing_ok=True)


class Keeper:
    """Decides when the next checkpoint is due: by its interval, and by what writing one costs."""

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


def require_free(path: Path, *, force: bool, option: str = "--out ") -> None:
    """Refuse an output folder that is a file, cannot be written, or holds something (unless forced).

    `option` is what the user named it with.

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


def read_run_file(file: Path) -> dict[str, Any]:
    """The tables of a run.toml; InputError where it is none."""
    text = read_text(file, "the run.toml of a run", MOST_SCENE_BYTES)
    return parse_toml(text, str(file))


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
