"""Parts of an HDF5 file as bytes: messages of headers, links, attributes, types, texts; see `hdf5`."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

# Kinds of messages.
NIL, SPACE, LINKS, TYPE, LINK, LAYOUT, FILTERS, ATTRIBUTE, NEXT, ATTRIBUTES = (
    0, 1, 2, 3, 6, 8, 11, 12, 16, 21,
)  # fmt: skip
PASSED_OVER = (NIL, 4, 5, 10, 14, 18, 22)  # values of gaps, comments, times, counts
# Where a message does not stand for itself, but for a named type or another header's.
SHARED = 2

DAMAGED = "a damaged file: parts beyond its end, of a wrong kind, or that lead in a circle"
ELSEWHERE = "in pieces, packed, or in another file"


def _number_types() -> dict[bytes, np.dtype[np.generic]]:
    """The description of each plain number in a file, without its version."""
    floats = {
        4: struct.pack("<HHBBBBI", 0, 32, 23, 8, 0, 23, 127),
        8: struct.pack("<HHBBBBI", 0, 64, 52, 11, 0, 52, 1023),
    }
    known = {}
    for big, order in enumerate("<>"):
        for size, rest in floats.items():
            lead = struct.pack("<BBBBI", 1, 0x20 | big, 8 * size - 1, 0, size)
            known[lead + rest] = np.dtype(f"{order}f{size}")
        for size in (1, 2, 4, 8):
            for signed, letter in enumerate("ui"):
                lead = struct.pack("<BBBBI", 0, 8 * signed | big, 0, 0, size)
                known[lead + struct.pack("<HH", 0, 8 * size)] = np.dtype(f"{order}{letter}{size}")
    return known


_NUMBERS = _number_types()


class Message(NamedTuple):
    """A part of a header."""

    kind: int
    data: bytes


def whole(data: bytes) -> int:
    """An unsigned whole number."""
    return int.from_bytes(data, "little")


def width_of(largest: int) -> int:
    """The bytes that numbers up to `largest` take."""
    return max((largest.bit_length() + 7) // 8, 1)


def messages_in(data: bytes, lead: int) -> Iterator[Message]:
    """The messages of a piece of a header, `lead` bytes before each."""
    at = 0
    while at + lead <= len(data):
        kind, size, flags = struct.unpack_from("<BHB", data, at)
        at += lead + size
        if at > len(data):
            raise ValueError(DAMAGED)
        if kind not in PASSED_OVER and flags & SHARED:
            raise ValueError("a named type")
        yield Message(kind, data[at - size : at])


def only(header: list[Message], kind: int) -> bytes:
    """The one message of a kind."""
    contents = [message.data for message in header if message.kind == kind]
    if len(contents) != 1:
        raise ValueError(DAMAGED)
    return contents[0]


def name_of(raw: bytes) -> str:
    """A name, of printable letters alone."""
    name = raw.rstrip(b"\0").decode("utf-8")
    if not name.isprintable():
        raise ValueError(f"a variable or attribute named {name!a}")
    return name


def link_of(data: bytes) -> tuple[str, int]:
    """The name and the address of a link."""
    flags, at = data[1], 2
    kind, at = (data[at], at + 1) if flags & 8 else (0, at)
    at += (8 if flags & 4 else 0) + (1 if flags & 16 else 0)
    width = 1 << (flags & 3)
    start = at + width
    end = start + whole(data[at:start])
    name = name_of(data[start:end])
    if data[0] != 1 or kind != 0 or len(data) < end + 8:
        raise ValueError(f"{name} as a link to something else")
    return name, whole(data[end : end + 8])


def attribute_of(data: bytes) -> tuple[str, bytes, tuple[int, ...] | None, bytes]:
    """The name, type, shape (None: no value) and bytes of an attribute."""
    version, flags, *sizes = struct.unpack_from("<BBHHH", data)
    if version not in (1, 2, 3) or (version > 1 and flags):
        raise ValueError("an attribute of a named type")
    parts, at = [], 9 if version == 3 else 8
    for size in sizes:
        parts.append(data[at : at + size])
        at += (size + 7) // 8 * 8 if version == 1 else size
    name, kind, space = parts
    return name_of(name), kind, shape_of(space), data[at:]


def shape_of(space: bytes) -> tuple[int, ...] | None:
    """Of a data space; None where it holds nothing."""
    version, rank = space[0], space[1]
    if version not in (1, 2) or (version == 2 and space[3] == 2):
        return None
    start = 8 if version == 1 else 4
    return tuple(struct.unpack_from(f"<{rank}Q", space, start))


def number_type(kind: bytes) -> np.dtype[np.generic] | None:
    """The plain number that a type describes; None for other types."""
    plain = bytes([kind[0] & 15]) + kind[1 : 20 if kind[0] & 15 else 12]
    return _NUMBERS.get(plain)


def collection(heap: bytes) -> dict[int, bytes]:
    """The texts of a global heap by number; it ends with the part of number 0, or with the heap."""
    found, at = dict[int, bytes](), 16
    while at + 16 <= len(heap):
        index, size = whole(heap[at : at + 2]), whole(heap[at + 8 : at + 16])
        if index == 0:
            break
        at += 16
        if index in found or at + size > len(heap):
            raise ValueError("a damaged file: text that overlaps")
        found[index] = heap[at : at + size]
        at += (size + 7) // 8 * 8
    return found
