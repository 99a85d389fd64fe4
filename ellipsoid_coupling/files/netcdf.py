"""result.nc as a file: written without a copy in memory, and read without trust.

The HDF5 library writes the file and never reads it, see `hdf5`.
"""

from __future__ import annotations

import io
import math
import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files import pieces
from ellipsoid_coupling.files.checksum import append_seal, open_sealed
from ellipsoid_coupling.files.hdf5 import Reader
from ellipsoid_coupling.files.limits import MOST_SCENE_BYTES, memory_left, memory_limit

if TYPE_CHECKING:
    import xarray as xr
    from _typeshed import ReadableBuffer, WriteableBuffer

_EXPECTED = "a result file"
_REMEDY = "Give a result.nc that this package wrote."

# Attributes that other programs need; they are not read.
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

    # Any: the file decides the kinds of values, and `Result` checks them.
    attributes: dict[str, Any]
    arrays: dict[str, NDArray[Any]]
    sizes: dict[str, int]


def write_netcdf(data: xr.Dataset, path: Path, empty: NDArray[np.bool_] | None = None) -> None:
    """Write a data set of numbers and texts as NetCDF-4 with a checksum behind it.

    Arrays go to the disk without a copy, or with that of one save time. The HDF5 library crashes on a full
    disk, so write errors are kept from it and raised as OSError when it is done.

    h5py's plain calls write a small result in 6 ms of CPU time; h5netcdf, which asks the file again and
    again for what it has just got, takes 30 ms.

    Parameters
    ----------
    data : xarray.Dataset
        Arrays over time that pack well are packed, save time by save time.
    path : Path
    empty : array, optional
        Where variables with a `_FillValue`, of its shape, hold nothing: NaN in the file.
    """
    import h5py

    with path.open("w+b") as file:
        target = _Forgiving(file)
        try:
            # `read_netcdf` reads the oldest format only.
            with h5py.File(target, "w", libver="earliest", track_order=True) as made:
                versions = f"h5py={h5py.__version__},hdf5={h5py.version.hdf5_version}"
                _put(made, "_NCProperties", np.bytes_(f"version=2,{versions}"))
                _write(made, data, empty)
        finally:
            if target.fault is not None:
                raise target.fault
    append_seal(path)


def _write(made: Any, data: xr.Dataset, empty: NDArray[np.bool_] | None) -> None:
    """Dimensions as HDF5's scales, then the variables over them, as NetCDF-4 wants them."""
    from h5py import h5ds

    _describe(made, data.attrs)
    numbers = {str(name): number for number, name in enumerate(data.sizes)}
    scales = {}
    for name, number in numbers.items():
        if name in data.variables:
            scales[name], text = _create(made, name, data.variables[name]), name
        else:
            size = data.sizes[name]
            scales[name] = made.create_dataset(name, (size,), dtype=">f4", track_order=True)
            # The words by which NetCDF tells it from a variable.
            text = f"This is a netCDF dimension but not a netCDF variable. {size:9d}"
        h5ds.set_scale(scales[name].id, text.encode())
        _put(scales[name], "_Netcdf4Dimid", np.int32(number))
    for key, variable in data.variables.items():
        if key in numbers:
            continue
        stored = _create(made, str(key), variable, empty)
        for axis, dimension in enumerate(map(str, variable.dims)):
            h5ds.attach_scale(stored.id, scales[dimension].id, axis)
        places = [numbers[str(dimension)] for dimension in variable.dims]
        _put(stored, "_Netcdf4Coordinates", np.array(places, np.int32))
        _put(stored, "_Netcdf4Dimid", np.int32(places[0]))


def _create(
    made: Any, name: str, variable: xr.Variable, empty: NDArray[np.bool_] | None = None
) -> Any:
    """An array with its attributes; objects are texts."""
    import h5py

    kind = h5py.string_dtype() if variable.dtype == object else variable.dtype
    blank = empty if "_FillValue" in variable.attrs else None
    packing = pieces.packing(variable.values) if variable.dims[:1] == ("time",) else {}
    if blank is None and not packing:
        # At once: h5py looks longer for the place of a part than it writes a small array.
        stored = made.create_dataset(name, data=variable.values, dtype=kind, track_order=True)
    else:
        stored = made.create_dataset(name, variable.shape, dtype=kind, track_order=True, **packing)
        for time, values in enumerate(variable.values):
            stored[time] = values if blank is None else np.where(blank[time], np.nan, values)
    _describe(stored, variable.attrs)
    return stored


def _describe(stored: Any, attributes: Mapping[Any, Any]) -> None:
    import h5py

    for name, value in attributes.items():
        text = isinstance(value, str)
        _put(
            stored,
            str(name),
            np.array(value, h5py.string_dtype()) if text else np.atleast_1d(value),
        )


def _put(stored: Any, name: str, value: NDArray[Any] | np.generic) -> None:
    """A new attribute; h5py's `attrs` would make it under another name and rename it."""
    from h5py import h5a, h5s

    array = np.asarray(value)
    space = h5s.create_simple(array.shape) if array.ndim else h5s.create(h5s.SCALAR)
    kind = _kind_of(array.dtype)
    h5a.create(stored.id, name.encode(), kind, space).write(array)


@cache
def _kind_of(dtype: np.dtype[Any]) -> Any:
    """HDF5's type for numbers or texts; made once, which takes as long as to write an attribute."""
    from h5py import h5t

    return h5t.py_create(dtype, logical=True)


def read_netcdf(path: Path) -> Stored:
    """The attributes and arrays of a file that `write_netcdf` made.

    Raises
    ------
    InputError
        For any other file: without its checksum, with links, references to other files, filters,
        named or compound types, or more numbers than it has bytes for.
    """
    with open_sealed(path, _EXPECTED, memory_limit()) as (file, size):
        try:
            opened = Reader(file, size)
            sizes, arrays = _read_objects(opened, size)
            return Stored(_attributes(opened), arrays, sizes)
        except (ValueError, IndexError, struct.error) as error:
            found = str(error) if type(error) is ValueError else "a damaged file"
            raise InputError(str(path), _EXPECTED, found, _REMEDY) from None


def _read_objects(
    opened: Reader, size: int
) -> tuple[dict[str, int], dict[str, NDArray[np.generic]]]:
    """Every array of the file; all sizes are checked before the first array is read."""
    variables = opened.variables()
    plain = sum(v.length for v in variables.values() if v.packed is None)
    if plain > size:
        raise ValueError(f"{plain} bytes of numbers in a file of {size} bytes")
    packed = sum(v.length for v in variables.values() if v.packed is not None)
    # Read one after another into memory that is not given back.
    if packed > min(pieces.MOST_PACKED * size, memory_left() if packed else 0):
        raise ValueError(f"{packed} bytes of packed numbers in a file of {size} bytes")
    sizes = {name: v.shape[0] for name, v in variables.items() if len(v.shape) == 1}
    # A dimension without a coordinate has no numbers.
    with_numbers = {
        name: v for name, v in variables.items() if v.has_numbers or not math.prod(v.shape)
    }
    return sizes, {name: opened.numbers(variable) for name, variable in with_numbers.items()}


def _attributes(opened: Reader) -> dict[str, Any]:
    """Attributes as Python values: a single value, or a list of several."""
    attributes = dict[str, Any]()
    for name, values in opened.attributes(_NOT_READ):
        if name in attributes:
            raise ValueError(f"two attributes {name}")
        _check_texts(name, values)
        attributes[name] = values[0] if len(values) == 1 else values
    return attributes


def _check_texts(name: str, values: list[object]) -> None:
    for text in values:
        if isinstance(text, str) and not text.replace("\n", "").isprintable() and text:
            raise ValueError(f"attribute {name} with characters that are not printable")
        if isinstance(text, str) and len(text.encode("utf-8")) > MOST_SCENE_BYTES:
            raise ValueError(f"attribute {name} of {len(text)} characters")


class _Forgiving(io.RawIOBase):
    """A file to write to that stores its first error instead of raising it."""

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

    def readinto(self, buffer: WriteableBuffer) -> int:
        """All of it: zeros beyond the end."""
        view = memoryview(buffer).cast("B")
        read = os.preadv(self._handle, [view], self._place)
        view[read:] = bytes(len(view) - read)
        self._place += len(view)
        return len(view)

    def write(self, buffer: ReadableBuffer) -> int:
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
