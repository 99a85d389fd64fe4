"""Open a user's files: ordinary files of a bounded size only, and a message for every failure.

A path may be a folder, a pipe without a writer, an endless device, a loop of links, or no path at all;
nothing here waits, and nothing takes more memory than its limit.
"""

from __future__ import annotations

import errno
import io
import math
import os
import re
import stat
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import in_words

# Any: the file decides the kind of numbers, and its reader checks it.
Arrays = dict[str, NDArray[Any]]

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
_PIECE = 1 << 20
# gzip writes one part; each further part costs a copy of the rest.
_MOST_GZIP_PARTS = 16
_REASONS = {
    errno.ENOENT: "no such file",
    errno.ENOTDIR: "a file where a folder of the path should be",
    errno.ELOOP: "a loop of symbolic links",
    errno.EACCES: "no permission to read it",
    errno.ENAMETOOLONG: "a name that is too long",
}
# Errors of zipfile on damaged files (RuntimeError: encrypted, NotImplementedError: not to be read).
DAMAGED = (
    OSError, ValueError, KeyError, EOFError, TypeError, RuntimeError, OverflowError, LookupError,
    struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
# The mark before each entry of an archive's list, and numpy's way of packing.
_ENTRY = b"PK\x01\x02"
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# The header of an .npy of numbers or text: magic, version 1.0, length, one literal, blanks.
_HEADER = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '([<>|=][a-zA-Z]\d{0,6})', "
    rb"'fortran_order': (True|False), 'shape': \(([\d, ]{0,200})\), \} *\n", re.DOTALL,
)  # fmt: skip


def exists(path: Path) -> bool:
    """Whether anything is there, a broken link included; False for a text that cannot be a path."""
    try:
        path.lstat()
    except (OSError, ValueError):
        return False
    return True


def is_ordinary(path: Path) -> bool:
    """Whether `path` is an ordinary file, links followed; False for a text that cannot be a path."""
    return _mode(path, stat.S_ISREG)


def is_folder(path: Path) -> bool:
    """Whether `path` is a folder, links followed; False for a text that cannot be a path."""
    return _mode(path, stat.S_ISDIR)


def _mode(path: Path, test: Callable[[int], bool]) -> bool:
    try:
        return bool(test(path.stat().st_mode))
    except (OSError, ValueError):
        return False


@contextmanager
def open_ordinary(path: Path, expected: str, most: int) -> Iterator[BinaryIO]:
    """An ordinary file of at most `most` bytes, open to read.

    Parameters
    ----------
    path : the user's path
    expected : the expected kind of file, for the message: "a scene file"

    Raises InputError for anything else: missing, a folder, a pipe, a device, too large, unreadable;
    and for an error of the system while it is read.
    """
    try:
        with _opened(path, expected) as file:
            status = os.fstat(file.fileno())
            _require_ordinary(path, expected, status.st_mode)
            if status.st_size > most:
                raise _too_large(path, expected, most)
            yield file
    except OSError as error:
        found = _REASONS.get(error.errno or 0, error.strerror or "an error of the system")
        raise InputError(str(path), expected, found, "Check the path.") from None


def _opened(path: Path, expected: str) -> BinaryIO:
    try:
        _require_ordinary(path, expected, path.stat().st_mode)
        # Not blocking: the file may have become a pipe since.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except ValueError as error:  # a zero byte in the name
        raise InputError(repr(str(path)), expected, str(error), "Correct the path.") from None
    return open(handle, "rb")  # noqa: PTH123


def read_bytes(path: Path, expected: str, most: int) -> bytes:
    """The content of an ordinary file of at most `most` bytes; raises as `open_ordinary`."""
    with open_ordinary(path, expected, most) as file:
        data = _read_at_most(file, most + 1)  # files of /proc tell no size
    if len(data) > most:
        raise _too_large(path, expected, most)
    return data


def _too_large(path: Path, expected: str, most: int) -> InputError:
    return InputError(
        str(path), f"{expected} of at most {in_words(most)}",
        f"more than {in_words(most)}", "Check that it is the right file.",
    )  # fmt: skip


def _read_at_most(file: BinaryIO, most: int) -> bytes:
    """Piece by piece: one read of `most` bytes would take that memory, whatever the file's size."""
    data = bytearray()
    while len(data) < most and (piece := file.read(min(most - len(data), _PIECE))):
        data += piece
    return bytes(data)


def _require_ordinary(path: Path, expected: str, mode: int) -> None:
    for test, name in _KINDS:
        if test(mode):
            raise InputError(str(path), expected, name, "Name an ordinary file.")


def read_text(path: Path, expected: str, most: int) -> str:
    """As `read_bytes`, decoded; InputError names the byte that is no UTF-8."""
    data = read_bytes(path, expected, most)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{path}, line {line}", f"{expected} in UTF-8",
            f"byte 0x{data[error.start]:02x} (byte {error.start} of the file)", "Save it as UTF-8.",
        ) from None  # fmt: skip


def unpack(data: bytes, path: Path, expected: str, most: int) -> bytes:
    """The contents of a gzip file, at most `most` bytes; InputError for a damaged or larger one."""
    unpacked = unpack_beginning(data, path, expected, most + 1)
    if len(unpacked) > most:
        raise InputError(
            str(path), f"{expected} of at most {in_words(most)}, unpacked",
            f"more than {in_words(most)}", "Check that it is the right file.",
        )  # fmt: skip
    return unpacked


def unpack_beginning(data: bytes, path: Path, expected: str, size: int) -> bytes:
    """The first `size` bytes of a gzip file's contents, or all; no more than that is unpacked."""
    parts, left = [], size
    for _ in range(_MOST_GZIP_PARTS):
        try:
            stream = zlib.decompressobj(wbits=31)
            part = stream.decompress(data, left)
        except zlib.error as error:
            found = f"a damaged gzip file ({error})"
            raise InputError(str(path), expected, found, "Make it again.") from None
        parts.append(part)
        left -= len(part)
        if not left or (stream.eof and not stream.unused_data):
            return b"".join(parts)
        if not stream.eof:
            raise InputError(str(path), expected, "a truncated gzip file", "Make it again.")
        data = stream.unused_data
    found = f"a gzip file of more than {_MOST_GZIP_PARTS} parts"
    raise InputError(str(path), expected, found, "Make it again.")


def read_arrays(path: Path, expected: str, most: int, members: int) -> Arrays:
    """The arrays of an .npz file: numbers and text only, nothing pickled, `most` bytes in all.

    `members` is how many arrays there may be.

    Sizes are taken from the headers and compared with the file's before any array is made.

    Raises
    ------
    InputError
        For another file, a damaged one, an array of objects, or more than `most` bytes.
    """
    data = read_bytes(path, expected, most)
    # zipfile makes an object for every entry of the list at the end, before it can be asked.
    if data.count(_ENTRY) > members:
        raise InputError(
            str(path), f"{expected} of at most {members} arrays", "more", "Make it again."
        )
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            check_members(archive, path, expected, most)
            return {
                member.filename.removesuffix(".npy"): unpacked_array(
                    archive, member, path, expected
                )
                for member in archive.infolist()
            }
    except InputError:
        raise
    except DAMAGED as error:
        found = f"{type(error).__name__}: {error}"
        remedy = "Take another copy, or make it again."
        raise InputError(str(path), expected, found, remedy) from None


def check_members(archive: zipfile.ZipFile, path: Path, expected: str, most: int) -> None:
    """InputError unless an archive holds arrays that numpy has packed, `most` bytes in all, unpacked."""
    names = [member.filename for member in archive.infolist()]
    if len(set(names)) < len(names) or not all(name.endswith(".npy") for name in names):
        raise InputError(str(path), expected, "members that are no arrays", "Make it again.")
    if not all(member.compress_type in _PACKED for member in archive.infolist()):
        raise InputError(str(path), expected, "arrays that numpy has not packed", "Make it again.")
    total = sum(member.file_size for member in archive.infolist())
    if total > most:
        raise InputError(
            str(path), f"{expected} of at most {in_words(most)}, unpacked",
            in_words(total), "Check that it is the right file.",
        )  # fmt: skip


def unpacked_array(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo, path: Path, expected: str
) -> NDArray[np.generic]:
    """One member; its header is the one line that numpy writes for plain numbers, or refused."""
    name = member.filename.removesuffix(".npy")
    # No more is unpacked than the file says it is: read() without a number would go to the end.
    with archive.open(member) as stream:
        data = stream.read(member.file_size)
    header = _HEADER.match(data)
    if header is None:
        raise InputError(
            f"{path}, array {name}", f"{expected} with plain arrays",
            "another header", "Take another copy, or make it again.",
        )  # fmt: skip
    kind, order, sizes = (part.decode("ascii") for part in header.groups())
    if "O" in kind:
        raise InputError(
            f"{path}, array {name}", "an array of numbers",
            "Python objects, which could run code", "Use only files that this package wrote.",
        )  # fmt: skip
    dtype, shape = np.dtype(kind), tuple(int(size) for size in sizes.split(",") if size.strip())
    needed, there = math.prod(shape) * dtype.itemsize, len(data) - header.end()
    if needed != there:
        raise InputError(
            f"{path}, array {name}", f"{in_words(needed)} for {kind} of shape {shape}",
            in_words(there), "Take another copy, or make it again.",
        )  # fmt: skip
    values = np.frombuffer(data, dtype, offset=header.end())
    if dtype.kind == "U":
        codes = np.frombuffer(
            data, np.dtype("u4").newbyteorder(dtype.byteorder), offset=header.end()
        )
        if codes.max(initial=0) > sys.maxunicode:
            raise InputError(
                f"{path}, array {name}", "text", "characters that do not exist",
                "Take another copy, or make it again.",
            )  # fmt: skip
    return values.reshape(shape, order="F" if order == "True" else "C").copy()


def output_folder(path: Path) -> Path:
    """A folder that can be written to, existing or not, is not made here; InputError otherwise.

    Called before anything is computed, so that a wrong --out costs nothing and leaves nothing.
    """
    text = str(path)
    try:
        if "\0" in text.encode("utf-8").decode():
            raise ValueError("a zero byte in it")
        if path.exists() and not path.is_dir():
            raise InputError(text, "a folder, or a new name", "a file", "Name another --out.")
        # exists() is False for a link to nowhere or in a circle as well.
        if not path.exists() and path.is_symlink():
            raise InputError(
                text, "a folder, or a new name", "a broken link", "Name another --out."
            )
        there = path.absolute()
        while not there.exists():
            if len(os.fsencode(there.name)) > os.pathconf("/", "PC_NAME_MAX"):
                raise InputError(text, "a folder, or a new name", "a name that is too long",
                                 "Name another --out.")  # fmt: skip
            there = there.parent
        if not there.is_dir():
            raise InputError(text, "a folder, or a new name", f"the file {there} in its path",
                             "Name another --out.")  # fmt: skip
        if not os.access(there, os.W_OK | os.X_OK, effective_ids=True):
            raise InputError(text, "a folder that can be written", f"no permission in {there}",
                             "Name another --out.")  # fmt: skip
    except (OSError, ValueError) as error:
        found = getattr(error, "strerror", None) or str(error)
        raise InputError(repr(text), "the name of a folder", found, "Name another --out.") from None
    return path
