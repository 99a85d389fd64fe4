"""result.nc as a file: written without a copy in memory, and read without trust.

The HDF5 library follows what a file says: to other files, pipes and plugins, into arrays of any size,
round and round a damaged heap. So little of it is asked: what a file holds is compared first with what
this package writes, which are arrays of numbers, stored in one piece each, and attributes of text and
numbers, all in the file's root. References, which only other programs need, are never read.
"""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.limits import MOST_SCENE_BYTES, memory_limit
from ellipsoid_coupling.seal import append_seal, open_sealed

if TYPE_CHECKING:
    import h5py
    import xarray as xr

_EXPECTED = "a result file"
_REMEDY = "Give a result.nc that this package wrote."

# A result has some 10 variables and 30 attributes; the scene's text is the longest of these.
_MOST_OBJECTS, _MOST_ATTRIBUTES, _MOST_RANK, _MOST_VALUES = 50, 200, 4, 1000
# HDF5 reads some 100 pieces of a result, besides the arrays; one that loops reads without end.
_MOST_READS = 20_000
_LARGEST_HEAP = 16 * MOST_SCENE_BYTES
# Names other programs need; what they hold is not read.
_NOT_READ = ("_NCProperties", "_nc3_strict")


@dataclass(frozen=True)
class Stored:
    """What a result file holds.

    Attributes
    ----------
    attributes : dict of str, number or list
        Of the whole file; text without control characters.
    arrays : dict of array
        The numbers of every variable.
    sizes : dict of int
        The extent of every dimension, with or without numbers of its own.
    """

    attributes: dict[str, Any]
    arrays: dict[str, NDArray[Any]]
    sizes: dict[str, int]


def write_netcdf(data: xr.Dataset, path: Path) -> None:
    """Write a data set as NetCDF-4 with a checksum behind it.

    Arrays go to the disk as they are. The HDF5 library does not survive a full disk, so it hears of
    none; OSError comes when it is done.
    """
    import h5netcdf

    with path.open("w+b") as file:
        target = _Forgiving(file)
        try:
            # The oldest format is the one that `read_netcdf` knows.
            with h5netcdf.File(target, "w", libver="earliest") as made:
                made.dimensions = {str(name): size for name, size in data.sizes.items()}
                made.attrs.update(data.attrs)
                for name, variable in data.variables.items():
                    dimensions = tuple(map(str, variable.dims))
                    stored = made.create_variable(str(name), dimensions, data=variable.values)
                    stored.attrs.update(variable.attrs)
        finally:
            if target.fault is not None:
                raise target.fault
    append_seal(path)


def read_netcdf(path: Path) -> Stored:
    """The attributes and arrays of a file that `write_netcdf` made.

    Raises
    ------
    InputError
        For any other file: without its checksum, with links, references to other files, filters,
        named or compound types, or more numbers than it has bytes for.
    """
    import h5py

    with open_sealed(path, _EXPECTED, memory_limit()) as (file, size):
        try:
            with h5py.File(_Watched(file, size), "r") as opened:
                sizes, arrays = _read_objects(opened, size)
                return Stored(dict(_attributes(opened)), arrays, sizes)
        except (OSError, ValueError, KeyError, TypeError, RuntimeError, OverflowError) as error:
            # What HDF5 finds is told with its call stack behind it.
            found = str(error).splitlines()[0] if str(error) else "a damaged file"
            raise InputError(str(path), _EXPECTED, found, _REMEDY) from None


def _read_objects(
    opened: h5py.File, size: int
) -> tuple[dict[str, int], dict[str, NDArray[np.generic]]]:
    """Every array of the file; all are looked at before the first is read."""
    found = {name: _checked(opened, name) for name in _names(opened)}
    needed = sum(
        dataset.size * dataset.dtype.itemsize for dataset in found.values() if _held(dataset)
    )
    if needed > size:
        raise ValueError(f"{needed} bytes of numbers in a file of {size} bytes")
    sizes = {name: int(d.shape[0]) for name, d in found.items() if len(d.shape) == 1}
    return sizes, {name: np.asarray(d[...]) for name, d in found.items() if _held(d)}


def _held(dataset: h5py.Dataset) -> bool:
    """Whether there are numbers; a dimension without a coordinate has none."""
    return bool(dataset.size == 0 or dataset.id.get_storage_size() > 0)


def _names(opened: h5py.File) -> list[str]:
    import h5py

    group = opened.id
    if group.get_num_objs() > _MOST_OBJECTS:
        raise ValueError(f"more than {_MOST_OBJECTS} variables")
    names = [raw.decode("utf-8") for raw in group]
    for name in names:
        if not name.isprintable():
            raise ValueError(f"a variable named {name!a}")
        kind = group.links.get_info(name.encode()).type
        if kind != h5py.h5l.TYPE_HARD:
            raise ValueError(f"{name} as a link to something else")
    return names


def _checked(opened: h5py.File, name: str) -> h5py.Dataset:
    """A variable that is an array of numbers in one piece of this file; ValueError for others."""
    import h5py

    part = h5py.h5o.open(opened.id, name.encode())
    if not isinstance(part, h5py.h5d.DatasetID):
        raise ValueError(f"{name} as a group or a type, not a variable")
    # Looked at before the space: that of a virtual array opens other files.
    made = part.get_create_plist()
    layout = made.get_layout()
    # A dimension of no length can grow, for HDF5: its arrays are made for pieces, and have none.
    empty = layout == h5py.h5d.CHUNKED and not part.get_storage_size()
    whole = layout == h5py.h5d.CONTIGUOUS or empty
    if not whole or made.get_external_count() or made.get_nfilters():
        raise ValueError(f"{name} in pieces, packed, or in another file")
    kind, space = part.get_type(), part.get_space()
    if kind.committed() or not isinstance(kind, h5py.h5t.TypeIntegerID | h5py.h5t.TypeFloatID):
        raise ValueError(f"{name} of a type that is no plain number")
    if kind.get_size() > 8 or space.get_simple_extent_type() != h5py.h5s.SIMPLE:
        raise ValueError(f"{name} of a type or shape that no result has")
    shape = space.get_simple_extent_dims()
    stored = part.get_storage_size()
    if len(shape) > _MOST_RANK or (stored and stored != math.prod(shape) * kind.get_size()):
        raise ValueError(f"{name} of shape {shape} in {stored} bytes")
    if not stored and (len(shape) > 1 or empty) and math.prod(shape):
        raise ValueError(f"{name} of shape {shape} without numbers")
    return h5py.Dataset(part)


def _attributes(opened: h5py.File) -> Iterator[tuple[str, Any]]:
    import h5py

    count = h5py.h5a.get_num_attrs(opened.id)
    if count > _MOST_ATTRIBUTES:
        raise ValueError(f"{count} attributes")
    for index in range(count):
        attribute = h5py.h5a.open(opened.id, index=index)
        name = attribute.name.decode("utf-8")
        if name not in _NOT_READ:
            _check_attribute(name, attribute)
            yield name, _plain(name, opened.attrs[name])


def _check_attribute(name: str, attribute: Any) -> None:
    """ValueError unless it is text or numbers, few of them."""
    import h5py

    kind, shape = attribute.get_type(), attribute.shape
    plain = (h5py.h5t.TypeIntegerID, h5py.h5t.TypeFloatID, h5py.h5t.TypeStringID)
    if not name.isprintable() or kind.committed() or not isinstance(kind, plain):
        raise ValueError(f"attribute {name!a} of a type that is no text and no plain number")
    if math.prod(shape) > _MOST_VALUES or kind.get_size() > MOST_SCENE_BYTES:
        raise ValueError(f"attribute {name} of shape {shape}")
    if attribute.get_space().get_simple_extent_type() == h5py.h5s.NULL:
        raise ValueError(f"attribute {name} without a value")


def _plain(name: str, value: Any) -> Any:
    """A value as Python's own: one of a single one is that one, more are a list."""
    values = np.asarray(value).reshape(-1).tolist()
    values = [v.decode("utf-8") if isinstance(v, bytes) else v for v in values]
    for text in values:
        if isinstance(text, str) and not text.replace("\n", "").isprintable() and text:
            raise ValueError(f"attribute {name} with characters that are not printable")
        if isinstance(text, str) and len(text.encode("utf-8")) > MOST_SCENE_BYTES:
            raise ValueError(f"attribute {name} of {len(text)} characters")
    return values[0] if len(values) == 1 else values


class _Forgiving(io.RawIOBase):
    """A file to write to that keeps its first fault to itself."""

    def __init__(self, file: BinaryIO) -> None:
        self._handle, self._place = file.fileno(), 0
        self.fault: OSError | None = None

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As of any file."""
        start = {os.SEEK_CUR: self._place, os.SEEK_END: os.fstat(self._handle).st_size}
        self._place = offset + start.get(whence, 0)
        return self._place

    def tell(self) -> int:
        """As of any file."""
        return self._place

    def readinto(self, buffer: Any) -> int:
        """All of it: zeros beyond the end."""
        view = memoryview(buffer).cast("B")
        read = os.preadv(self._handle, [view], self._place)
        view[read:] = bytes(len(view) - read)
        self._place += len(view)
        return len(view)

    def write(self, buffer: Any) -> int:
        """All of it, or nothing after a fault."""
        view = memoryview(buffer).cast("B")
        written = 0
        try:
            while self.fault is None and written < len(view):
                written += os.pwrite(self._handle, view[written:], self._place + written)
        except OSError as error:
            self.fault = error
        self._place += len(view)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """As of any file."""
        size = self._place if size is None else size
        try:
            os.ftruncate(self._handle, size)
        except OSError as error:
            self.fault = self.fault or error
        return size


class _Watched(io.RawIOBase):
    """The content of a file to read, which ends what HDF5 would never end."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._handle, self._size, self._place, self._reads = file.fileno(), size, 0, 0

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """As of any file."""
        start = {os.SEEK_CUR: self._place, os.SEEK_END: self._size}
        self._place = offset + start.get(whence, 0)
        return self._place

    def tell(self) -> int:
        """As of any file."""
        return self._place

    def readinto(self, buffer: Any) -> int:
        """All of it; OSError beyond the end, at a damaged heap, or after very many calls."""
        view = memoryview(buffer).cast("B")
        self._reads += 1
        if self._place + len(view) > self._size or self._reads > _MOST_READS:
            raise OSError("a damaged file: parts beyond its end, or that lead in a circle")
        read = 0
        while read < len(view) and (
            more := os.preadv(self._handle, [view[read:]], self._place + read)
        ):
            read += more
        if read < len(view):
            raise OSError("a file that has become shorter")
        if view[:4].tobytes() == b"GCOL":
            _check_heap(view)
        self._place += read
        return read


def _check_heap(heap: memoryview) -> None:
    """OSError unless a heap of text is whole: HDF5 goes round for ever in one that is not.

    16 bytes of lead, the last 8 its size; then parts with 16 bytes of lead each: index (2), count (2),
    4 zeros, size (8). Index 0 is the free rest.
    """
    size = int.from_bytes(heap[8:16], "little")
    fault = OSError("a damaged file: text that overlaps")
    if heap[4] != 1 or not 16 <= size <= _LARGEST_HEAP:
        raise fault
    place, end, seen = 16, min(size, len(heap)), set[int]()
    while place + 16 <= end:
        index = int.from_bytes(heap[place : place + 2], "little")
        length = int.from_bytes(heap[place + 8 : place + 16], "little")
        if index == 0:
            if place + length != size:
                raise fault
            return
        if index in seen:
            raise fault
        seen.add(index)
        place += 16 + (length + 7) // 8 * 8
        if place > size:
            raise fault
