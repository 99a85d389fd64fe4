"""A strict reader of the HDF5 files that this package writes, and of no others.

The HDF5 library follows every reference of a file: to other files and pipes, into arrays and texts of any
size, and endlessly round a damaged heap. So it never reads a file from elsewhere. This reader accepts
arrays of plain numbers, in one piece each or packed by save times (`pieces`), and attributes of text and
numbers, all in the root group; everything else is a ValueError. Sizes are compared with the file before
anything is read, and the bytes read besides arrays have a limit, which also ends every cycle. References
and attributes of arrays are ignored; the file's checksum is `checksum`'s.

The format is described in "HDF5 File Format Specification Version 3.0". In short: a superblock names
the root's header; a header is a list of messages; many links or attributes of one header lie in a heap
with a B-tree over it; texts lie in collections, the global heaps.
"""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from itertools import chain
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.files.hdf5_parts import (
    ATTRIBUTE,
    ATTRIBUTES,
    DAMAGED,
    ELSEWHERE,
    FILTERS,
    LAYOUT,
    LINK,
    LINKS,
    NEXT,
    PASSED_OVER,
    SHARED,
    SPACE,
    TYPE,
    Message,
    attribute_of,
    collection,
    link_of,
    messages_in,
    number_type,
    only,
    shape_of,
    whole,
    width_of,
)
from ellipsoid_coupling.files.pieces import Packed, packed_layout, read_packed

# A result has some 10 variables and 30 attributes; the scene's text is the longest of these.
_MOST_OBJECTS, _MOST_ATTRIBUTES, _MOST_RANK, _MOST_VALUES = 50, 250, 4, 1000
_MOST_MESSAGES = 1000
# Bytes that may be read besides arrays, and the bytes added for each read.
_MOST_READ, _EACH_READ = 20_000_000, 100

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# Versions 0 all over, then 8 bytes for an address and a length.
_OLDEST = bytes(5) + b"\x08\x08\x00"
_NOWHERE = 2**64 - 1


class Variable(NamedTuple):
    """An array: where its numbers lie, None where it has none of its own."""

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    address: int | None
    packed: Packed | None = None

    @property
    def has_numbers(self) -> bool:
        """Whether the file has numbers of it."""
        return self.address is not None or self.packed is not None

    @property
    def length(self) -> int:
        """The bytes that it takes from the file, unpacked."""
        return math.prod(self.shape) * self.dtype.itemsize if self.has_numbers else 0


class Reader:
    """A file of `size` bytes; every method raises ValueError for what this package does not write."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._handle, self._size, self._left = file.fileno(), size, _MOST_READ
        self._left_packed = size
        self._texts: dict[int, dict[int, bytes]] = {}
        lead = self._read(0, 96)
        if lead[:16] != _SIGNATURE + _OLDEST or lead[24:32] != bytes(8):
            raise ValueError("no HDF5 file of the oldest format")
        self._root = self._header(whole(lead[64:72]))

    def variables(self) -> dict[str, Variable]:
        """The root's arrays."""
        variables = dict[str, Variable]()
        for name, address in self._links():
            if len(variables) == _MOST_OBJECTS:
                raise ValueError(f"more than {_MOST_OBJECTS} variables")
            if name in variables:
                raise ValueError(f"two variables {name}")
            variables[name] = self._variable(name, address)
        return variables

    def numbers(self, variable: Variable) -> NDArray[np.generic]:
        """An array's numbers."""
        values = np.zeros(variable.shape, variable.dtype)
        if variable.packed is not None:
            return read_packed(variable.packed, self._read, self._read_chunk, values)
        raw, done = values.reshape(-1).view(np.uint8).data, 0
        while done < variable.length and variable.address is not None:
            read = os.preadv(self._handle, [raw[done:]], variable.address + done)
            if not read:
                raise ValueError("a file that has become shorter")
            done += read
        return values

    def attributes(self, but: tuple[str, ...]) -> Iterator[tuple[str, list[object]]]:
        """The root's attributes and their values; `but` those of these names, which are not read."""
        dense = self._dense(ATTRIBUTES, 8)
        own = (message.data for message in self._root if message.kind == ATTRIBUTE)
        for count, data in enumerate(chain(own, dense)):
            if count == _MOST_ATTRIBUTES:
                raise ValueError(f"more than {_MOST_ATTRIBUTES} attributes")
            name, kind, space, values = attribute_of(data)
            if name not in but:
                yield name, self._values(name, kind, space, values)

    def _read(self, at: int, count: int) -> bytes:
        """`count` bytes from `at` on, all of them."""
        self._left -= count + _EACH_READ
        return self._counted(at, count, self._left)

    def _read_chunk(self, at: int, count: int) -> bytes:
        """As `_read`, of packed numbers: all of them take no more than the file."""
        self._left_packed -= count
        return self._counted(at, count, self._left_packed)

    def _counted(self, at: int, count: int, left: int) -> bytes:
        if count < 0 or at + count > self._size or left < 0:
            raise ValueError(DAMAGED)
        data = os.pread(self._handle, count, at)
        if len(data) < count:
            raise ValueError("a file that has become shorter")
        return data

    def _block(self, at: int, mark: bytes, count: int) -> bytes:
        """As `_read`, for a block that begins with this mark and version 0."""
        data = self._read(at, count)
        if not data.startswith(mark):
            raise ValueError(DAMAGED)
        return data

    def _header(self, at: int) -> list[Message]:
        """The messages of a header, which may go on elsewhere."""
        lead = self._read(at, 6)
        if not lead.startswith(b"OHDR\x02"):
            raise ValueError("a part that another program wrote, or a damaged one")
        flags = lead[5]
        start = at + 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
        width = 1 << (flags & 3)
        length = whole(self._read(start, width))
        pieces, messages = [self._read(start + width, length)], list[Message]()
        while pieces:
            for message in messages_in(pieces.pop(), 6 if flags & 4 else 4):
                if message.kind == NEXT:
                    address, size = struct.unpack_from("<QQ", message.data)
                    pieces.append(self._block(address, b"OCHK", size)[4:-4])
                else:
                    messages.append(message)
                if len(messages) > _MOST_MESSAGES:
                    raise ValueError(f"more than {_MOST_MESSAGES} parts of one variable")
        return messages

    def _links(self) -> Iterator[tuple[str, int]]:
        """Names and addresses of the objects in the root group."""
        dense = self._dense(LINKS, 5)
        own = (message.data for message in self._root if message.kind == LINK)
        for data in chain(own, dense):
            yield link_of(data)

    def _dense(self, kind: int, tree_type: int) -> Iterator[bytes]:
        """The objects in the root's heap of this kind, links (5) or attributes (8)."""
        for message in self._root:
            if message.kind == kind:
                counted = (8 if kind == LINKS else 2) if message.data[1] & 1 else 0
                heap, tree = struct.unpack_from("<QQ", message.data, 2 + counted)
                if heap != _NOWHERE:
                    yield from self._in_heap(heap, tree, tree_type)

    def _in_heap(self, heap: int, tree: int, tree_type: int) -> Iterator[bytes]:
        lead = self._block(heap, b"FRHP\x00", 142)
        id_bytes, filters = struct.unpack_from("<HH", lead, 5)
        largest, bits = whole(lead[10:14]), whole(lead[128:130])
        length = width_of(min(largest, whole(lead[120:128])))
        offset = (bits + 7) // 8
        if filters or not 1 + offset + length <= id_bytes <= 8:
            raise ValueError(DAMAGED)
        skipped = 4 if tree_type == 5 else 0
        for record in self._records(tree, tree_type, skipped + id_bytes):
            key = record[skipped:]
            if key[0] or (tree_type == 8 and key[id_bytes] & SHARED):
                raise ValueError(ELSEWHERE)  # too large for the heap, or shared
            at, size = whole(key[1 : 1 + offset]), whole(key[1 + offset : 1 + offset + length])
            yield self._read(self._in_blocks(lead, at, offset), size)

    def _in_blocks(self, lead: bytes, at: int, offset: int) -> int:
        """Where byte `at` of a heap lies in the file."""
        width, first = whole(lead[110:112]), whole(lead[112:120])
        root, rows = whole(lead[132:140]), whole(lead[140:142])
        if not rows:
            return root + at
        start = 0
        for row in range(min(rows, 64)):
            size = first << max(row - 1, 0)
            if at < start + width * size:
                column = (at - start) // size
                address = root + 13 + offset + 8 * (row * width + column)
                self._block(root, b"FHIB\x00", 5)
                return whole(self._read(address, 8)) + at - start - column * size
            start += width * size
        raise ValueError(DAMAGED)

    def _records(self, tree: int, kind: int, least: int) -> Iterator[bytes]:
        """The records of a B-tree of at most two levels, in order."""
        lead = self._block(tree, b"BTHD\x00", 34)
        node, size, depth = struct.unpack_from("<IHH", lead, 6)
        root, count = struct.unpack_from("<QH", lead, 16)
        if lead[5] != kind or size < least + (kind == 8) or node < size + 10 or depth > 1:
            raise ValueError(DAMAGED)
        if root == _NOWHERE:
            return
        leaves = [(root, count)]
        if depth:
            width = width_of((node - 10) // size)
            data = self._block(root, b"BTIN\x00", 6 + count * size + (count + 1) * (8 + width))[6:]
            yield from (data[k * size : (k + 1) * size] for k in range(count))
            behind = data[count * size :]
            leaves = [
                (whole(behind[k : k + 8]), whole(behind[k + 8 : k + 8 + width]))
                for k in range(0, len(behind), 8 + width)
            ]
        for address, count in leaves:
            data = self._block(address, b"BTLF\x00", 6 + count * size)[6:]
            yield from (data[k * size : (k + 1) * size] for k in range(count))

    def _variable(self, name: str, at: int) -> Variable:
        """The array whose header is at `at`."""
        header = self._header(at)
        if not any(message.kind == LAYOUT for message in header):
            raise ValueError(f"{name} as a group or a type, not a variable")
        known = (SPACE, TYPE, LAYOUT, FILTERS, ATTRIBUTE, ATTRIBUTES, *PASSED_OVER)
        if not all(message.kind in known for message in header):
            raise ValueError(f"{name} {ELSEWHERE}")
        layout, space, kind = (only(header, k) for k in (LAYOUT, SPACE, TYPE))
        shape, dtype = shape_of(space), number_type(kind)
        if shape is None or not 0 < len(shape) <= _MOST_RANK or dtype is None:
            raise ValueError(f"{name} of a type that is no plain number, or of another shape")
        # A dimension of no length can grow, for HDF5: its arrays are made for pieces, and have none.
        if layout[0] in (3, 4) and layout[1] == 2 and not math.prod(shape):
            return Variable(shape, dtype, None)
        if any(message.kind == FILTERS for message in header):
            filters = only(header, FILTERS)
            packed = packed_layout(layout, filters, shape, dtype.itemsize)
            return Variable(shape, dtype, None, packed)
        if layout[0] not in (3, 4) or layout[1] != 1:
            raise ValueError(f"{name} {ELSEWHERE}")
        address, stored = struct.unpack_from("<QQ", layout, 2)
        variable = Variable(shape, dtype, None if address == _NOWHERE else address)
        if variable.address is None and len(shape) > 1 and math.prod(shape) > 0:
            raise ValueError(f"{name} of shape {shape} without numbers")
        if variable.address is not None and (
            stored != variable.length or address + stored > self._size
        ):
            raise ValueError(f"{name} of shape {shape} in {stored} bytes, from byte {address} on")
        return variable

    def _values(
        self, name: str, kind: bytes, shape: tuple[int, ...] | None, data: bytes
    ) -> list[object]:
        """The values of an attribute: numbers, or texts."""
        if shape is None:
            raise ValueError(f"attribute {name} without a value")
        count, size = int(math.prod(shape)), whole(kind[4:8])
        if count > _MOST_VALUES or len(data) < count * size:
            raise ValueError(f"attribute {name} of shape {shape}")
        dtype = number_type(kind)
        if dtype is not None:
            return list(np.frombuffer(data, dtype, count).tolist())
        parts = [data[k * size : (k + 1) * size] for k in range(count)]
        form, variant = kind[0] & 15, kind[1] & 15
        if form == 3 and size:
            ends = {0: "\0", 1: "\0", 2: " "}
            return [part.decode("utf-8").rstrip(ends.get(variant, "")) for part in parts]
        if form == 9 and variant == 1 and size == 16:
            return [self._text(*struct.unpack("<IQI", part)).decode("utf-8") for part in parts]
        raise ValueError(f"attribute {name} of a type that is no text and no plain number")

    def _text(self, length: int, heap: int, index: int) -> bytes:
        """A text of the global heap at `heap`."""
        if length == 0:
            return b""
        if heap not in self._texts:
            lead = self._block(heap, b"GCOL\x01", 16)
            self._texts[heap] = collection(self._read(heap, whole(lead[8:])))
        text = self._texts[heap].get(index, b"")
        self._left -= len(text)
        if len(text) != length or self._left < 0:
            raise ValueError("a damaged file: text of another length, or too much of it")
        return text
