"""Arrays of result files that are packed save time by save time: how they are written and read.

Each save time is one chunk of HDF5, its bytes shuffled (the first of all numbers, the second of all, ...)
and packed by deflate. Fields with empty parts become a half or less; positions and velocities of particles
hardly smaller, so arrays are packed only where a sample of them gets smaller. Small arrays are not: they
take as many bytes as their headers.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.files.hdf5_parts import DAMAGED, ELSEWHERE

# Bytes of an array below which it stays as it is.
LEAST_PACKED = 100_000
# Packing must save a fifth; the fastest level takes about as long as writing to a plain disk.
_WORTHWHILE, _LEVEL = 0.8, 1
# Numbers of the sample, in blocks spread over the last save time.
_BLOCKS, _BLOCK = 8, 4096
# Bytes of a save time: HDF5 has no chunks of 4 GB.
_LARGEST_CHUNK = 2**31
# No bytes packed by deflate become more than this many.
MOST_PACKED = 1032
# Filters of HDF5, and how deep the tree over the chunks may be: 64^4 save times.
_DEFLATE, _SHUFFLE = 1, 2
_DEEPEST = 4

Read = Callable[[int, int], bytes]


class Packed(NamedTuple):
    """Where an array's chunks are listed, and its rank."""

    tree: int
    rank: int


def packing(values: NDArray[Any]) -> dict[str, object]:
    """The arguments of h5py that pack an array over (time, ...); none where that is not worth it."""
    if values.ndim < 2 or not values.size or values.nbytes < LEAST_PACKED:
        return {}
    if values[0].nbytes > _LARGEST_CHUNK:
        return {}
    last = np.ascontiguousarray(values[-1]).ravel()
    starts = np.linspace(0, max(last.size - _BLOCK, 0), _BLOCKS).astype(np.int64)
    sample = np.concatenate([last[start : start + _BLOCK] for start in starts])
    shuffled = sample.view(np.uint8).reshape(-1, sample.itemsize).T.tobytes()
    if len(zlib.compress(shuffled, _LEVEL)) > _WORTHWHILE * len(shuffled):
        return {}
    return {
        "chunks": (1, *values.shape[1:]),
        "shuffle": True,
        "compression": "gzip",
        "compression_opts": _LEVEL,
    }


def packed_layout(layout: bytes, filters: bytes, shape: tuple[int, ...], itemsize: int) -> Packed:
    """Where the chunks of an array are; ValueError for any packing but that of `packing`."""
    version, kind, dimensions = layout[:3]
    rank = len(shape)
    if (version, kind, dimensions) != (3, 2, rank + 1) or rank < 2:
        raise ValueError(f"an array {ELSEWHERE}")
    tree, *chunk = struct.unpack_from(f"<Q{rank + 1}I", layout, 3)
    if tuple(chunk) != (1, *shape[1:], itemsize):
        raise ValueError(f"an array {ELSEWHERE}")
    if [*_filters(filters)] not in (
        [(_SHUFFLE, itemsize), (_DEFLATE, level)] for level in range(10)
    ):
        raise ValueError(f"an array {ELSEWHERE}")
    return Packed(tree, rank)


def _filters(message: bytes) -> Iterator[tuple[int, int]]:
    """Each filter and its one value."""
    version, count = message[:2]
    if version != 1 or count != 2:
        raise ValueError(f"an array {ELSEWHERE}")
    at = 8
    for _ in range(count):
        number, length, _flags, values = struct.unpack_from("<HHHH", message, at)
        at += 8 + length
        yield number, struct.unpack_from("<I", message, at)[0] if values == 1 else -1
        # Values are filled up to a multiple of 8 bytes.
        at += 4 * (values + values % 2)


def read_packed(
    packed: Packed, read: Read, read_chunk: Read, values: NDArray[np.generic]
) -> NDArray[np.generic]:
    """The numbers of a packed array, into `values`, all of them; ValueError where some are missing.

    read, read_chunk : (address, count) -> bytes of the file; the first ones are counted
    """
    missing = set(range(values.shape[0]))
    for time, address, size in _chunks(packed, read, packed.tree, _DEEPEST):
        if time not in missing:
            raise ValueError(DAMAGED)
        missing.remove(time)
        values[time] = _unpacked(read_chunk(address, size), values[time])
    if missing:
        raise ValueError(DAMAGED)
    return values


def _chunks(packed: Packed, read: Read, node: int, depth: int) -> Iterator[tuple[int, int, int]]:
    """(save time, address, bytes) of the chunks below a node of HDF5's tree of chunks."""
    lead = read(node, 24)
    level, count = lead[5], struct.unpack_from("<H", lead, 6)[0]
    if not lead.startswith(b"TREE\x01") or level >= depth:
        raise ValueError(DAMAGED)
    entry = struct.Struct(f"<II{packed.rank + 1}QQ")
    for fields in entry.iter_unpack(read(node + 24, count * entry.size)):
        size, left_out, time, *others, address = fields
        if level:
            yield from _chunks(packed, read, address, level)
        elif left_out or any(others):
            raise ValueError(DAMAGED)
        else:
            yield time, address, size


def _unpacked(data: bytes, like: NDArray[np.generic]) -> NDArray[np.generic]:
    """The numbers of a chunk, which has as many bytes as `like`."""
    unpacking, count = zlib.decompressobj(), math.prod(like.shape) * like.itemsize
    try:
        raw = unpacking.decompress(data, count + 1)
    except zlib.error as error:
        raise ValueError(DAMAGED) from error
    if len(raw) != count or not unpacking.eof:
        raise ValueError(DAMAGED)
    ordered = np.frombuffer(raw, np.uint8).reshape(like.itemsize, -1).T
    return np.ascontiguousarray(ordered).view(like.dtype).reshape(like.shape)
