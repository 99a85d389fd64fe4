"""Writing files completely or not at all."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import WriteError

Arrays = dict[str, NDArray[np.generic]]


def halves(folder: Path, names: Iterable[str]) -> list[Path]:
    """The incomplete files that `whole_file`, when killed, left in a folder for files of these names."""
    wanted = [
        re.compile(rf"\.{re.escape(name.stem)}\.\d+{re.escape(name.suffix)}")
        for name in map(Path, names)
    ]
    return [path for path in folder.iterdir() if any(w.fullmatch(path.name) for w in wanted)]


_forced: ContextVar[bool] = ContextVar("forced", default=True)


@contextmanager
def not_forced() -> Iterator[None]:
    """Inside, this thread's files are not forced to the disk at once, which takes milliseconds each.

    A kill still loses nothing. A power cut may: for files that can be made again.
    """
    before = _forced.set(False)
    try:
        yield
    finally:
        _forced.reset(before)


@contextmanager
def whole_file(path: Path, *, new_folder: bool = True) -> Iterator[Path]:
    """A name beside `path`, of the same suffix, to write to; flushed and renamed on leaving.

    The folder is made if it is missing, unless `new_folder` is False: a claimed folder that was removed
    must not come back without its lock. After an error nothing is left and an older file stays.

    Raises
    ------
    WriteError
        If it cannot be written: a full disk, no permission, a folder that has gone.
    """
    # A random name: no other process uses it, and nobody can have placed a link there.
    beside = path.with_name(f".{path.stem}.{secrets.randbelow(10**18)}{path.suffix}")
    try:
        if new_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        yield beside
        flush(beside)
        beside.replace(path)
        flush(path.parent)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        _remove(beside)


def cannot_write(path: Path, error: OSError) -> WriteError:
    """The words for a file that could not be written."""
    why = error.strerror or str(error)
    remedy = "Make room, give permission, or choose another --out."
    return WriteError(f"{path} could not be written: {why}. {remedy}")


def flush(path: Path) -> None:
    """Make the system write a file, or a folder's list of names, to the disk now (not: `not_forced`)."""
    if not _forced.get():
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:  # the folder is gone or read-only; the error that led here is reported
        return


def write_arrays(
    path: Path, arrays: Mapping[str, NDArray[np.generic]], *, new_folder: bool = True
) -> None:
    """Write named arrays of numbers as an .npz without compression, completely or not at all."""
    with whole_file(path, new_folder=new_folder) as beside, beside.open("wb") as file:
        np.savez(
            file, allow_pickle=False, **{k: np.asarray(a, order="C") for k, a in arrays.items()}
        )
