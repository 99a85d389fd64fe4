"""foamToVTK's files of several times: the flow of the case's own time folders, to single precision."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, FlowSeries, When, flow_at, obtain_flow
from ellipsoid_coupling.flow.openfoam.case_series import read_times
from ellipsoid_coupling.flow.openfoam.programs import foam_environment, openfoam_available
from tests.written_cases import Floats, Flow, plate, write_case
from tests.written_vtk import write_vtk

BOX, CELLS = ((0.0, 1.0), (0.0, 1.0)), (6, 12)
NAMES = ("0", "0.25", "0.5", "0.75", "1")
ALL = When("all", until=1.0)
# Of a speed of 1: U and the mesh in seven digits.
SINGLE = 2e-6


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate that oscillates once."""
    flows = {name: plate(float(name)) for name in NAMES}
    return write_case(tmp_path_factory.mktemp("cases") / "plate", BOX, CELLS, flows)


@pytest.fixture(scope="module")
def vtk(solved: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same as foamToVTK's files, apart from the case."""
    return write_vtk(solved, NAMES, tmp_path_factory.mktemp("apart") / "VTK")


def require_same(flow: FlowField, truth: FlowField, times: list[float]) -> None:
    """In velocity, on nodes and between them."""
    x, y = np.meshgrid(np.linspace(0.02, 0.98, 9), np.linspace(0.02, 0.98, 17))
    for t in times:
        found, expected = flow.at(t).evaluate(x, y), truth.at(t).evaluate(x, y)
        assert found.inside.all()
        np.testing.assert_allclose(found.velocity_x, expected.velocity_x, rtol=0, atol=SINGLE)
        np.testing.assert_allclose(found.velocity_y, expected.velocity_y, rtol=0, atol=SINGLE)


def test_a_series_is_the_flow_of_the_time_folders(solved: Path, vtk: Path) -> None:
    flow, truth = read_times(vtk, ALL), read_times(solved, ALL)
    assert isinstance(flow, FlowSeries)
    assert isinstance(truth, FlowSeries)
    np.testing.assert_array_equal(flow.times, truth.times)
    require_same(flow, truth, [0.0, 0.25, 0.3, 0.6, 1.0])
    assert flow.origin == "foamToVTK folder VTK, 5 times from 0 to 1, linear in between"
    assert flow.outline is not None
    assert flow.outline.types == ("wall", "patch", "patch", "wall")
    assert flow.outline.names == ("bottom", "left", "right", "top")
    assert flow.plane == truth.plane


def test_an_interval_a_time_and_a_period(solved: Path, vtk: Path) -> None:
    for when in (When((0.3, 0.75), until=0.45), When("all", repeat=True, until=9.0), When(0.5)):
        flow, truth = read_times(vtk, when), read_times(solved, when)
        require_same(flow, truth, [0.0, 0.2, 0.45])
        if isinstance(flow, FlowSeries):
            assert isinstance(truth, FlowSeries)
            assert (flow.repeat, flow.covers) == (truth.repeat, truth.covers)


def test_any_of_its_files_may_be_named(vtk: Path) -> None:
    """All times by the folder and the .series file; one time by its folder, .vtm and .vtu."""
    series = obtain_flow("", 0, vtk / "plate.vtm.series", when=ALL)
    assert series.digest == obtain_flow("", 0, vtk, when=ALL).digest
    assert flow_at(vtk).digest == flow_at(vtk / "plate_4").digest
    one = flow_at(vtk / "plate_2.vtm")
    assert one.digest == flow_at(vtk / "plate_2" / "internal.vtu").digest
    assert one.digest == read_times(vtk, When(0.5)).digest != flow_at(vtk).digest


def test_one_time_has_no_others(vtk: Path) -> None:
    for name in ("plate_2", "plate_2.vtm", "plate_2/internal.vtu"):
        with pytest.raises(InputError, match="the folder of all times, found one of its times"):
            read_times(vtk / name, ALL)


@pytest.mark.parametrize(
    ("when", "message"),
    [
        (When("all", until=1.5), r"covers the scene's times \[0, 1\.5\], found one at \[0, 1\]"),
        (When((0.25, 1.1), until=0.1), r"within \[0, 1\], where U is known"),
        (When(0.3), r"a time with U \(0, 0\.25, \.\.\., 1\), found 0\.3"),
        (When("all", until=1.0, divergence=True), "name the case itself instead"),
    ],
)
def test_times_that_do_not_fit_are_refused(vtk: Path, when: When, message: str) -> None:
    """As of a case."""
    with pytest.raises(InputError, match=message):
        read_times(vtk, when)


def test_a_patch_that_is_closed_for_a_while_is_no_wall(tmp_path: Path) -> None:
    """A plug that stands still at first: what its files do not tell of a time, another time does."""

    def plug(speed: float) -> Flow:
        return lambda x, y: (speed * y + 0.0 * x, speed + 0.0 * x, 0.0 * x)

    flows = {"1": plug(0.0), "2": plug(1.0)}
    case = write_case(tmp_path / "plug", BOX, (6, 6), flows)
    flow = read_times(write_vtk(case, ("1", "2"), tmp_path / "VTK"), ALL)
    assert flow.outline is not None
    assert flow.outline.types == ("wall", "patch", "patch", "wall")


def test_a_uniform_start_is_no_time_of_the_flow(tmp_path: Path) -> None:
    """With that a run begins, and it is no solution."""

    def still(x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        return 0.0 * x + 0.0 * y, 0.0 * x, 0.0 * x

    flows = {"0": still, **{name: plate(float(name)) for name in ("0.5", "1")}}
    case = write_case(tmp_path / "plate", BOX, CELLS, flows)
    flow = read_times(write_vtk(case, ("0", "0.5", "1"), tmp_path / "VTK"), When("all", until=0.5))
    assert flow.origin.startswith("foamToVTK folder VTK, 2 times from 0.5 to 1, of which 0.5 is")


def test_a_time_that_is_there_twice_is_refused(vtk: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(vtk, tmp_path / "VTK")
    shutil.copytree(copy / "plate_1", copy / "plate_7")
    with pytest.raises(InputError, match=r"plate_7: .*found time 0\.25, as in plate_1"):
        read_times(copy, ALL)


@pytest.mark.parametrize(
    "file", ["VTK/plate_4.vtk", "VTK/plate.vtk.series", "VTK", "VTK/left/left_4.vtk"]
)
def test_the_legacy_format_is_refused_with_the_case(
    file: str, solved: Path, tmp_path: Path
) -> None:
    """In one line that names its folder."""
    case = shutil.copytree(solved, tmp_path / "plate")
    for name in ("VTK/plate_4.vtk", "VTK/plate.vtk.series", "VTK/left/left_4.vtk"):
        (case / name).parent.mkdir(parents=True, exist_ok=True)
        (case / name).write_text("# vtk DataFile Version 2.0\n")
    for when in (When(), ALL):
        with pytest.raises(InputError, match=f"files for ParaView.*case itself, {case}:") as error:
            obtain_flow("", 0, case / file, when=when)
        assert "\n" not in str(error.value)


@pytest.mark.openfoam
@pytest.mark.skipif(not openfoam_available(), reason="needs OpenFOAM")
def test_what_foamtovtk_itself_writes(solved: Path, tmp_path: Path) -> None:
    """The same case through the program: XML is read, the legacy format refused."""
    case = shutil.copytree(solved, tmp_path / "plate")
    control = "application icoFoam; startFrom startTime; startTime 0; stopAt endTime; endTime 1;\n"
    control += "deltaT 0.25; writeControl timeStep; writeInterval 1;\n"
    head = "FoamFile { version 2.0; format ascii; class dictionary; object none; }\n"
    parts = "ddtSchemes gradSchemes divSchemes laplacianSchemes interpolationSchemes snGradSchemes"
    schemes = " ".join(f"{name} {{ default none; }}" for name in parts.split())
    for name, text in (("controlDict", control), ("fvSchemes", schemes), ("fvSolution", "")):
        (case / "system" / name).write_text(head + text)
    for form in ("-xml", "-legacy"):
        command = ["foamToVTK", form, "-fields", "(U)", "-name", f"VTK{form}"]
        subprocess.run(command, cwd=case, env=foam_environment(), check=True, capture_output=True)
    require_same(read_times(case / "VTK-xml", ALL), read_times(solved, ALL), [0.0, 0.3, 1.0])
    with pytest.raises(InputError, match=f"case itself, {case}:"):
        read_times(case / "VTK-legacy", ALL)
