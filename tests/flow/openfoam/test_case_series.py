"""A case at several times: which folders are taken, what is told of them, and what is refused."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, FlowSeries, When
from ellipsoid_coupling.flow.openfoam.case_series import read_times
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.times import choose_series
from tests.written_cases import Floats, plate, write_case, write_mesh

BOX = ((0.0, 1.0), (0.0, 1.0))
CELLS = (6, 12)
NAMES = ("0", "0.25", "0.5", "0.75", "1")
DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate that oscillates once, in five folders."""
    flows = {name: plate(float(name)) for name in NAMES}
    return write_case(tmp_path_factory.mktemp("cases") / "plate", BOX, CELLS, flows)


@pytest.fixture
def case(solved: Path, tmp_path: Path) -> Path:
    """A copy of it that may be spoilt."""
    return shutil.copytree(solved, tmp_path / "plate")


def series(flow: FlowField) -> FlowSeries:
    assert isinstance(flow, FlowSeries)
    return flow


def test_each_time_is_read_as_it_is_alone(solved: Path) -> None:
    """To the bit; `origin` says which times there are."""
    stages: list[tuple[str, float]] = []
    flow = series(read_times(solved, When("all", until=1.0), report=lambda *s: stages.append(s)))
    assert np.array_equal(flow.times, [0.0, 0.25, 0.5, 0.75, 1.0])
    for name, field in zip(NAMES, flow.steady_fields(), strict=True):
        alone = read_case(solved / name)
        assert np.array_equal(field.arrays.coefficients, alone.arrays.coefficients)
        assert field.arrays[1:9] == alone.arrays[1:9]
    assert flow.origin == "OpenFOAM case plate, 5 times from 0 to 1, linear in between"
    assert stages[0] == ("reading time 0", 0.0)
    assert stages[-1] == ("reading time 1", 1.0)


def test_the_flow_is_that_of_the_plate(solved: Path) -> None:
    """At a folder's time within the mesh's error, in between within that of a linear flow, w^2 dt^2/8."""
    flow, y = read_times(solved, When("all", until=1.0)), np.linspace(0.0, 1.0, 11)
    for t in (0.25, 0.375, 0.9):
        _, exact, _ = plate(t)(np.full(11, 0.4), y)
        found = flow.at(t).evaluate(np.full(11, 0.4), y).velocity_x
        assert np.abs(found - exact).max() < 4e-3 + (0.0 if t == 0.25 else (0.5 * np.pi) ** 2 / 8.0)
    middle = flow.at(0.375).evaluate(0.4, 0.5).velocity_x
    ends = [flow.at(t).evaluate(0.4, 0.5).velocity_x for t in (0.25, 0.5)]
    assert middle == pytest.approx(0.5 * (ends[0] + ends[1]), abs=1e-14)


@pytest.mark.parametrize(
    ("interval", "names", "start"),
    [((0.25, 0.75), NAMES[1:4], 0.25), ((0.3, 0.6), NAMES[1:4], 0.3), ((0.0, 1.0), NAMES, 0.0),
     ((0.51, 0.52), NAMES[2:4], 0.51), ((0.5, 0.75), NAMES[2:4], 0.5)],
)  # fmt: skip
def test_an_interval_is_covered_and_its_start_is_the_scene_s_0(
    interval: tuple[float, float], names: tuple[str, ...], start: float, solved: Path
) -> None:
    chosen = choose_series(solved, interval)
    assert tuple(chosen.names) == names
    assert chosen.start == start
    assert chosen.times == pytest.approx([float(name) - start for name in names], abs=1e-15)
    assert ("is the scene's 0" in chosen.note) == (start != 0.0)


def test_an_interval_is_shifted(solved: Path) -> None:
    flow = read_times(solved, When((0.3, 0.75), until=0.45))
    alone = read_times(solved, When("all", until=1.0))
    for t in (0.0, 0.2, 0.45):
        found, expected = (
            one.at(at).arrays.coefficients for one, at in ((flow, t), (alone, t + 0.3))
        )
        np.testing.assert_allclose(found, expected, atol=1e-14)


def test_one_time_is_a_steady_flow(solved: Path) -> None:
    flow = read_times(solved, When(0.5, until=7.0))
    assert not isinstance(flow, FlowSeries)
    assert flow.digest == read_case(solved / "0.5").digest


def test_a_steady_flow_in_five_folders_is_the_flow_of_one(tmp_path: Path) -> None:
    """To the bit: it is the very field, so that all models give the bits of a steady run."""
    flows = {name: plate(0.2) for name in NAMES}
    case = write_case(tmp_path / "steady", BOX, CELLS, flows)
    flow, alone = read_times(case, When("all", until=1.0)), read_case(case)
    assert not isinstance(flow, FlowSeries)
    assert flow.digest == alone.digest
    assert flow.origin == "OpenFOAM case steady, 5 times from 0 to 1, the same at all of them"


def test_what_is_missing_or_irregular_is_told(case: Path) -> None:
    (case / "0.25" / "U").unlink()
    assert choose_series(case, None).note == "4 times from 0 to 1, none of 0.25, which has no U"
    shutil.rmtree(case / "0.75")
    (case / "1").rename(case / "3")
    assert choose_series(case, None).note.endswith(", the longest step from 0.5 to 3") is False
    for name in ("0.6", "0.7", "0.8"):
        shutil.copytree(case / "0.5", case / name)
    assert choose_series(case, None).note.endswith(", the longest step from 0.8 to 3")


def refused(case: Path, when: When, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_times(case, when)


@pytest.mark.parametrize(
    ("when", "message"),
    [
        (When("all", until=1.5), r"covers the scene's times \[0, 1\.5\], found one at \[0, 1\]"),
        (When((0.25, 1.0), until=1.0), r"scene's times \[0, 1\], found one at \[0, 0\.75\]"),
        (When((0.25, 1.1), until=0.1), r"within \[0, 1\], where U is known, found \[0\.25, 1\.1\]"),
        (When((-0.25, 0.5), until=0.1), r"within \[0, 1\]"),
        (When(0.3, until=0.1), r"a time with U \(0, 0\.25, \.\.\., 1\), found 0\.3"),
        (When((0.3, 0.75), True, 9.0), r"from one time with U to another, found \[0\.3, 0\.75\]"),
        (When((0.25, 0.6), True, 9.0), r"around which these are \[0\.25, 0\.75\]"),
        (When((0.25, 0.5), True, 9.0), r"same after its period 0\.25"),
    ],
)
def test_times_that_do_not_fit_are_refused(solved: Path, when: When, message: str) -> None:
    """Before any field is read, but for a period that is none."""
    refused(solved, when, message)


def test_a_period_covers_all_times(solved: Path) -> None:
    flow = series(read_times(solved, When("all", True, 1e6)))
    assert flow.origin.endswith("linear in between, repeated every 1")
    assert flow.repeat


def test_a_case_of_one_time_is_refused(tmp_path: Path) -> None:
    case = write_case(tmp_path / "one", BOX, CELLS, {"2": plate(0.1)})
    refused(case, When("all", until=1.0), "U at several times, found 2")


@pytest.mark.parametrize("part", ["points", "whole"])
def test_a_mesh_that_changes_is_refused_with_its_place(part: str, case: Path) -> None:
    """After the first time; one that is the same for all of them is no change."""
    write_mesh(case, BOX, *CELLS, folder="0.5")
    if part == "points":
        for name in ("faces", "owner", "neighbour", "boundary"):
            (case / "0.5" / "polyMesh" / name).unlink()
    refused(case, When("all", until=1.0), r"0\.5/polyMesh/points: expected one mesh for all times")
    assert isinstance(read_times(case, When((0.5, 1.0), until=0.5)), FlowSeries)


def test_a_damaged_time_is_named(case: Path) -> None:
    data = (case / "0.75" / "U").read_bytes()
    (case / "0.75" / "U").write_bytes(data[: len(data) // 2])
    refused(case, When("all", until=1.0), r"0\.75/U")


def test_a_time_s_folder_is_refused(solved: Path) -> None:
    refused(solved / "0.5", When("all", until=1.0), "the folder of the case, found its time 0.5")


def test_foamtovtk_s_folder_of_one_time_is_refused() -> None:
    vtk = DATA / "cavity_16" / "VTK"
    refused(vtk, When("all", until=1.0), r"U at several times, found 3\.95")
    refused(vtk / "cavity_16_79", When("all", until=1.0), "folder of all times, found one of its")


def test_a_time_that_is_too_far_off_is_named(case: Path) -> None:
    """A source in U at one time, which no stream function has; --allow-misfit takes it."""

    def source(x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        return 0.0 * x, x - 0.5, y - 0.5

    other = write_case(case.parent / "source", BOX, CELLS, {"0.5": source})
    shutil.copy(other / "0.5" / "U", case / "0.5" / "U")
    refused(
        case, When("all", until=1.0), r"plate, time 0\.5: expected a velocity U without sources"
    )
    assert isinstance(read_times(case, When("all", until=1.0), allow_misfit=True), FlowSeries)


def test_a_time_near_rest_is_measured_by_the_largest_u(case: Path) -> None:
    """100 % off its own U, which is a thousandth of the others': 0.1 %, and both are told."""

    def nearly_at_rest(x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        return 0.0 * x, 1e-3 * (x - 0.5), 1e-3 * (y - 0.5)

    other = write_case(case.parent / "rest", BOX, CELLS, {"0": nearly_at_rest})
    for name in ("U", "phi"):
        shutil.copy(other / "0" / name, case / "0" / name)
    flow = read_times(case, When("all", until=1.0))
    assert isinstance(flow, FlowSeries)
    told = r", (9\d|1\d\d) % off U \(rms\) at time 0, near rest: 0\.\d+ % of the largest U$"
    assert re.search(told, flow.origin)
    with pytest.raises(InputError, match=r"whose best stream function is (9\d|1\d\d) % off"):
        read_case(case / "0")


def test_a_uniform_start_is_no_time_of_the_flow(case: Path) -> None:
    """With that a run begins: icoFoam writes it, and it is no solution."""
    header, _, rest = (case / "0" / "U").read_bytes().partition(b"internalField")
    tail = rest[rest.index(b"boundaryField") :]
    uniform = b"internalField uniform (1 0 0);\n\n"
    (case / "0" / "U").write_bytes(header + uniform + tail)
    flow = series(read_times(case, When("all", until=0.7)))
    assert flow.origin.startswith("OpenFOAM case plate, 4 times from 0.25 to 1, of which 0.25 is")
