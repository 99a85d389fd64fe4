"""Other people's folders: which time is taken, and by which paths a case is named."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, flow_at
from ellipsoid_coupling.flow.openfoam.reader import read_case, read_flow
from tests.flow.openfoam.foreign import U, change, same


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
