"""A saved flow at several times: one archive (.npz), whose coefficients are read time by time.

times (n,)  repeat  digests (n,)          and what `saved` has for one time: numbers, mask, origin, outline
coefficients_00000, coefficients_00001, ...          (ny+3, nx+3) each
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.archive import Archive, write_archive
from ellipsoid_coupling.files.limits import (
    LARGEST_NUMBER,
    MOST_FLOW_ARRAYS,
    MOST_FLOW_BYTES,
    MOST_SERIES_BYTES,
    MOST_SERIES_TIMES,
)
from ellipsoid_coupling.files.reading import Arrays
from ellipsoid_coupling.flow.saved import SavedFlow, checked_flow

Array = NDArray[np.float64]

_EXPECTED = "a flow saved at several times"
_REMEDY = "Take another copy, or make it again from its case."
_COEFFICIENTS = "coefficients_"
_INDEX = {"times": "<f8", "repeat": "|u1", "digests": "<U16"}


class SavedSeries(NamedTuple):
    """times (n,), ascending; whether they repeat; a digest each; and the flow at the first of them."""

    times: Array
    repeat: bool
    digests: tuple[str, ...]
    first: SavedFlow


def digest_of(coefficients: Array) -> str:
    """What tells the coefficients of two times apart."""
    digest = hashlib.sha256(repr(coefficients.shape).encode())
    digest.update(np.ascontiguousarray(coefficients).tobytes())
    return digest.hexdigest()[:16]


def _archive(path: Path) -> Archive:
    return Archive(path, _EXPECTED, MOST_SERIES_BYTES, MOST_SERIES_TIMES + MOST_FLOW_ARRAYS)


def _name(number: int) -> str:
    return f"{_COEFFICIENTS}{number:05d}"


def is_series(path: Path) -> bool:
    """Whether a file is a flow saved at several times; False for whatever cannot be read."""
    try:
        return "times" in _archive(path).names()
    except InputError:
        return False


def write_series(path: Path, index: dict[str, NDArray[Any]], coefficients: Iterator[Array]) -> None:
    """Write an archive; the coefficients come one by one, and what `index` holds after the last of them.

    Whoever gives them may so fill in `index` what is known at the end only.
    """

    def arrays() -> Iterator[tuple[str, NDArray[Any]]]:
        for number, one in enumerate(coefficients):
            yield _name(number), one
        yield from index.items()

    write_archive(path, arrays())


def read_index(path: Path) -> SavedSeries:
    """All of a saved series but the coefficients of later times, checked; InputError otherwise."""
    archive = _archive(path)
    names = archive.names()
    rest = [name for name in names if not name.startswith(_COEFFICIENTS)]
    file = archive.read(rest, MOST_FLOW_BYTES)
    count = len(names) - len(rest)
    times, repeat, digests = _times_in(path, file, count)
    if {_name(number) for number in range(count)} | set(rest) != set(names):
        raise InputError(str(path), "coefficients of each time", "of others", _REMEDY)
    flow = {name: array for name, array in file.items() if name not in _INDEX}
    first = archive.read([_name(0)], MOST_FLOW_BYTES)[_name(0)]
    return SavedSeries(times, repeat, digests, checked_flow(path, flow | {"coefficients": first}))


def _times_in(path: Path, file: Arrays, count: int) -> tuple[Array, bool, tuple[str, ...]]:
    kinds = {name: file[name].dtype.str if name in file else "" for name in _INDEX}
    if kinds != _INDEX:
        raise InputError(str(path), f"{_EXPECTED}: {', '.join(_INDEX)}", str(kinds), _REMEDY)
    times, repeat, digests = (file[name] for name in _INDEX)
    shapes = times.shape == digests.shape == (count,) and repeat.shape == (1,)
    if not shapes or not 2 <= count <= MOST_SERIES_TIMES:
        found = f"{times.shape} times, {digests.shape} digests and {count} arrays of coefficients"
        raise InputError(str(path), "from two times on, with coefficients each", found, _REMEDY)
    if not (np.abs(times) <= LARGEST_NUMBER).all() or not (np.diff(times) > 0.0).all():
        raise InputError(f"{path}, times", "ascending times", "others", _REMEDY)
    return times, bool(repeat[0]), tuple(str(digest) for digest in digests)


def read_coefficients(
    path: Path, numbers: Iterable[int], times: Array, digests: tuple[str, ...]
) -> Iterator[Array]:
    """The coefficients of some of the times, one by one; InputError unless they have these digests."""
    wanted = {_name(number): number for number in numbers}
    for name, found in _archive(path).one_by_one(wanted, MOST_FLOW_BYTES):
        number = wanted[name]
        yield _checked(path, found, float(times[number]), digests[number])


def _checked(path: Path, found: Array, time: float, digest: str) -> Array:
    where = f"{path}, time {time:g}"
    if found.dtype.str != "<f8" or digest_of(found) != digest:
        expected = f"the flow that was saved, digest {digest}"
        raise InputError(where, expected, "another", _REMEDY)
    if not (np.abs(found) <= LARGEST_NUMBER).all():
        raise InputError(where, "finite coefficients", "NaN, infinite or huge values", _REMEDY)
    return found
