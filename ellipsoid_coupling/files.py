"""Files that are whole or not there, and files of arrays that cannot run code."""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, WriteError

Arrays = dict[str, NDArray[Any]]

# Numbers and fixed text only: an object array is a pickle, which can run code.
_KINDS = "biufU"
# What a damaged file makes the readers raise.
_DAMAGE = (
    OSError,
    ValueError,
    EOFError,
    NotImplementedError,
    RecursionError,
    MemoryError,
    zipfile.BadZipFile,
)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A name beside `path`, of the same suffix, to write to; flushed and renamed on leaving.

    The folder is made where it is missing. After an error nothing is left and an older file stays.

    Raises
    ------
    WriteError
        If it cannot be written: a full disk, no permission, a folder that has gone.
    """
    beside = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
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


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write named arrays of numbers as an .npz, stored as they are; whole or not there."""
    with whole_file(path) as beside, beside.open("wb") as file:
        np.savez(
            file, allow_pickle=False, **{k: np.asarray(a, order="C") for k, a in arrays.items()}
        )


def read_arrays(path: Path, what: str) -> Arrays:
    """Read what `write_arrays` wrote, each array checked before memory is taken for it.

    Parameters
    ----------
    what : str
        What the file is meant to be, for messages.

    Raises
    ------
    InputError
        If the file is missing, damaged (every member has a checksum), compressed, or holds anything
        but numbers and text.
    """
    try:
        if not path.is_file():
            raise ValueError("no such file")
        with zipfile.ZipFile(path) as file:
            names = [member.filename.removesuffix(".npy") for member in file.infolist()]
            if len(set(names)) != len(names):
                raise ValueError("two arrays of one name")
            return dict(zip(names, (_member(file, m) for m in file.infolist()), strict=True))
    except _DAMAGE as error:
        raise InputError(
            str(path), what, f"{error or type(error).__name__}", "Remove it, or give a whole one."
        ) from None


def _member(file: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1:
        raise ValueError(f"{member.filename}: compressed or encrypted")
    with file.open(member) as raw:
        version = npy.read_magic(raw)
        if version != (1, 0):
            raise ValueError(f"{member.filename}: version {version} of the array format")
        shape, fortran, kind = npy.read_array_header_1_0(raw)
        size = math.prod(shape) * kind.itemsize
        if kind.kind not in _KINDS or kind.hasobject or fortran:
            raise ValueError(f"{member.filename}: an array of {kind}")
        if raw.tell() + size != member.file_size:
            raise ValueError(f"{member.filename}: {member.file_size} bytes for the shape {shape}")
        return np.frombuffer(raw.read(), dtype=kind).reshape(shape).copy()
