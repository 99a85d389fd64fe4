"""Other people's cases: what OpenFOAM writes and reads is read, the rest is named with its remedy."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, flow_at
from ellipsoid_coupling.flow.openfoam.reader import read_case, read_flow
from tests.flow.known import points

DATA = Path(__file__).parents[2] / "data"
MESH_FOLDER = "constant/polyMesh"
U, BOUNDARY, POINTS = "3.95/U", "constant/polyMesh/boundary", "constant/polyMesh/points"


@pytest.fixture
def case(cavity_16: Path, tmp_path: Path) -> Path:
    """A copy of the cavity of 16 x 16 cells, without foamToVTK's files and stream function."""
    copy = tmp_path / "case"
    shutil.copytree(cavity_16, copy, ignore=shutil.ignore_patterns("VTK", "streamFunction"))
    return copy


@pytest.fixture(scope="module")
def known() -> FlowField:
    """What all of them must give."""
    return read_case(DATA / "cavity_16")


def change(path: Path, pattern: bytes, new: bytes, count: int = 1) -> None:
    """Replace a pattern, which must be there, in a file."""
    data, found = re.subn(pattern, lambda _: new, path.read_bytes(), count=count, flags=re.DOTALL)
    assert found
    path.write_bytes(data)


def same(one: FlowField, other: FlowField, accuracy: float = 0.0) -> bool:
    """Whether two fields' coefficients are the same, relative to the largest."""
    a, b = one.arrays.coefficients, other.arrays.coefficients
    return a.shape == b.shape and bool(np.abs(a - b).max() <= accuracy * np.abs(b).max())


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


def scaled(case: Path, time: str, factor: float, source: str = "3.95") -> None:
    """Another time, whose U is `factor` times as large."""
    shutil.copytree(case / source, case / time)
    text = (case / time / "U").read_text(encoding="utf-8")
    head, tail = text.split("boundaryField")
    number = re.compile(r"(?<=[( ])-?\d[\d.e-]*(?=[ )])")
    start = head.index("List<vector>")
    body = number.sub(lambda m: repr(factor * float(m[0])), head[start:])
    (case / time / "U").write_text(f"{head[:start]}{body}boundaryField{tail}", encoding="utf-8")


def told(case: Path) -> str:
    """The time in a flow's origin, and what is said of it."""
    return read_flow(case, allow_misfit=True).origin.rpartition(" % off U")[0].rpartition(", ")[0]


def test_the_time_that_is_taken_is_told(case: Path) -> None:
    """Its change since the time before is that of U in the cells, rms: here 20 %, exactly."""
    name = "OpenFOAM case case"
    assert told(case) == f"{name}, time 3.95"
    scaled(case, "3", 0.8)
    (case / "0").mkdir()
    shutil.copy(case / "3/U", case / "0/U")
    assert told(case) == f"{name}, time 3.95, the last of 2, changed by 20 % since time 3"
    assert told(case / "3") == f"{name}, time 3, one of 2"
    (case / "4" / "uniform").mkdir(parents=True)
    assert "time 3.95, the last of 2 (no U at time 4), changed by 20 %" in told(case)
    (case / "3" / "U").write_text("nothing")
    assert "not known as U there is of another kind" in told(case)


def test_time_0_and_negative_times(case: Path, known: FlowField) -> None:
    """The solution of potentialFoam stays at 0; what is uniform there is where a run begins."""
    (case / "3.95").rename(case / "0")
    assert told(case) == "OpenFOAM case case, time 0, the only one"
    assert same(read_case(case), known)
    (case / "0").rename(case / "-1e-1")
    assert told(case).endswith("time -1e-1, the only one")
    shutil.copytree(case / "-1e-1", case / "0")
    assert told(case).endswith("time 0")
    shutil.rmtree(case / "-1e-1")
    change(case / "0/U", rb"internalField.*?\n\)\n;", b"internalField uniform (0 0 0);")
    with pytest.raises(InputError, match=r"no time beyond 0, where U is uniform\. Run the solver"):
        read_case(case)


def test_the_case_may_be_named_in_many_ways(case: Path, known: FlowField) -> None:
    scaled(case, "5", 0.5)
    for name in ("x.foam", "case.OpenFOAM", "system/controlDict", "", "5"):
        assert "time 5" in flow_at(case / name, allow_misfit=True).origin
    for time in ("3.95", "3.95/"):
        assert same(flow_at(case / time), known)
    with pytest.raises(InputError, match=r"6: .*no such folder"):
        flow_at(case / "6")
    (case / "6").mkdir()
    with pytest.raises(InputError, match=r"6: expected a velocity field U, found none"):
        flow_at(case / "6")


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("a\0b", "no such folder"), ("a" * 300, "no such folder"), ("\udcff\x1b.foam", "no system"),
        ("nowhere/internal.vtu", "no such folder"), ("no.vtk", "no such folder"),
        (U, "something else"), ("constant", "no system/controlDict"), ("0.5", "no such folder"),
    ],
)  # fmt: skip
def test_what_is_no_case_is_an_input_error(
    tmp_path: Path, cavity_16: Path, name: str, found: str
) -> None:
    """In one printable line, whatever the path is."""
    with pytest.raises(InputError, match=found) as caught:
        flow_at((cavity_16 if name in (U, "constant") else tmp_path) / name)
    assert str(caught.value).isprintable()


def test_files_for_paraview_name_the_case_as_the_remedy(
    case: Path, cavity_16: Path, known: FlowField
) -> None:
    (case / "VTK").mkdir()
    (case / "VTK" / "case_79.vtk").write_text("# vtk DataFile Version 2.0\n")
    for name in ("VTK", "VTK/case_79.vtk"):
        with pytest.raises(InputError, match="Name the folder of the case itself"):
            flow_at(case / name)
    step = cavity_16 / "VTK" / "cavity_16_79"
    assert same(flow_at(step / "internal.vtu"), flow_at(step))
    assert same(flow_at(step), known, 1e-6)


def test_polyhedra_of_foamtovtk_name_the_case_as_the_remedy(
    cavity_16: Path, tmp_path: Path
) -> None:
    """Type 42 instead of 12 in three cells, in base64."""
    copy = tmp_path / "case_79"
    shutil.copytree(cavity_16 / "VTK" / "cavity_16_79", copy)
    change(copy / "internal.vtu", rb"(?<=AAEAAAAAAAAM)DAwM", b"Kioq")
    with pytest.raises(InputError, match=r"found 42\. Name the folder of the solved case"):
        flow_at(copy)


def moved(path: Path, into: Path, by: tuple[float, float, float], stretch: float = 1.0) -> None:
    """Points, x stretched and all moved, with as many digits as they need."""
    text = path.read_text(encoding="utf-8")
    vector = re.compile(r"(?m)^\((\S+) (\S+) (\S+)\)$")

    def new(found: re.Match[str]) -> str:
        x, y, z = (float(part) for part in found.groups())
        return f"({stretch * x + by[0]!r} {y + by[1]!r} {z + by[2]!r})"

    into.parent.mkdir(parents=True, exist_ok=True)
    into.write_text(vector.sub(new, text), encoding="utf-8")


@pytest.mark.parametrize("by", [(5e5, 1e6, 0.0), (-1e6, 1e6, 1e6), (0.0, 0.0, 0.0)])
def test_far_from_the_origin_the_flow_is_the_same(
    case: Path, known: FlowField, by: tuple[float, float, float]
) -> None:
    """Rounding of 1e6 is 1e-10 of a box of size 1, so is the flow's: 1e-9, gradients 1e-8. Walls hold."""
    moved(case / POINTS, case / POINTS, by)
    field = read_case(case)
    x, y = points(2000)
    there, here = field.evaluate(x + by[0], y + by[1]), known.evaluate(x, y)
    assert there.inside.all()
    for a, b in zip(there[:2], here[:2], strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-9)
    for a, b in zip(there[2:5], here[2:5], strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-8 * np.abs(b).max())
    assert field.bounds == pytest.approx((by[0], by[0] + 1, by[1], by[1] + 1), rel=1e-15)
    along = np.linspace(0.0, 1.0, 50)
    for wall in (0.0, 1.0):
        side = np.full(50, by[0] + wall)
        assert np.abs(field.evaluate(side, by[1] + along).velocity_x).max() < 1e-9


def test_an_l_shape_far_away_has_the_same_mask(tmp_path: Path) -> None:
    """Cells were lost to single precision."""
    copy = tmp_path / "case"
    shutil.copytree(DATA / "l_shape", copy)
    moved(copy / POINTS, copy / POINTS, (5e5, 1e6, 0.0))
    far, near = (read_case(c, allow_misfit=True) for c in (copy, DATA / "l_shape"))
    np.testing.assert_array_equal(far.arrays.mask, near.arrays.mask)
    assert same(far, near, 1e-9)


def test_points_that_have_moved_are_used_with_the_same_faces(case: Path) -> None:
    """Twice as wide, half as steep across: psi is the same, so u_x is, and u_y is half as large.

    U in the cells is left as it was, so the case itself is not one: only who asks for it gets it.
    """
    moved(case / POINTS, case / "3.95/polyMesh/points", (0.0, 0.0, 0.0), 2.0)
    field = read_case(case, allow_misfit=True)
    assert field.bounds == (0.0, 2.0, 0.0, 1.0)
    assert "time 3.95, mesh of time 3.95" in field.origin
    # A time before that mesh has the old one, a time behind it the new one.
    for time, bounds in (("3", (0.0, 1.0)), ("4", (0.0, 2.0))):
        shutil.copytree(case / "3.95", case / time, ignore=shutil.ignore_patterns("polyMesh"))
        assert read_flow(case / time, allow_misfit=True).bounds[:2] == bounds


def test_a_whole_mesh_in_a_time_is_used(case: Path, known: FlowField) -> None:
    shutil.copytree(case / "constant/polyMesh", case / "2/polyMesh")
    change(case / POINTS, rb"\(0 0 0\)", b"(7 7 7)")
    change(case / "constant/polyMesh/faces", rb"\n4\(", b"\n5(")
    field = read_case(case)
    assert same(field, known)
    assert "mesh of time 2" in field.origin


def test_a_mesh_of_several_cells_of_thickness_is_called_so(case: Path) -> None:
    """Two layers of the cavity's points with a third one between them; faces do not matter."""
    from ellipsoid_coupling.flow.openfoam.plane import _layers

    text = (case / POINTS).read_text(encoding="utf-8")
    rows = re.findall(r"(?m)^\((\S+) (\S+) (\S+)\)$", text)
    at = np.array(rows, np.float64)
    middle = at[at[:, 2] == 0.0] + [0.0, 0.0, 0.02]
    assert _layers(np.concatenate((at, middle))) == "a mesh 2 cells thick along z"
    assert _layers(at) == "a mesh 1 cells thick along z"


def test_sources_are_refused_unless_asked_for(case: Path) -> None:
    """U = (x, 0.3 y), a tube that fills: no stream function gives it; up to 30 % off was taken silently."""
    centres = [((i + 0.5) / 16, (j + 0.5) / 16) for j in range(16) for i in range(16)]
    body = "\n".join(f"({x:.6f} {0.3 * y:.6f} 0)" for x, y in centres)
    change(
        case / U,
        rb"internalField.*",
        f"""internalField nonuniform List<vector> 256({body});
        boundaryField {{ ".*" {{ type zeroGradient; }} }}""".encode(),
    )
    with pytest.raises(InputError, match=r"sources.*found one whose best .*% off.*--allow-misfit"):
        read_case(case)
    assert "% off U (rms)" in read_case(case, allow_misfit=True).origin


def hanging_nodes() -> tuple[list[tuple[float, float]], list[list[int]]]:
    """Points and cells, counter-clockwise: the unit square, its right half with cells half as high.

    Four cells in the middle have five corners, which makes them polyhedra.
    """
    number: dict[tuple[float, float], int] = {}
    cells = []
    for i in range(8):
        rows = 4 if i < 4 else 8
        for j in range(rows):
            x0, x1, y0, y1 = i / 8, (i + 1) / 8, j / rows, (j + 1) / rows
            middle = [(x1, 0.5 * (y0 + y1))] if i == 3 else []
            corners = [(x0, y0), (x1, y0), *middle, (x1, y1), (x0, y1)]
            cells.append([number.setdefault(corner, len(number)) for corner in corners])
    return list(number), cells


def written(path: Path, kind: str, entries: list[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    header = f"FoamFile {{ version 2.0; format ascii; class {kind}; object {path.name}; }}"
    path.write_text(f"{header}\n{len(entries)}\n(\n{chr(10).join(entries)}\n)\n", encoding="utf-8")


def test_polyhedra_in_a_case_folder_are_read(tmp_path: Path) -> None:
    """The flow (1 - x, y) on cells of four and five corners, all of them inside.

    On scattered points slopes are estimated: 2.2 % on 8 cells at most.
    """
    flat, cells = hanging_nodes()
    sides: dict[tuple[int, ...], list[int]] = {}
    for cell, corners in enumerate(cells):
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            sides.setdefault((min(a, b), max(a, b)), []).append(cell)
    ordered = sorted(sides.items(), key=lambda item: -len(item[1]))
    inside = sum(len(beside) == 2 for _, beside in ordered)
    n, mesh = len(flat), tmp_path / MESH_FOLDER
    fronts = [[c + layer * n for c in corners] for layer in (0, 1) for corners in cells]
    faces = [[a, b, b + n, a + n] for (a, b), _ in ordered] + fronts
    owner = [beside[0] for _, beside in ordered] + 2 * list(range(len(cells)))
    at = [f"({x!r} {y!r} {z})" for z in (0, 0.1) for x, y in flat]
    written(mesh / "points", "vectorField", at)
    written(mesh / "faces", "faceList", [f"{len(f)}({' '.join(map(str, f))})" for f in faces])
    written(mesh / "owner", "labelList", [f"{cell}" for cell in owner])
    written(mesh / "neighbour", "labelList", [f"{beside[1]}" for _, beside in ordered[:inside]])
    patch = "{name} {{ type {kind}; nFaces {faces}; startFace {start}; }}"
    rim = patch.format(name="rim", kind="patch", faces=len(ordered) - inside, start=inside)
    flanks = patch.format(name="flanks", kind="empty", faces=len(fronts), start=len(ordered))
    written(mesh / "boundary", "polyBoundaryMesh", [rim, flanks])
    written(tmp_path / "system/controlDict", "dictionary", [])
    middles = [np.mean([flat[a], flat[b]], axis=0) for (a, b), _ in ordered[inside:]]
    centres = [
        0.5 * (np.min(p, axis=0) + np.max(p, axis=0)) for p in ([flat[c] for c in k] for k in cells)
    ]
    lists = [
        [f"({1.0 - x!r} {y!r} 0)" for x, y in np.array(p).tolist()] for p in (centres, middles)
    ]
    texts = [f"nonuniform List<vector> {len(values)}({' '.join(values)})" for values in lists]
    written(tmp_path / "1/U", "volVectorField", [])
    (tmp_path / "1/U").write_text(
        "FoamFile { version 2.0; format ascii; class volVectorField; object U; }\n"
        f"dimensions [0 1 -1 0 0 0 0];\ninternalField {texts[0]};\n"
        f"boundaryField {{ rim {{ type fixedValue; value {texts[1]}; }} }}\n", encoding="utf-8",
    )  # fmt: skip
    x, y = points(500)
    sample = read_case(tmp_path).evaluate(x, y)
    assert sample.inside.all()
    np.testing.assert_allclose(sample.velocity_x, 1.0 - x, atol=0.03)
    np.testing.assert_allclose(sample.velocity_y, y, atol=0.03)
