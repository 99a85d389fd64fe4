"""Archives of arrays that are larger than what may be in memory: written and read array by array."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import in_words
from ellipsoid_coupling.files.reading import (
    DAMAGED,
    Arrays,
    check_members,
    open_ordinary,
    unpacked_array,
)
from ellipsoid_coupling.files.writing import whole_file

# The record at the end of an archive: mark, disks, entries, bytes of their list, its place, a comment.
_END = struct.Struct("<4s4H2LH")
_END_MARK, _LARGE_MARK = b"PK\x05\x06", b"PK\x06\x07"
# Bytes before that record where it continues in another one for large archives.
_LARGE = 20
# Bytes of an entry in the list, its name included.
_ENTRY_BYTES = 300


@dataclass(frozen=True)
class Archive:
    """An .npz file whose arrays are read one by one.

    Attributes
    ----------
    path : Path
    expected : str
        The expected kind of file, for messages.
    most : int
        Bytes that it may have, packed and unpacked.
    members : int
        Arrays that it may have.
    """

    path: Path
    expected: str
    most: int
    members: int

    def names(self) -> list[str]:
        """The names of its arrays; InputError where it is no such archive."""
        with self._opened() as archive:
            return [name.removesuffix(".npy") for name in archive.namelist()]

    def read(self, names: Iterable[str], most: int) -> Arrays:
        """Those arrays; nothing else of the file is unpacked.

        most : bytes of them all

        Raises
        ------
        InputError
            For another file, a damaged one, an array that it does not have, or one of objects.
        """
        found: Arrays = {}
        for name, array in self.one_by_one(names, most):
            found[name] = array
            most -= array.nbytes
        return found

    def one_by_one(self, names: Iterable[str], most: int) -> Iterator[tuple[str, NDArray[Any]]]:
        """The name and array of each; nothing else is unpacked, and none is held when the next one comes.

        most : bytes of each of them

        Raises
        ------
        InputError
            As `read`.
        """
        with self._opened() as archive:
            for name in names:
                member = archive.getinfo(f"{name}.npy")
                if member.file_size > most:
                    raise InputError(
                        str(self.path), f"{self.expected} with arrays of at most {in_words(most)}",
                        in_words(member.file_size), "Check that it is the right file.",
                    )  # fmt: skip
                yield name, unpacked_array(archive, member, self.path, self.expected)

    @contextmanager
    def _opened(self) -> Iterator[zipfile.ZipFile]:
        try:
            with open_ordinary(self.path, self.expected, self.most) as file:
                self._check_end(file)
                with zipfile.ZipFile(file) as archive:
                    check_members(archive, self.path, self.expected, self.most)
                    yield archive
        except InputError:
            raise
        except DAMAGED as error:
            found = f"{type(error).__name__}: {error}"
            remedy = "Take another copy, or make it again."
            raise InputError(str(self.path), self.expected, found, remedy) from None

    def _check_end(self, file: BinaryIO) -> None:
        """Refuse a list of contents that is too long: zipfile makes an object for each of its entries."""
        size = file.seek(0, 2)
        file.seek(max(size - _END.size - _LARGE, 0))
        tail = file.read()
        if len(tail) < _END.size:
            raise ValueError("no archive")
        mark, _, _, _, entries, listed, _, comment = _END.unpack(tail[-_END.size :])
        if mark != _END_MARK or comment or tail.startswith(_LARGE_MARK):
            raise ValueError("no plain archive")
        if entries > self.members or listed > _ENTRY_BYTES * entries:
            raise ValueError(f"more than {self.members} arrays")


def write_archive(path: Path, arrays: Iterable[tuple[str, NDArray[Any]]]) -> None:
    """Write arrays by name, packed, as they come; the file is whole or not there."""
    with whole_file(path) as scratch, zipfile.ZipFile(scratch, "w") as archive:
        for name, array in arrays:
            # Without the time of day: equal arrays make equal files.
            member = zipfile.ZipInfo(f"{name}.npy")
            member.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(member, "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asarray(array, order="C"), allow_pickle=False)
