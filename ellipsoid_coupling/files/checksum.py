"""A checksum behind a file's content, so that damage is found before a library reads it.

The HDF5 library, with which other programs read result.nc, crashes on some damaged files. It ignores
bytes behind its data, so a sealed file still is a NetCDF-4 file for every other program.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.reading import open_ordinary

_MARK = b"\nellipsoid_coupling sha256 "
_LENGTH = len(_MARK) + 64 + 1
_PIECE = 1 << 20


def sealed(content: bytes) -> bytes:
    """`content` and its checksum."""
    return content + _seal(hashlib.sha256(content).hexdigest())


def append_seal(path: Path) -> None:
    """Put the checksum of a file behind it; OSError where it cannot be read or written."""
    with path.open("r+b") as file:
        digest = _digest(file, file.seek(0, 2))
        file.seek(0, 2)
        file.write(_seal(digest))


@contextmanager
def open_sealed(path: Path, expected: str, most: int) -> Iterator[tuple[BinaryIO, int]]:
    """A file that was sealed, open to read, and the size of its content, at most `most` bytes.

    Read piece by piece: a file of any size takes no memory here.

    Raises
    ------
    InputError
        For any other file: missing, no ordinary one, too large, without or with another checksum.
    """
    with open_ordinary(path, expected, most) as file:
        size = file.seek(0, 2)
        content = max(size - _LENGTH, 0)
        file.seek(content)
        end = file.read(_LENGTH)
        if not end.startswith(_MARK):
            found = f"no checksum at the end of its {size} bytes: truncated, or another file"
            raise InputError(str(path), expected, found, "Give a file that this package wrote.")
        if end != _seal(_digest(file, content)):
            found = "other content than its checksum says: it is damaged, or was changed"
            raise InputError(str(path), expected, found, "Take another copy, or run it again.")
        yield file, content


def _seal(digest: str) -> bytes:
    return _MARK + digest.encode() + b"\n"


def _digest(file: BinaryIO, size: int) -> str:
    """The checksum of the first `size` bytes."""
    digest = hashlib.sha256()
    file.seek(0)
    while size > 0 and (piece := file.read(min(size, _PIECE))):
        digest.update(piece)
        size -= len(piece)
    return digest.hexdigest()
