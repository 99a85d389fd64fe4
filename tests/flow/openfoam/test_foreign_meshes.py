"""Other people's meshes: far away, moved, of several times, with hanging nodes; and flows with sources."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam.plane import _layers
from ellipsoid_coupling.flow.openfoam.reader import read_case, read_flow
from tests.flow.known import points
from tests.flow.openfoam.foreign import DATA, MESH_FOLDER, POINTS, U, change, same


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
    shutil.copytree(case / MESH_FOLDER, case / "2/polyMesh")
    change(case / POINTS, rb"\(0 0 0\)", b"(7 7 7)")
    change(case / f"{MESH_FOLDER}/faces", rb"\n4\(", b"\n5(")
    field = read_case(case)
    assert same(field, known)
    assert "mesh of time 2" in field.origin


def test_a_mesh_of_several_cells_of_thickness_is_called_so(case: Path) -> None:
    """Two layers of the cavity's points with a third one between them; faces do not matter."""
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
