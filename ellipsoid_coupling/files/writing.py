"""Files that are whole or not there."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import WriteError

Arrays = dict[str, NDArray[Any]]


def halves(folder: Path, names: Iterable[str]) -> list[Path]:
    """What `whole_file` was writing in a folder for files of these names when it was killed."""
    wanted = [
        re.compile(rf"\.{re.escape(name.stem)}\.\d+{re.escape(name.suffix)}")
        for name in map(Path, names)
    ]
    return [path for path in folder.iterdir() if any(w.fullmatch(path.name) for w in wanted)]


@contextmanager
def whole_file(path: Path, *, new_folder: bool = True) -> Iterator[Path]:
    """A name beside `path`, of the same suffix, to write to; flushed and renamed on leaving.

    The folder is made where it is missing, unless `new_folder` is False: what was claimed and then
    removed must not come back unclaimed. After an error nothing is left and an older file stays.

    Raises
    ------
    WriteError
        If it cannot be written: a full disk, no permission, a folder that has gone.
    """
    # Nobody else's, whatever the process ids, and no name at which a link could have been laid.
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
    """Make the system write a file, or a folder's list of names, to the disk now."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:  # its folder has gone or turned read-only: what led here is being told
        return


def write_arrays(
    path: Path, arrays: Mapping[str, NDArray[Any]], *, new_folder: bool = True
) -> None:
    """Write named arrays of numbers as an .npz, stored as they are; whole or not there."""
    with whole_file(path, new_folder=new_folder) as beside, beside.open("wb") as file:
        np.savez(
            file, allow_pickle=False, **{k: np.asarray(a, order="C") for k, a in arrays.items()}
        )
