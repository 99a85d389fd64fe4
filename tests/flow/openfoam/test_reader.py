"""Readers: both agree, walls are honoured, and what is no solved plane case gets one message."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam.reader import read_case, read_vtk
from ellipsoid_coupling.flow.provide import SHIPPED
from tests.flow.known import mismatch, points

DATA = Path(__file__).parents[2] / "data"
Edit = Callable[[Path], None]


def test_field_is_the_cases_velocity(cavity_16: Path) -> None:
    """6.4 % rms on 16 cells, as the lid's jet is 2 cells wide; test_openfoam holds the order.

    That is at the cells' centres; the origin tells how far its means over the cells are off U.
    """
    field = read_case(cavity_16)
    assert mismatch(cavity_16, field) == pytest.approx(0.0639, abs=1e-4)
    assert field.cells == (16, 16)
    assert field.bounds == (0.0, 1.0, 0.0, 1.0)
    assert field.origin == (
        "OpenFOAM case cavity_16, time 3.95, 3.4 % off U (rms), up to 0.29 % of its largest at walls; "
        "psi from U"
    )


def test_both_readers_agree_to_single_precision(cavity_16: Path) -> None:
    """Both give single precision, 6e-8 of the lid's speed, over the mesh width: 1e-6."""
    one, other = read_case(cavity_16), read_vtk(cavity_16)
    for a, b in zip(one.evaluate(*points(500))[:2], other.evaluate(*points(500))[:2], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)
    for folder in (cavity_16 / "VTK", cavity_16 / "VTK" / "cavity_16_79"):
        np.testing.assert_array_equal(
            read_vtk(folder).arrays.coefficients, other.arrays.coefficients
        )


def test_walls_hold_and_the_lid_moves(cavity_16: Path) -> None:
    """No flow through walls to rounding; the lid's Gaussian at the nodes to 3e-3 (16 cells)."""
    field, nodes = read_case(cavity_16), np.linspace(0.0, 1.0, 17)
    along, ones = np.linspace(0.0, 1.0, 400), np.ones(400)
    for wall in (0.0, 1.0):
        assert np.abs(field.evaluate(wall * ones, along).velocity_x).max() < 1e-15
        assert np.abs(field.evaluate(along, wall * ones).velocity_y).max() < 1e-15
    lid = field.evaluate(nodes, np.ones(17)).velocity_x
    np.testing.assert_allclose(lid, np.exp(-((nodes - 0.5) ** 2) / 0.02), atol=3e-3)
    np.testing.assert_allclose(field.evaluate(0.0 * nodes, nodes).velocity_y, 0.0, atol=1e-15)


def test_the_foam_file_names_its_case(cavity_16: Path) -> None:
    field = read_case(cavity_16 / "any.foam")
    np.testing.assert_array_equal(
        field.arrays.coefficients, read_case(cavity_16).arrays.coefficients
    )


def test_graded_mesh_gives_the_same_flow() -> None:
    """12 graded cells against the shipped 100: the coarse mesh's own error, 1 % of the lid rms.

    The cells beside the lid are so coarse that the field is 5.6 % off U.
    """
    graded = read_case(DATA / "graded", allow_misfit=True)
    fine = FlowField.load(SHIPPED / "cavity.npz")
    one, other = graded.evaluate(*points(4000)), fine.evaluate(*points(4000))
    assert np.sqrt(np.mean((one.velocity_x - other.velocity_x) ** 2)) < 0.01
    assert np.abs(graded.evaluate(np.ones(50), np.linspace(0, 1, 50)).velocity_x).max() < 1e-15
    assert one.inside.all()


def test_l_shape_masks_what_is_not_flow() -> None:
    """The notch is outside; on its walls the flow is slow: 1 % of the lid's speed on 12 cells.

    The lid's jet is one cell wide there, so the field is 17 % off U: only who asks for it gets it.
    """
    expected = r"17 % off \(rms\) in the cells, most of it beside walls.*--allow-misfit"
    with pytest.raises(InputError, match=expected):
        read_case(DATA / "l_shape")
    field = read_case(DATA / "l_shape", allow_misfit=True)
    assert "17 % off U" in field.origin
    x, y = points(4000)
    np.testing.assert_array_equal(field.evaluate(x, y).inside, (x < 0.5) | (y < 0.5))
    along = np.linspace(0.6, 1.0, 50)
    on_notch = field.evaluate(along, np.full(50, 0.5))
    assert np.hypot(on_notch.velocity_x, on_notch.velocity_y).max() < 0.01


def _rewrite(pattern: str, new: str, files: str) -> Edit:
    def edit(case: Path) -> None:
        (path,) = case.glob(files)
        text, count = re.subn(pattern, new, path.read_text(encoding="utf-8"), count=1)
        assert count == 1
        path.write_text(text, encoding="utf-8")

    return edit


def _remove(files: str) -> Edit:
    def edit(case: Path) -> None:
        for path in case.glob(files):
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    return edit


# The mesh has two layers of points; a third one within it makes it 3-D.
THIRD_LAYER = (r"\(0 0 0\)", "(0 0 0.05)", "constant/polyMesh/points")
FIRST_VECTOR = r"(?<=\n\()\(\S+ \S+ \S+\)|(?<=\n)\(\S+ \S+ 0\)\n"


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (_remove("constant"), "no constant/polyMesh/points"),
        (_remove("system"), "no system/controlDict"),
        (_remove("[1-9]*"), "no time beyond 0"),
        (_remove("[1-9]*/U"), "expected a velocity field U at time 3.95"),
        (_rewrite(*THIRD_LAYER), "found a 3-D mesh"),
        (_rewrite(FIRST_VECTOR, "(nan 0 0)\n", "[1-9]*/U"), "NaN or infinite"),
    ],
)
def test_bad_case_is_an_input_error(
    cavity_16: Path, tmp_path: Path, edit: Edit, message: str
) -> None:
    case = tmp_path / "case"
    shutil.copytree(cavity_16, case)
    edit(case)
    with pytest.raises(InputError, match=message) as caught:
        read_case(case)
    assert caught.value.remedy


def test_missing_folder_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        read_case(tmp_path / "nowhere")
    with pytest.raises(InputError, match="what foamToVTK wrote"):
        read_vtk(tmp_path / "nowhere")


def _noise(case: Path) -> None:
    (path,) = case.glob("[1-9]*/streamFunction")
    noise = iter(np.random.default_rng(0).random(1000))
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"(?m)^-?\d\.\d+(e-\d+)?$", lambda _: f"{next(noise):.6f}", text)
    path.write_text(text, encoding="utf-8")


def _spoilt(case: Path) -> None:
    """Wrong at one point only, as OpenFOAM's is at two points of its elbow."""
    (path,) = case.glob("[1-9]*/streamFunction")
    text = path.read_text(encoding="utf-8")
    numbers = list(re.finditer(r"(?m)^-?\d\.\d+(e-\d+)?$", text))
    middle = numbers[9 * 17 + 8]
    path.write_text(f"{text[: middle.start()]}0.01{text[middle.end() :]}", encoding="utf-8")


@pytest.mark.parametrize("edit", [_remove("[1-9]*/streamFunction"), _noise, _spoilt])
def test_the_cases_own_stream_function_does_not_matter(
    cavity_16: Path, tmp_path: Path, edit: Edit
) -> None:
    """OpenFOAM's is 134 % off at the elbow's outlet. Nothing is written into a case either."""
    case = tmp_path / "case"
    shutil.copytree(cavity_16, case)
    edit(case)
    before = sorted(case.rglob("*"))
    found, own = read_case(case), read_case(cavity_16)
    assert sorted(case.rglob("*")) == before
    np.testing.assert_array_equal(found.arrays.coefficients, own.arrays.coefficients)


def test_a_linear_flow_is_exact() -> None:
    """The flow (-x, y) on 12 x 12 cells: inflow and outflow on all sides, no OpenFOAM here.

    The solver is 0.2 h^2/nu = 1.3e-8 off, single precision 1e-7; so are edges, corners and what
    lies outside, where the rim's polynomial goes on. Gradients lose a factor 1/h: 2e-6.
    """
    field = read_case(DATA / "top_bottom_12")
    assert field.origin.endswith("time 2.25e-05, 5.8e-07 % off U (rms); psi from U")
    assert field.bounds == (-1.5, 1.5, -1.5, 1.5)
    x, y = np.meshgrid(np.linspace(-1.8, 1.8, 145), np.linspace(-1.8, 1.8, 145))
    sample = field.evaluate(x, y)
    np.testing.assert_array_equal(sample.inside, np.maximum(np.abs(x), np.abs(y)) <= 1.5 + 1e-9)
    np.testing.assert_allclose(sample.velocity_x, -x, atol=1e-6)
    np.testing.assert_allclose(sample.velocity_y, y, atol=1e-6)
    np.testing.assert_allclose(sample.dux_dx, -1.0, atol=5e-6)
    for zero in (sample.dux_dy, sample.duy_dx):
        np.testing.assert_allclose(zero, 0.0, atol=5e-6)


@pytest.mark.parametrize("content", ["", "<VTKFile type='nonsense'/>", "not xml at all"])
def test_unreadable_vtu_is_an_input_error(tmp_path: Path, content: str) -> None:
    (tmp_path / "internal.vtu").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"internal\.vtu: expected"):
        read_vtk(tmp_path)


def test_what_meshio_says_of_a_file_stays_untold(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """It quotes the file, and what stands in brackets becomes an escape sequence."""
    content = (DATA / "cavity_16" / "VTK" / "cavity_16_79" / "internal.vtu").read_bytes()
    own = b"<FieldData><DataArray type='[red]' Name='a' NumberOfTuples='1' format='ascii'>1</DataArray>"
    (tmp_path / "internal.vtu").write_bytes(content.replace(b"<FieldData>", own))
    with pytest.raises(InputError, match="expected a file that meshio reads"):
        read_vtk(tmp_path)
    assert capfd.readouterr() == ("", "")
