"""Other people's files: what OpenFOAM writes and reads is read, the rest is named with its remedy."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam.reader import read_case
from tests.flow.known import points
from tests.flow.openfoam.foreign import BOUNDARY, DATA, POINTS, U, change, same

NAMES = ["2d_wall", "frt:001%1", "in(1)", "a,+=~@&b", "b(c(d))e", "1"]


@pytest.mark.parametrize("name", NAMES)
def test_patches_may_have_any_name(case: Path, known: FlowField, name: str) -> None:
    """The name is nobody's business but the file's: the same bits."""
    for file in (U, BOUNDARY):
        change(case / file, rb"\blid\b", name.encode())
    assert same(read_case(case), known)


def test_names_may_be_quoted(case: Path, known: FlowField) -> None:
    change(case / BOUNDARY, rb"\blid\b", b'"the lid+"')
    change(case / U, rb"\blid\b", b'"the lid+"')
    assert same(read_case(case), known)


def test_a_binary_boundary_with_words(tmp_path: Path) -> None:
    """Foundation's versions say `format binary` there, too, and `List<word>`; the same bits."""
    copy = tmp_path / "case"
    shutil.copytree(DATA / "cavity_16_binary", copy)
    change(copy / BOUNDARY, rb"format\s+ascii", b"format binary")
    change(copy / BOUNDARY, rb"1 \( wall \)", b"List<word> 1(wall)")
    change(copy / BOUNDARY, rb"1 \( empty \)", b"List<word> \n1\n(\nempty\n)\n")
    assert same(read_case(copy), read_case(DATA / "cavity_16_binary"))


BINARY_LISTS = [
    b"names nonuniform List<word> 2(a b);", b"flags List<bool> 3(\x01\x00\x01);",
    b"flags List<bool> 3(1 0 1);", b'texts List<string> 2("a)" "b;");',
    b"table List<Tuple2<scalar,vector>> 2((0 (0 0 0)) (1 (1 2 3)));",
    b"table List<Tuple2<scalar,vector>> 1(" + np.array([0.0, 1.0, 2.0, 3.0]).tobytes() + b");",
    b"faces List<label> 2(" + np.array([1, 41], "<i4").tobytes() + b");",
    b"all List<tensor> 1(" + b")}" * 36 + b");", b"none List<vector> 0;",
]  # fmt: skip


@pytest.mark.parametrize("entry", BINARY_LISTS)
def test_lists_of_any_kind_in_a_binary_field(tmp_path: Path, entry: bytes) -> None:
    """Other entries of a patch are passed over whatever they hold, as bytes or as text."""
    copy = tmp_path / "case"
    shutil.copytree(DATA / "cavity_16_binary", copy)
    change(copy / U, rb"noSlip;", b"noSlip;\n" + entry)
    assert same(read_case(copy), read_case(DATA / "cavity_16_binary"))


WALLS = rb"walls\s*\{[^}]*\}"


@pytest.mark.parametrize(
    "entries",
    [
        b'"w.*" { type noSlip; }',
        b'".*" { type slip; } "(walls|ceiling)" { type noSlip; }',
        b'"w[a-z]+s" { type fixedValue; value uniform (0 0 0); }',
        b"walls { type slip; } walls { type noSlip; }",
        # The group is an earlier entry, and yet weaker than the name, and stronger than a pattern.
        b'ceiling { type noSlip; } "w.*" { type slip; }',
        b"ceiling { type slip; } walls { type noSlip; }",
        b"floor { type slip; } ceiling { type noSlip; }",
    ],
)
def test_patterns_and_groups_are_those_of_openfoam(
    case: Path, known: FlowField, entries: bytes
) -> None:
    """A name wins over groups, the last group over the others and over the last pattern."""
    change(case / BOUNDARY, rb"(?<=walls\n    \{\n)", b"inGroups 2(floor ceiling);\n")
    change(
        case / BOUNDARY, rb"        inGroups        1\(wall\);\n(?=        nFaces          48)", b""
    )
    change(case / U, WALLS, entries)
    assert same(read_case(case), known)


def test_the_internal_field_may_be_a_patches_value(case: Path) -> None:
    """$internalField where it is uniform: a plug flow, exactly."""
    change(case / U, rb"internalField.*?\n\)\n;", b"internalField uniform (1 -2 0);")
    change(
        case / U,
        rb"boundaryField.*",
        b"""boundaryField { ".*" { type fixedValue; value $internalField; }
        frontAndBack { type empty; } }""",
    )
    sample = read_case(case).evaluate(*points(100))
    np.testing.assert_allclose(sample.velocity_x, 1.0, rtol=1e-12)
    np.testing.assert_allclose(sample.velocity_y, -2.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("file", "pattern", "new", "told"),
    [
        (U, rb"value\s+nonuniform.*?\)\s*;", b"value $internalField;", r"lid: .*\$internalField, which"),
        (U, rb"value\s+nonuniform", b"value $inlet; x nonuniform", r"expected values written out.*\$inlet"),
        (U, rb"noSlip;", b"noSlip; $all;", r"U, line \d+: expected entries written out.*\$all"),
        (U, rb"internalField", b"internalField $x; x", r"internalField: expected values.*\$x"),
        (U, rb"walls", b'"w{3}"', r"patterns that are read here, for walls"),
        (U, rb"walls", b"others", r"expected an entry for patch walls"),
        (U, rb"noSlip", b"fixedValue", r"a value of patch walls"),
        (U, rb"\[0 1 -1 0 0 0 0\]", b"[m furlong^-1]", r"U, line \d+: expected dimensions.*furlong"),
        (U, rb"\[0 1 -1 0 0 0 0\]", b"[m^2 s^-2]", r"key dimensions: expected \[0 1 -1"),
        (U, rb"\[0 1 -1 0 0 0 0\]", b"[0 1 -1", r"expected dimensions"),
        (BOUNDARY, rb"type\s+wall", b"type wedge", r"an axisymmetric one, with wedge patches \(lid\)"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_named(
    case: Path, file: str, pattern: bytes, new: bytes, told: str
) -> None:
    change(case / file, pattern, new)
    with pytest.raises(InputError, match=told):
        read_case(case)


@pytest.mark.parametrize(
    "dimensions",
    [
        b"[m s^-1]", b"[m/s]", b"[s^-1 m]", b"[m^1 * s^(-1)]", b"[velocity]", b"[0 1 -1]", b"[0 1 -1 0 0]",
        b"[ 0 1.0 -1 0 0 0 0 ]", b"[0 1 -1 /* m/s */ 0 0 0 0]  // [m/s]\n", b"[\n0 1 -1 // m/s\n0 0 0 0]",
    ],
)  # fmt: skip
def test_dimensions_in_every_form(case: Path, known: FlowField, dimensions: bytes) -> None:
    change(case / U, rb"\[0 1 -1 0 0 0 0\]", dimensions)
    if dimensions == b"[0 1 -1]":
        with pytest.raises(InputError, match="expected dimensions"):
            read_case(case)
    else:
        assert same(read_case(case), known)


def test_comments_may_stand_anywhere(case: Path, known: FlowField) -> None:
    """In lists, between their numbers, at their ends, in patches; with quotes and marks in them."""
    change(case / POINTS, rb"\n\(0 0 0\)", b'\n// the first "\n(0 /* x */ 0 0) /* ) */')
    change(case / BOUNDARY, rb"\n\)", b"\n// no more }\n)")
    change(case / "constant/polyMesh/owner", rb"\n0\n", b"\n0 // the first cell\n")
    change(case / "constant/polyMesh/faces", rb"\n4\(", b"\n/* face 0 */4/* corners */(")
    change(case / U, rb"\n\)\n;", b"\n/* end */)\n;")
    assert same(read_case(case), known)


@pytest.mark.parametrize("before", [b"", b"// one\n// two\n", b"/* one\ntwo\n*/\n"])
def test_the_line_that_is_told_is_the_right_one(case: Path, before: bytes) -> None:
    change(case / POINTS, rb"\n\(0 0 0\)\n", b"\n" + before + b"(0 0 zero)\n")
    line = (case / POINTS).read_bytes().split(b"(0 0 zero)")[0].count(b"\n") + 1
    with pytest.raises(InputError, match=rf"points, line {line}: "):
        read_case(case)
