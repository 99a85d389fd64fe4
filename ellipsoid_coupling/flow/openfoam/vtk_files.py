"""Strict reading of the XML files that foamToVTK writes, before meshio or VTK sees them.

Both take counts and offsets as they stand: a wrong one fills the memory or ends the program. So every
array is decoded here once, and its size, its type and, for indices, its range are checked. Before that
the tags alone are read, as the text between them may be of any length: few, short and plain ones, no
declaration, no other encoding. Time and memory are in proportion to the file.
"""

from __future__ import annotations

import base64
import binascii
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import (
    LARGEST_IN_A_CASE,
    MOST_CASE_FILE_BYTES,
    MOST_MESH_ENTRIES,
    MOST_NESTING,
    in_words,
)
from ellipsoid_coupling.files.reading import read_bytes
from ellipsoid_coupling.flow.openfoam.files import decimal

REMEDY = "Name the folder of the solved case itself, or run foamToVTK -latestTime again."
_EXPECTED = "what foamToVTK writes"
_TYPES = {
    "Float32": "<f4", "Float64": "<f8", "Int8": "<i1", "UInt8": "<u1", "Int32": "<i4",
    "UInt32": "<u4", "Int64": "<i8", "UInt64": "<u8",
}  # fmt: skip
# VTK's numbers of the cells that a plane mesh has, and their corners.
_CORNERS = {12: 8, 13: 6}
_COUNT = re.compile(r"\d{1,12}")
_DECLARATION = re.compile(
    rb"<\?xml version=['\"]1\.[01]['\"]( encoding=['\"](?i:utf-8|us-ascii)['\"])? ?\?>"
)
_BLANK = re.compile(rb"\s")
_BLANKS = b" \t\r\n"
# foamToVTK writes some dozen tags of less than 200 bytes, and little text that is in no array.
_MOST_TAGS, _LONGEST_TAG, _OTHER_TEXT = 2_000, 4_096, 1_000_000
# Bytes of a number in ascii with a blank, and of the text around those of an array.
_NUMBER_BYTES, _AROUND = 32, 1_000
_PIECE = 1 << 20


class _Marks(NamedTuple):
    """The tags of a file, one behind the other, and where the text behind each opening one lies."""

    tags: bytes
    spans: list[slice]


@dataclass(frozen=True)
class _Piece:
    """The one piece of a file: where it comes from, its element, its numbers of points and cells.

    texts : of each array, as it stands in the file
    header : the bytes of the number before an array's own
    fields : the arrays that stand before the piece
    """

    path: Path
    element: ElementTree.Element
    points: int
    cells: int
    texts: Mapping[ElementTree.Element, bytes]
    header: int
    fields: list[ElementTree.Element]

    def error(self, place: str, expected: str, found: str) -> InputError:
        return InputError(f"{self.path}, {place}", expected, found, REMEDY)

    def arrays(self, section: str) -> dict[str, ElementTree.Element]:
        """The arrays of a section by name; none where it is missing."""
        parts = self.element.findall(section)
        arrays = parts[0].findall("DataArray") if parts else []
        by_name = {array.get("Name", "none"): array for array in arrays}
        if len(parts) > 1 or len(by_name) < len(arrays):
            raise self.error(section, "each section and each array once", "one twice")
        return by_name

    def decoded(self, section: str, name: str, rows: int, width: int) -> NDArray[np.generic]:
        """An array of a section, (rows, width); InputError where it is missing, broken or another."""
        place, element = f"{section} {name}", self.arrays(section).get(name)
        if element is None:
            raise self.error(place, "an array", "none")
        values = _decode(self, place, element, rows * width)
        if values.size != rows * width or element.get("NumberOfComponents", "1") != str(width):
            found = f"{values.size}, {element.get('NumberOfComponents', '1')} each"
            raise self.error(place, f"{rows * width} numbers, {width} each", found)
        return values.reshape(rows, width)


def check_internal(path: Path) -> None:
    """InputError unless `path` is a whole internal.vtu of hexahedra and prisms with a finite U."""
    piece = _open(path, "UnstructuredGrid", "NumberOfCells")
    types = _indices(piece, "Cells", "types", piece.cells, 256)
    unknown = set(np.unique(types).tolist()) - set(_CORNERS)
    if unknown or not piece.cells:
        raise piece.error(
            "Cells types", "cells, all hexahedra (12) or prisms (13)",
            ", ".join(map(str, sorted(unknown))) or "none",
        )  # fmt: skip
    sizes = np.zeros(256, np.int64)
    sizes[list(_CORNERS)] = list(_CORNERS.values())
    _check_corners(piece, "Cells", sizes[types])
    _check_points(piece)
    _check_finite(piece, "CellData", "U", piece.decoded("CellData", "U", piece.cells, 3))
    _check_others(piece)


def read_told(path: Path) -> tuple[float, bool]:
    """The time of an internal.vtu, and whether U is the same in all cells; InputError without them."""
    piece = _open(path, "UnstructuredGrid", "NumberOfCells")
    told = [array for array in piece.fields if array.get("Name") == "TimeValue"]
    if len(told) != 1:
        raise piece.error("FieldData", "one TimeValue", f"{len(told)}")
    time = _decode(piece, "TimeValue", told[0], 1)
    if time.size != 1 or not abs(float(time[0])) <= LARGEST_IN_A_CASE:
        raise piece.error("TimeValue", "one finite number", "others")
    velocity = piece.decoded("CellData", "U", piece.cells, 3)
    single = time.dtype == np.float32
    number = float(decimal(time.astype(np.float32))[0] if single else time[0])
    return number, bool((velocity == velocity[:1]).all())


class PatchPolygons(NamedTuple):
    """points (P, 3); corners (K,) and their number per polygon (n,); U in them (n, 3), if given."""

    points: NDArray[np.float64]
    corners: NDArray[np.int64]
    sizes: NDArray[np.int64]
    velocity: NDArray[np.float64] | None


def read_patch(path: Path) -> PatchPolygons:
    """The polygons of a .vtp file; InputError unless it is whole, with a finite U if it has one."""
    piece = _open(path, "PolyData", "NumberOfPolys")
    offsets = _indices(piece, "Polys", "offsets", piece.cells, 2**40)
    sizes = np.diff(offsets, prepend=0)
    if np.any(sizes < 3):
        raise piece.error("Polys offsets", "polygons of three corners or more", "less")
    corners = _check_corners(piece, "Polys", sizes)
    points, velocity = _check_points(piece), None
    if "U" in piece.arrays("CellData"):
        values = piece.decoded("CellData", "U", piece.cells, 3)
        velocity = _check_finite(piece, "CellData", "U", values)
    return PatchPolygons(points, corners, sizes, velocity)


def _open(path: Path, kind: str, cells: str) -> _Piece:
    """The piece in a VTKFile of this kind."""
    data = read_bytes(path, _EXPECTED, MOST_CASE_FILE_BYTES)
    try:
        marks = _marks(data)
        root = ElementTree.fromstring(marks.tags, ElementTree.XMLParser(encoding="utf-8"))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(str(path), _EXPECTED, f"broken XML: {error}", REMEDY) from None
    pieces = root.findall(f"{kind}/Piece")
    plain = root.get("byte_order") == "LittleEndian" and root.get("compressor") is None
    if root.tag != "VTKFile" or root.get("type") != kind or len(pieces) != 1 or not plain:
        found = f"{root.tag} of type {root.get('type')}, {len(pieces)} pieces"
        raise InputError(
            str(path), f"an uncompressed VTKFile of type {kind} with one piece", found, REMEDY
        )
    if root.get("header_type", "UInt32") not in ("UInt32", "UInt64"):
        raise InputError(str(path), "header_type UInt32 or UInt64", "another", REMEDY)
    counts = [pieces[0].get(name, "none") for name in ("NumberOfPoints", cells)]
    for count in counts:
        if not _COUNT.fullmatch(count) or int(count) > MOST_MESH_ENTRIES:
            expected = f"numbers of points and cells up to {MOST_MESH_ENTRIES}"
            raise InputError(f"{path}, Piece", expected, count, REMEDY)
    elements = zip(root.iter(), marks.spans, strict=True)
    texts = {element: data[span] for element, span in elements if element.tag == "DataArray"}
    other = len(data) - len(marks.tags) - sum(map(len, texts.values()))
    if other > _OTHER_TEXT:
        raise InputError(str(path), _EXPECTED, f"{in_words(other)} that are no arrays", REMEDY)
    header = 8 if root.get("header_type") == "UInt64" else 4
    fields = root.findall(f"{kind}/FieldData/DataArray")
    return _Piece(path, pieces[0], int(counts[0]), int(counts[1]), texts, header, fields)


def _marks(data: bytes) -> _Marks:
    """The tags of an XML file; ValueError where they are not few, short and plain.

    No declaration passes, as entities can make a small file large, and another encoding hide them.
    """
    if b"\0" in data:
        raise ValueError("a zero byte, as in UTF-16")
    data_start = len(data) - len(data.lstrip())
    tags, spans, at, depth, seen = [], [], 0, 0, 0
    while (start := data.find(b"<", at)) >= 0:
        seen += 1
        if data.startswith(b"<!--", start):
            end = data.find(b"-->", start + 4)
            at = end + 3
        else:
            end = data.find(b">", start, start + _LONGEST_TAG)
            at = end + 1
            tag = data[start:at]
            if tag.startswith(b"<?") and start == data_start and _DECLARATION.fullmatch(tag):
                continue
            if tag[1:2] in (b"!", b"?"):
                raise ValueError("a declaration")
            tags.append(tag)
            depth += -1 if tag[1:2] == b"/" else tag[-2:-1] != b"/"
            if tag[1:2] != b"/":
                following = data.find(b"<", at)
                spans.append(slice(at, at if tag[-2:-1] == b"/" or following < 0 else following))
        if end < 0 or seen > _MOST_TAGS or depth > MOST_NESTING:
            raise ValueError(
                f"a tag that is not closed, of more than {_LONGEST_TAG} bytes, one of more than "
                f"{_MOST_TAGS}, or nested more than {MOST_NESTING} deep"
            )
    return _Marks(b"".join(tags), spans)


def _decode(
    piece: _Piece, place: str, element: ElementTree.Element, count: int
) -> NDArray[np.generic]:
    """The numbers of an array, flat; InputError where they are more than `count`."""
    kind, form = _TYPES.get(element.get("type", "")), element.get("format")
    text = piece.texts[element]
    if kind is None or form not in ("binary", "ascii"):
        found = f"type {element.get('type')}, format {form}"
        raise piece.error(place, "numbers, binary or ascii", found)
    if form == "ascii":
        return _ascii(piece, place, text, np.dtype(kind), count)
    size = np.dtype(kind).itemsize
    if len(text) > 2 * (piece.header + count * size) + _AROUND:
        raise piece.error(place, f"{count} numbers", f"{in_words(len(text))} of text")
    try:
        raw = base64.b64decode(text.translate(None, _BLANKS), validate=True)
    except (binascii.Error, ValueError) as error:
        raise piece.error(place, "base64", str(error)) from None
    stated = int.from_bytes(raw[: piece.header], "little")
    if stated != len(raw) - piece.header or stated % size:
        found = f"{len(raw) - piece.header}"
        raise piece.error(place, f"{stated} bytes, as its header says", found)
    return np.frombuffer(raw, kind, offset=piece.header)


def _ascii(
    piece: _Piece, place: str, text: bytes, kind: np.dtype[np.generic], count: int
) -> NDArray[np.generic]:
    """Numbers in ascii; a megabyte of text at a time, as each number is an object in between."""
    if len(text) > _NUMBER_BYTES * count + _AROUND:
        raise piece.error(place, f"{count} numbers", f"{in_words(len(text))} of text")
    parts, at, left = [np.zeros(0, kind)], 0, count
    while at < len(text) and left >= 0:
        following = _BLANK.search(text, at + _PIECE)
        end = len(text) if following is None else following.start()
        try:
            parts.append(np.array(text[at:end].decode("ascii").split(), dtype=kind))
        except (ValueError, OverflowError) as error:
            raise piece.error(place, "numbers", str(error)) from None
        at, left = end, left - parts[-1].size
    return np.concatenate(parts)


def _indices(piece: _Piece, section: str, name: str, rows: int, below: int) -> NDArray[np.int64]:
    """An array of whole numbers from 0 on, (rows,)."""
    decoded = piece.decoded(section, name, rows, 1)[:, 0]
    values = decoded.astype(np.int64)
    if decoded.dtype.kind not in "iu" or np.any((values < 0) | (values >= below)):
        raise piece.error(f"{section} {name}", f"whole numbers from 0 to {below - 1}", "others")
    return values


def _check_corners(piece: _Piece, section: str, sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Offsets are the sums of the cells' sizes, and corners are points, no cell has one twice."""
    offsets = _indices(piece, section, "offsets", piece.cells, 2**40)
    if not np.array_equal(offsets, np.cumsum(sizes)):
        raise piece.error(f"{section} offsets", "the sums of the cells' corners", "others")
    corners = _indices(piece, section, "connectivity", int(sizes.sum()), piece.points)
    cell = np.repeat(np.arange(sizes.size), sizes)
    order = np.lexsort((corners, cell))
    twice = (np.diff(corners[order]) == 0) & (np.diff(cell[order]) == 0)
    if twice.any():
        where = cell[order][np.flatnonzero(twice)[0]]
        raise piece.error(f"{section} connectivity", "cells whose corners differ", f"cell {where}")
    return corners


def _check_points(piece: _Piece) -> NDArray[np.float64]:
    arrays = piece.arrays("Points")
    if len(arrays) != 1:
        raise piece.error("Points", "one array", f"{len(arrays)}")
    name = next(iter(arrays))
    values = piece.decoded("Points", name, piece.points, 3)
    points = _check_finite(piece, "Points", name, values)
    return decimal(points) if values.dtype.itemsize == 4 else points


def _check_finite(
    piece: _Piece, section: str, name: str, values: NDArray[np.generic]
) -> NDArray[np.float64]:
    numbers = values.astype(np.float64)
    bad = np.flatnonzero(~(np.abs(numbers) <= LARGEST_IN_A_CASE).all(axis=1))
    if bad.size:
        raise piece.error(
            f"{section} {name}, entry {bad[0]}", f"finite numbers up to {LARGEST_IN_A_CASE:g}",
            f"{numbers[bad[0]]} ({bad.size} such entries: NaN or infinite values, or huge ones)",
        )  # fmt: skip
    return numbers


def _check_others(piece: _Piece) -> None:
    """Every other array, which the libraries read as well, has the size that its place needs."""
    for section, rows in (("CellData", piece.cells), ("PointData", piece.points)):
        for name, element in piece.arrays(section).items():
            width = element.get("NumberOfComponents", "1")
            if not re.fullmatch(r"[1-9]", width):
                raise piece.error(f"{section} {name}", "1 to 9 components", width)
            piece.decoded(section, name, rows, int(width))
