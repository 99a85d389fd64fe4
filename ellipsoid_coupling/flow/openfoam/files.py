r"""Strict reading of OpenFOAM's mesh and field files: ascii or binary, packed by gzip or not.

    FoamFile { version 2.0; format ascii; class vectorField; ... }
    578                      the number of entries
    (                        in binary, the numbers' bytes stand between the parentheses
    (0 0 0)
    ...
    )

Every number is checked here before any library reads a file. A count is compared with the mesh and with
the file's size before an array of that size is made, and no file is unpacked beyond the size that its
count needs. Anything but the plain form that OpenFOAM writes is refused, with its line (in binary files:
its byte). Reading takes time and memory in proportion to the file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import (
    LARGEST_IN_A_CASE,
    MOST_CASE_FILE_BYTES,
    MOST_MESH_ENTRIES,
    in_words,
)
from ellipsoid_coupling.files.reading import exists, read_bytes, unpack, unpack_beginning
from ellipsoid_coupling.flow.openfoam.tokens import (
    Token,
    after_space,
    line_of,
    name_at,
    token_at,
    without_comments,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REMEDY = "Write the case again, or take another copy of it."

# Every repetition is bounded or of one class, so that nothing is tried twice: linear in any Python.
_NUMBER = (
    rb"[-+]?(?:(?:\d{1,60}(?:\.\d{0,60})?|\.\d{1,60})(?:[eE][-+]?\d{1,9})?|(?i:nan|inf(?:inity)?))"
)
_ENTRY = {
    1: re.compile(_NUMBER + rb"(?=[\s);}])"),
    3: re.compile(rb"\(\s*" + rb"\s+".join([_NUMBER] * 3) + rb"\s*\)"),
}
# Entries that are read at once: their text is small compared with the file.
_BATCH = {
    width: re.compile(rb"(?:\s*" + entry.pattern + rb"){1,1000}") for width, entry in _ENTRY.items()
}
_FACES = re.compile(rb"(?:\s*\d{1,9}\s*\((?:\s*\d{1,9}(?=[\s)])){0,1000}\s*\)){1,1000}")
_COUNT = re.compile(rb"\d{1,18}(?![\w.])")
# The most bytes of a list's entry, in ascii with all digits, and of the rest of a file.
_ENTRY_BYTES = {"vectorField": 100, "labelList": 24, "faceList": 400, "faceCompactList": 400}
_BEGINNING = 65_536
_ARCH = re.compile(r'"?LSB;label=(32|64);scalar=(32|64)"?')
_SPARE_PARENTHESES = bytes.maketrans(b"()", b"  ")


@dataclass(frozen=True)
class FoamFile:
    """A file, unpacked, behind its header.

    path : its name in messages
    data : all of it; start : the first byte behind the header
    kind : the header's class
    binary, label, scalar : how its numbers are stored
    """

    path: Path
    data: bytes
    start: int
    kind: str
    binary: bool
    label: np.dtype[np.signedinteger]
    scalar: np.dtype[np.floating]

    def error(self, at: int, expected: str, found: str) -> InputError:
        """An error at byte `at`."""
        place = f"byte {at}" if self.binary else f"line {line_of(self.data, at)}"
        return InputError(f"{self.path}, {place}", expected, found, REMEDY)

    def token(self, at: int, expected: str) -> Token:
        """The token at byte `at`; InputError at the end, or at text that no file has."""
        return self._known(token_at(self.data, at), expected)

    def name(self, at: int, expected: str) -> Token:
        """As `token` where a name is expected: it may have parentheses in it."""
        return self._known(name_at(self.data, at), expected)

    def _known(self, token: Token | None, expected: str) -> Token:
        if token is None:
            raise self.error(len(self.data), expected, "the end of the file")
        if token.kind == "odd":
            raise self.error(token.start, expected, f"text out of place, {token.text!r}")
        return token

    def mark(self, at: int, text: str) -> int:
        """The byte behind the mark `text`, which must stand at `at`."""
        token = self.token(at, repr(text))
        if token.text != text:
            raise self.error(token.start, repr(text), repr(token.text))
        return token.end


def packed(path: Path) -> Path | None:
    """The file `path`, or `path`.gz, whichever is there; None if neither is."""
    beside = path.with_name(f"{path.name}.gz")
    return path if exists(path) else beside if exists(beside) else None


def open_file(path: Path, *kinds: str, most: int | None = None) -> FoamFile:
    """A file whose class is one of `kinds`; InputError for a missing, broken or other one.

    most : bytes, unpacked; by default those that the number of entries in the header needs
    """
    expected = f"an OpenFOAM file {path.name}"
    there = packed(path)
    if there is None:
        raise InputError(str(path), expected, "none", "Mesh and solve the case.")
    data = read_bytes(there, expected, MOST_CASE_FILE_BYTES)
    is_packed = there != path
    size = _BEGINNING if most is None else min(most, _BEGINNING)
    start = unpack_beginning(data, there, expected, size) if is_packed else data
    file = opened(there, start, kinds)
    room = _room(file) if most is None else most
    if is_packed:
        data = unpack(data, there, expected, min(room, MOST_CASE_FILE_BYTES))
    elif len(data) > room:
        found = f"{in_words(len(data))}, more than its entries need"
        raise InputError(str(there), f"{expected} of at most {in_words(room)}", found, REMEDY)
    return replace(file, data=data if file.binary else without_comments(data))


def _room(file: FoamFile) -> int:
    """The bytes that the list behind the header needs at most, by its number of entries."""
    number, at = read_count(file, file.start, "entries")
    if number > MOST_MESH_ENTRIES:
        raise file.error(at, f"at most {MOST_MESH_ENTRIES} entries", f"{number}")
    return _BEGINNING + number * _ENTRY_BYTES[file.kind]


def opened(there: Path, data: bytes, kinds: tuple[str, ...]) -> FoamFile:
    """The file, of which `data` has at least the header."""
    header, start = read_header(there, data)
    kind, written = header.get("class", "none"), header.get("format", "none")
    arch = _ARCH.fullmatch(header.get("arch", "LSB;label=32;scalar=64"))
    for key, found, known in (("class", kind, kinds), ("format", written, ("ascii", "binary"))):
        if found not in known:
            raise InputError(f"{there}, key {key}", " or ".join(known), found, REMEDY)
    if arch is None:
        known_arch = "LSB;label=32 or 64;scalar=32 or 64"
        raise InputError(f"{there}, key arch", known_arch, header["arch"], REMEDY)
    label, scalar = (
        np.dtype(f"<{letter}{int(bits) // 8}")
        for letter, bits in zip("if", arch.groups(), strict=True)
    )
    return FoamFile(there, data, start, kind, written == "binary", label, scalar)


def read_header(path: Path, data: bytes) -> tuple[dict[str, str], int]:
    """The entries of FoamFile { ... } and the byte behind it."""
    file = FoamFile(path, data, 0, "", False, np.dtype("<i4"), np.dtype("<f8"))
    first = file.token(0, "FoamFile")
    if first.text != "FoamFile":
        raise file.error(first.start, "FoamFile", repr(first.text))
    entries: dict[str, str] = {}
    at = file.mark(first.end, "{")
    while True:
        key = file.token(at, "an entry of FoamFile")
        if key.text == "}":
            return entries, key.end
        value = file.token(key.end, f"the value of {key.text}")
        if key.kind != "word" or value.kind not in ("word", "string"):
            raise file.error(key.start, "an entry of FoamFile", repr(key.text))
        entries[key.text] = value.text.strip('"')
        at = file.mark(value.end, ";")


def read_count(file: FoamFile, at: int, what: str) -> tuple[int, int]:
    """A number of entries and the byte behind it."""
    at = after_space(file.data, at)
    match = _COUNT.match(file.data, at)
    if match is None:
        raise file.error(at, f"the number of {what}", _excerpt(file, at))
    return int(match[0]), match.end()


def read_numbers(
    file: FoamFile, at: int, width: int, count: int | None, what: str
) -> tuple[Array, int]:
    """A list of scalars (width 1) or vectors (3), (count, width), and the byte behind it.

    `count` is how many there must be, None for any number. They may be infinite or no numbers.
    """
    number, at = _checked_count(file, at, count, what)
    if file.data[at : at + 1] == b"{" and count is not None:  # 100{(0 0 0)}
        value, at = read_entry(file, at + 1, width, what)
        return np.repeat(value[None], number, axis=0), file.mark(at, "}")
    if number == 0 and file.data[at : at + 1] != b"(":
        return np.zeros((0, width)), at
    start = file.mark(at, "(")
    if file.binary:
        raw, at = _raw(file, start, number * width, file.scalar, what)
        return raw.astype(np.float64).reshape(number, width), file.mark(at, ")")
    parts: list[Array] = [np.zeros(0)]
    end, left = start, number * width
    while left >= 0 and (match := _BATCH[width].match(file.data, end)):
        parts.append(_parsed(match[0]))
        end, left = match.end(), left - parts[-1].size
    _require_end(file, end, what)
    values = np.concatenate(parts).reshape(-1, width)
    if len(values) != number:
        raise file.error(end, f"{number} {what}", f"{len(values)}")
    return values, file.mark(end, ")")


def read_entry(file: FoamFile, at: int, width: int, what: str) -> tuple[Array, int]:
    """One scalar or vector in ascii, (width,), and the byte behind it."""
    at = after_space(file.data, at)
    match = _ENTRY[width].match(file.data, at)
    if match is None:
        kind = "a number" if width == 1 else "a vector (x y z)"
        raise file.error(at, f"{kind} for {what}", _excerpt(file, at))
    return _parsed(match[0]), match.end()


def read_labels(file: FoamFile, at: int, count: int | None, what: str) -> tuple[Index, int]:
    """A list of whole numbers, (count,), and the byte behind it."""
    if not file.binary:
        values, at = read_numbers(file, at, 1, count, what)
        whole = values[:, 0]
        if not np.all((whole == np.rint(whole)) & (np.abs(whole) < 2.0**53)):
            raise file.error(at, f"whole numbers for {what}", "others")
        return whole.astype(np.int64), at
    number, at = _checked_count(file, at, count, what)
    if number == 0 and file.data[at : at + 1] != b"(":
        return np.zeros(0, np.int64), at
    raw, at = _raw(file, file.mark(at, "("), number, file.label, what)
    return raw.astype(np.int64), file.mark(at, ")")


def read_faces(file: FoamFile) -> tuple[Index, Index]:
    """The corners of all faces, one after another (K,), and where each face begins (F + 1,)."""
    if file.kind == "faceCompactList":
        offsets, at = read_labels(file, file.start, None, "faces")
        corners, _ = read_labels(file, at, None, "corners of faces")
        if offsets.size < 2 or offsets[0] != 0 or np.any(np.diff(offsets) < 0):
            raise file.error(at, "faces that begin one behind the other", "others")
        if offsets[-1] != corners.size:
            raise file.error(at, f"{offsets[-1]} corners of faces", f"{corners.size}")
        return corners, offsets
    if file.binary:
        raise file.error(file.start, "the class faceCompactList in a binary file", file.kind)
    number, at = read_count(file, file.start, "faces")
    end = file.mark(at, "(")
    corners_of, sizes_of = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    while match := _FACES.match(file.data, end):
        # 4(0 1 2 3) becomes 4 0 1 2 3 -1
        text = match[0].replace(b")", b" -1 ").replace(b"(", b" ")
        flat = _parsed(text).astype(np.int64)
        ends = np.flatnonzero(flat < 0)
        begins = np.concatenate(([0], ends[:-1] + 1))
        sizes_of.append(ends - begins - 1)
        if np.any(flat[begins] != sizes_of[-1]):
            raise file.error(end, "faces with as many corners as each says", "others")
        keep = flat >= 0
        keep[begins] = False
        corners_of.append(flat[keep])
        end = match.end()
    _require_end(file, end, "faces")
    sizes = np.concatenate(sizes_of)
    if sizes.size != number:
        raise file.error(end, f"{number} faces", f"{sizes.size}")
    return np.concatenate(corners_of), np.concatenate(([0], np.cumsum(sizes)))


def decimal(values: NDArray[np.floating]) -> Array:
    """Single-precision numbers as the decimal ones they came from: 0.1, not 0.100000001."""
    return values.astype(np.float32).astype("U32").astype(np.float64)


def require_finite(file: FoamFile, values: Array, what: str) -> None:
    """InputError that names the first entry which is NaN, infinite or beyond single precision."""
    bad = np.flatnonzero(~(np.abs(values) <= LARGEST_IN_A_CASE).all(axis=1))
    if bad.size:
        entry = " ".join(f"{value:g}" for value in values[bad[0]])
        raise InputError(
            f"{file.path}, entry {bad[0]} of {what}",
            f"finite numbers up to {LARGEST_IN_A_CASE:g}",
            f"{entry} ({bad.size} such entries: NaN or infinite values, or huge ones)",
            "Solve the case again; its run has diverged.",
        )  # fmt: skip


def _checked_count(file: FoamFile, at: int, count: int | None, what: str) -> tuple[int, int]:
    number, behind = read_count(file, at, what)
    if count is not None and number != count:
        raise file.error(after_space(file.data, at), f"{count} {what}", f"{number}")
    return number, after_space(file.data, behind)


def _raw(
    file: FoamFile, start: int, number: int, dtype: np.dtype[np.generic], what: str
) -> tuple[NDArray[np.generic], int]:
    end = start + number * dtype.itemsize
    if end > len(file.data):
        raise file.error(
            start, f"{number * dtype.itemsize} bytes of {what}", f"{len(file.data) - start}"
        )
    return np.frombuffer(file.data, dtype, number, start), end


def _require_end(file: FoamFile, end: int, what: str) -> None:
    """InputError unless the list that has been read up to byte `end` closes there."""
    close = after_space(file.data, end)
    if file.data[close : close + 1] != b")":
        raise file.error(close, f"{what}, or ')' at the end of their list", _excerpt(file, close))


def _parsed(text: bytes) -> Array:
    """The numbers in ascii text, parentheses ignored; the text has been checked."""
    return np.fromstring(text.translate(_SPARE_PARENTHESES), dtype=np.float64, sep=" ")


def _excerpt(file: FoamFile, at: int) -> str:
    text = file.data[at : at + 24].decode("latin-1").split("\n")[0]
    return repr(text) if text else "the end of the file"
