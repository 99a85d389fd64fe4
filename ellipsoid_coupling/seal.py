"""A checksum behind a file's content, so that damage is found before a library reads it.

The HDF5 library, which reads result.nc, does not survive every damaged file. HDF5 ignores what follows
its data, so a sealed file still is a NetCDF-4 file for every other program.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.inputs import read_bytes

_MARK = b"\nellipsoid_coupling sha256 "
_LENGTH = len(_MARK) + 64 + 1


def sealed(content: bytes) -> bytes:
    """`content` and its checksum."""
    return content + _MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"


def read_sealed(path: Path, expected: str, most: int) -> bytes:
    """The content of a file that `sealed` made, at most `most` bytes; InputError for any other."""
    data = read_bytes(path, expected, most)
    content = data[:-_LENGTH]
    if not data[-_LENGTH:].startswith(_MARK):
        found = f"no checksum at the end of its {len(data)} bytes: truncated, or another file"
        raise InputError(str(path), expected, found, "Give a file that this package wrote.")
    if sealed(content) != data:
        found = "other content than its checksum says: it is damaged, or was changed"
        raise InputError(str(path), expected, found, "Take another copy, or run it again.")
    return content
