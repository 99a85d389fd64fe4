"""Small or large files that would fill the memory or take minutes are refused before they do.

What is counted is memory (tracemalloc: all of Python's and numpy's) and what is unpacked, not time.
"""

from __future__ import annotations

import gzip
import io
import re
import shutil
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.reading import unpack, unpack_beginning
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam import entries, files
from ellipsoid_coupling.flow.openfoam.fields import read_boundary
from ellipsoid_coupling.flow.openfoam.files import open_file, read_labels, read_numbers
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.vtk_files import check_internal

DATA = Path(__file__).parents[2] / "data"
MEGABYTE = 1_000_000
MESH = "constant/polyMesh"
HEADER = b"FoamFile { version 2.0; format ascii; class %s; object %s; }\n"


@contextmanager
def at_most(megabytes: float) -> Iterator[None]:
    """Fail if more memory than that is taken on top of what there is."""
    tracemalloc.start()
    try:
        yield
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < megabytes * MEGABYTE, peak


@pytest.fixture
def case(tmp_path: Path) -> Path:
    copy = tmp_path / "case"
    shutil.copytree(DATA / "cavity_16", copy)
    return copy


def pack(path: Path, beginning: bytes, filling: bytes, times: int, end: bytes = b"") -> None:
    """Instead of `path` a gzip file: beginning, filling so many times, end."""
    path.unlink(missing_ok=True)
    packer = zlib.compressobj(9, wbits=31)
    parts = [packer.compress(beginning)]
    parts += [packer.compress(filling * 10_000) for _ in range(times // 10_000)]
    path.with_name(f"{path.name}.gz").write_bytes(
        b"".join(parts) + packer.compress(end) + packer.flush()
    )


@pytest.mark.parametrize(
    ("file", "filling"),
    [
        ("3.95/U", b"          "), ("3.95/U", b"a { b c; }\n"), ("3.95/U", b'"\\\\\\\\\\\\" '),
        (f"{MESH}/points", b"(0 0 0)\n  "), (f"{MESH}/points", b"// nothing\n"),
        (f"{MESH}/owner", b"0 0 0 0 0 "), (f"{MESH}/faces", b"3(0 1 2) \n"),
        (f"{MESH}/boundary", b"List<word> "),
    ],
)  # fmt: skip
def test_packed_files_are_unpacked_as_far_as_a_plane_case_needs(
    case: Path, file: str, filling: bytes
) -> None:
    """30 MB in 30 kB, of which at most 4 MB are unpacked: 256 cells need less."""
    pack(case / file, (case / file).read_bytes(), filling, 3_000_000)
    with at_most(15), pytest.raises(InputError, match=r"\.gz: .*at most .*, unpacked"):
        read_case(case)


def test_a_count_that_is_claimed_is_looked_at_first(tmp_path: Path) -> None:
    """More entries than a plane mesh can have are refused unread, others unpacked up to their need."""
    path = tmp_path / "owner"
    header = HEADER % (b"labelList", b"owner")
    pack(path, header + b"5000001\n(", b"0 ", 1_000_000)
    with at_most(5), pytest.raises(InputError, match="at most 5000000 entries, found 5000001"):
        open_file(path, "labelList")
    pack(path, header + b"1000\n(", b"0 ", 1_000_000)
    with at_most(5), pytest.raises(InputError, match=r"at most 89\.5 kB, unpacked"):
        open_file(path, "labelList")


@pytest.mark.parametrize("width", [1, 3])
def test_memory_is_a_small_multiple_of_the_file(tmp_path: Path, width: int) -> None:
    """300 000 numbers in ascii, 0.6 to 0.8 MB of text: the text, twice, and the numbers, twice."""
    kind = (b"labelList", b"vectorField")[width == 3]
    count = 300_000 // width
    path = tmp_path / "list"
    entry = b"0\n" if width == 1 else b"(0 0 0)\n"
    path.write_bytes(HEADER % (kind, b"list") + b"%d\n(\n" % count + entry * count + b")\n")
    with at_most(9):
        file = open_file(path, kind.decode())
        if width == 1:
            read_labels(file, file.start, count, "labels")
        else:
            read_numbers(file, file.start, 3, count, "points")


def test_no_line_is_counted_where_nothing_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To count it for every token took minutes for a dictionary of 44 kB, packed."""

    def refused(_data: bytes, _at: int) -> int:
        raise AssertionError("a line was counted")

    for module in (entries, files):
        monkeypatch.setattr(module, "line_of", refused)
    path = tmp_path / "boundary"
    body = b"1\n(\nall { type patch; startFace 4; nFaces 2; note ( %s ); }\n)\n" % (
        b"a { b; } " * 20_000
    )
    path.write_bytes(HEADER % (b"polyBoundaryMesh", b"boundary") + body)
    with at_most(10):
        assert [patch.name for patch in read_boundary(path, 4, 6)] == ["all"]


def test_gzip_files_of_many_parts_are_refused(tmp_path: Path) -> None:
    """Each part costs a copy of the rest: a million of them would take hours."""
    data = gzip.compress(b"") * 1_000
    with pytest.raises(InputError, match="more than 16 parts"):
        unpack(data, tmp_path, "a file", 100)
    two = gzip.compress(b"one ") + gzip.compress(b"two")
    assert unpack(two, tmp_path, "a file", 7) == b"one two"
    assert unpack_beginning(two, tmp_path, "a file", 5) == b"one t"
    with pytest.raises(InputError, match="at most 6 bytes"):
        unpack(two, tmp_path, "a file", 6)


ARRAY = rb"(<DataArray[^>]*Name='%s'[^>]*>)[^<]*"
Edit = Callable[[bytes], bytes]


def _text(name: bytes, text: bytes) -> Edit:
    return lambda data: re.sub(ARRAY % name, lambda m: m[1] + text, data, count=1)


def _ascii(name: bytes, text: bytes) -> Edit:
    def edit(data: bytes) -> bytes:
        found = re.search(ARRAY % name, data)
        assert found is not None
        tag = found[1].replace(b"format='binary'", b"format='ascii'")
        return data[: found.start()] + tag + text + data[found.end() :]

    return edit


def _behind(mark: bytes, text: bytes) -> Edit:
    return lambda data: data.replace(mark, mark + text, 1)


@pytest.mark.parametrize(
    ("edit", "told"),
    [
        (_text(b"U", b"A " * 5_000_000), "CellData U: expected 768 numbers, found 10 MB"),
        (_text(b"U", b"\n" * 10_000_000), "CellData U: expected 768 numbers, found 10 MB"),
        (_ascii(b"U", b"0 " * 5_000_000), "CellData U: expected 768 numbers, found 10 MB"),
        (_ascii(b"types", b"1" * 5_000), "expected numbers, found .*"),
        (_behind(b"<UnstructuredGrid>", b"\n" * 2_000_000), "2 MB that are no arrays"),
        (_behind(b"<UnstructuredGrid>", b"<a/>" * 2_000_000), "one of more than 2000"),
        (_behind(b"<UnstructuredGrid>", b"<!---->" * 1_000_000), "one of more than 2000"),
        (_behind(b"<UnstructuredGrid>", b"<a>" * 100), "nested more than 50 deep"),
        (_behind(b"<UnstructuredGrid", b' a="b"' * 1_000), "of more than 4096 bytes"),
        (_behind(b"<UnstructuredGrid>", b"<![CDATA[x]]>"), "a declaration"),
        (_behind(b"<?xml version='1.0'?>", b"<!DOCTYPE a [<!ENTITY b 'c'>]>"), "a declaration"),
        (_behind(b"<?xml version='1.0'?>", b"<!DOCTYPE a SYSTEM 'file:///b'>"), "a declaration"),
        (_behind(b"<?xml version='1.0'?>", b"<?xml-stylesheet href='a'?>"), "a declaration"),
        (_behind(b"<?xml version='1.0'", b" encoding = 'UTF-7'"), "a declaration"),
        (_behind(b"<?xml version='1.0'", b' encoding="latin-1"'), "a declaration"),
        (lambda data: data.decode().encode("utf-16"), "a zero byte"),
        (lambda data: data.replace(b"Cells='256'", b"Cells='90000000'"), "cells up to 5000000"),
        (lambda data: data.replace(b"Cells='256'", b"Cells='4999999'"), "types: expected 4999999"),
    ],
)  # fmt: skip
def test_vtk_files_are_looked_at_before_they_are_read(
    tmp_path: Path, edit: Edit, told: str
) -> None:
    """Files of up to 14 MB: their bytes and a copy, and no object for every blank of theirs."""
    path = tmp_path / "internal.vtu"
    path.write_bytes(edit((DATA / "cavity_16/VTK/cavity_16_79/internal.vtu").read_bytes()))
    with at_most(5 + 4e-6 * path.stat().st_size), pytest.raises(InputError, match=told):
        check_internal(path)


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_array_that_unpacks_to_more_than_it_says_is_refused(tmp_path: Path, method: int) -> None:
    """100 MB are in it, of which 10 MB are unpacked at most: zipfile unpacks to the end and cuts then."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", method) as archive, archive.open("mask.npy", "w") as file:
        for _ in range(10):
            file.write(bytes(10_000_000))
    data = bytearray(memory.getvalue())
    size = data.rindex(b"PK\x01\x02") + 24
    data[size : size + 4] = (1_000).to_bytes(4, "little")
    (tmp_path / "flow.npz").write_bytes(data)
    with at_most(10), pytest.raises(InputError, match=r"flow\.npz: expected a flow saved"):
        FlowField.load(tmp_path / "flow.npz")


def test_an_archive_of_very_many_arrays_is_refused_before_it_is_listed(tmp_path: Path) -> None:
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        for number in range(20):
            archive.writestr(f"{number}.npy", b"")
    (tmp_path / "flow.npz").write_bytes(memory.getvalue())
    with pytest.raises(InputError, match=r"at most \d+ arrays"):
        FlowField.load(tmp_path / "flow.npz")


def test_very_many_patterns_on_very_many_patches_are_refused(case: Path) -> None:
    """Each is tried on each: a megabyte of them took hours."""
    boundary, u = case / MESH / "boundary", case / "3.95" / "U"
    text = boundary.read_text("utf-8")
    number = re.search(r"\n(\d+)\s*\(", text)
    last = text.rindex(")")
    assert number is not None
    faces = sum(map(int, re.findall(r"nFaces\s+(\d+)", text)))
    start = min(map(int, re.findall(r"startFace\s+(\d+)", text)))
    more = "".join(
        f"more{k} {{ type wall; nFaces 0; startFace {start + faces}; }}\n" for k in range(200)
    )
    text = text[:last] + more + text[last:]
    boundary.write_text(text.replace(number[0], f"\n{int(number[1]) + 200}\n(", 1), "utf-8")
    patterns = "".join(f'"x{k}.*" {{ type noSlip; }}\n' for k in range(60))
    fields = u.read_text("utf-8")
    opening = re.search(r"boundaryField\s*\{", fields)
    assert opening is not None
    u.write_text(fields.replace(opening[0], opening[0] + patterns, 1), "utf-8")
    with pytest.raises(InputError, match=r"60 for 20\d patches"):
        read_case(case)
