"""Solving a case: by itself, by solve_case, from the cache, in parallel, and every way to fail."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField, WallVelocity, analytic_flow
from ellipsoid_coupling.flow.openfoam import solve
from ellipsoid_coupling.flow.openfoam.dictionary import Column, parse
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.openfoam.scanner import Source
from ellipsoid_coupling.flow.openfoam.solve import parameter, solve_case
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder, content_hash, inputs_hash
from tests.flow.known import mismatch, points
from tests.flow.openfoam.installed import needs_openfoam


def _copy(tmp_path: Path, file: str = "", old: str = "", new: str = "") -> Path:
    """A copy of the cavity on 16 cells, with one text in one file replaced."""
    case = tmp_path / "own"
    shutil.copytree(case_folder("cavity"), case)
    for name, before, after in (
        ("system/parameters", "cells       100;", "cells 16;"),
        (file or "system/parameters", old, new),
    ):
        text = (case / name).read_text(encoding="utf-8")
        assert before in text
        (case / name).write_text(text.replace(before, after), encoding="utf-8")
    return case


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.parametrize("processes", [1, 2])
def test_the_case_runs_and_cleans_by_itself(tmp_path: Path, processes: int) -> None:
    case = _copy(tmp_path, "system/parameters", "processes   1;", f"processes {processes};")
    before = sorted(path.name for path in case.iterdir())
    subprocess.run([case / "Allrun"], check=True, capture_output=True)
    assert read_case(case).cells == (16, 16)
    subprocess.run([case / "Allclean"], check=True)
    assert sorted(path.name for path in case.iterdir()) == before


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_solved_once_then_cached_and_equal_on_two_processes(tmp_path: Path) -> None:
    """The stopping criterion leaves 1.5e-9 of the lid's speed, single precision 1e-6 of it."""
    told: list[tuple[str, float]] = []
    solved = solve_case("cavity", 20, report=lambda stage, done: told.append((stage, done)))
    assert told[-1] == ("flow cavity, 20 cells: at rest", 1.0)
    # One text per stage: the reporter takes another text for another stage.
    stages = ["mesh", "icoFoam", "stream function", "at rest"]
    assert list(dict(told)) == [f"flow cavity, 20 cells: {stage}" for stage in stages]
    assert [done for _, done in told] == sorted(done for _, done in told)
    changed = (solved / "case.foam").stat().st_mtime_ns
    assert solve_case("cavity", 20, processes=2) == solved
    assert (solved / "case.foam").stat().st_mtime_ns == changed

    parallel = solve_case("cavity", 20, processes=2, out=tmp_path / "parallel")
    assert not list(parallel.glob("processor*"))
    one, other = (read_case(case).evaluate(*points(500)) for case in (solved, parallel))
    np.testing.assert_allclose(one.velocity_x, other.velocity_x, atol=1e-6)
    np.testing.assert_allclose(one.velocity_y, other.velocity_y, atol=1e-6)


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_the_field_meets_the_solvers_velocity_at_second_order() -> None:
    """Both are second order; measured 5.1 from 25 to 50 cells and 4.1 from 50 to 100."""
    solved = [solve_case("cavity", cells) for cells in (25, 50)]
    coarse, fine = (mismatch(case, read_case(case)) for case in solved)
    assert 3.5 < coarse / fine < 6.0


def _by_fluxes(case: Path, cells: int) -> FlowField:
    """The spline through the stream function that OpenFOAM has summed up from the face fluxes."""
    (path,) = (time / "streamFunction" for time in case.glob("[1-9]*"))
    values = parse(Source(path, path.read_text("latin-1")), longest=10**6).entries["internalField"]
    assert isinstance(values, tuple)
    assert isinstance(values[1], Column)
    # The mesh's points in front, x fastest; behind them come those at the other end of its depth.
    psi = values[1].values.ravel()[: (cells + 1) ** 2].reshape(cells + 1, cells + 1)
    nodes = np.linspace(0.0, 1.0, cells + 1)
    still = np.zeros(cells + 1)
    walls = WallVelocity(still, still, still, np.exp(-((nodes - 0.5) ** 2) / 0.02))
    return FlowField.from_stream_function(psi, nodes, nodes, "by fluxes", walls)


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_the_fit_to_u_meets_the_face_fluxes_at_second_order() -> None:
    """The same flow by another second-order way from cells to faces.

    Measured: 2.3e-3, 7.1e-4, 1.9e-4 rms on 25, 50, 100 cells: 3.3, 3.8.
    """
    distances = []
    for cells in (25, 50):
        case = solve_case("cavity", cells)
        own = _by_fluxes(case, cells).evaluate(*points(4000))
        fitted = read_case(case).evaluate(*points(4000))
        squared = (own.velocity_x - fitted.velocity_x) ** 2
        distances.append(np.sqrt(np.mean(squared + (own.velocity_y - fitted.velocity_y) ** 2)))
    assert 3.0 < distances[0] / distances[1] < 5.0, distances


def _in_cells(case: Path) -> NDArray[np.float64]:
    """U (C, 2) as the solver has written it, in double precision."""
    (path,) = (time / "U" for time in case.glob("[1-9]*"))
    block = re.search(r"List<vector>\s+\d+\s+\((.*?)\n\)", path.read_text("utf-8"), re.DOTALL)
    assert block is not None
    return np.array(
        [line.strip("()").split()[:2] for line in block[1].split("\n") if line], np.float64
    )


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
@pytest.mark.parametrize("name", ["top_bottom", "rotation"])
def test_linear_flows_are_solved_to_the_closed_form(name: str) -> None:
    """In cells 0.2 h^2/nu = 4.6e-9 and what the solvers leave; the field is single precision.

    On the edges and in the corners, too: the boundary velocity is exact there.
    """
    case = solve_case(name, 20)
    assert not list(case.glob("*/streamFunction"))
    exact = analytic_flow(name)
    middle = -1.5 + 3.0 * (np.arange(20) + 0.5) / 20
    closed = exact.evaluate(*np.meshgrid(middle, middle))
    expected = np.stack((closed.velocity_x.ravel(), closed.velocity_y.ravel()), axis=-1)
    assert np.abs(_in_cells(case) - expected).max() < 1e-8

    field = read_case(case)
    assert float(field.origin.rpartition(" % off U (rms)")[0].rpartition(", ")[2]) < 1e-5
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 91), np.linspace(-1.5, 1.5, 91))
    found, closed = field.evaluate(x, y), exact.evaluate(x, y)
    assert found.inside.all()
    for a, b in zip(found[:2], closed[:2], strict=True):
        np.testing.assert_allclose(a, b, atol=5e-7)
    for a, b in zip(found[2:5], closed[2:5], strict=True):
        np.testing.assert_allclose(a, b, atol=1e-5)


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.parametrize("name", ["top_bottom", "rotation"])
def test_linear_cases_run_and_clean_by_themselves(tmp_path: Path, name: str) -> None:
    case = shutil.copytree(case_folder(name), tmp_path / name)
    before = sorted(path.name for path in case.iterdir())
    subprocess.run([case / "Allrun"], check=True, capture_output=True)
    assert read_case(case).cells == (60, 60)
    subprocess.run([case / "Allclean"], check=True)
    assert sorted(path.name for path in case.iterdir()) == before


@pytest.mark.openfoam
@needs_openfoam
def test_a_coarse_start_gives_the_same_flow(
    own_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mapping changes the start, not the rest: equal to single precision.

    Nothing is mapped from the cache: a dictionary that somebody left there is read by no program.
    """
    direct = read_case(solve_case("cavity", 20, out=tmp_path / "direct"))
    coarse = solve_case("cavity", 10)
    (coarse / "system" / "controlDict").write_text("#codeStream { }", encoding="utf-8")
    monkeypatch.setattr(solve, "MAPPED_FROM", 20)
    told: list[tuple[str, float]] = []
    mapped = read_case(solve_case("cavity", 20, report=lambda *what: told.append(what)))
    assert "flow cavity, 20 cells: first on 10 cells, icoFoam" in dict(told)
    assert [done for _, done in told] == sorted(done for _, done in told)
    assert len(list((own_cache / "flows").iterdir())) == 2
    for a, b in zip(
        direct.evaluate(*points(500))[:2], mapped.evaluate(*points(500))[:2], strict=True
    ):
        np.testing.assert_allclose(a, b, atol=1e-6)


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_a_broken_case_quotes_the_log(tmp_path: Path) -> None:
    case = _copy(tmp_path, "0.orig/U", "noSlip", "noSuchCondition")
    with pytest.raises(RunError, match="icoFoam ended with status 1") as caught:
        solve_case(case, trust=True)
    text = str(caught.value)
    assert "noSuchCondition" in text or "FOAM exiting" in text
    log = Path(text.split("The end of ")[1].split(":\n")[0])
    assert log.is_file()


@pytest.mark.openfoam
@needs_openfoam
def test_not_at_rest_is_an_error_and_no_result(own_cache: Path, tmp_path: Path) -> None:
    case = _copy(tmp_path, "system/parameters", "endTime     20;", "endTime 0.5;")
    with pytest.raises(RunError, match=r"not at rest at endTime 0\.5"):
        solve_case(case)
    assert [path.name.endswith("-failed") for path in (own_cache / "flows").iterdir()] == [True]
    # A failed run replaces an earlier one, and nothing else that is called so.
    target, own = tmp_path / "out", tmp_path / "out-failed" / "thesis.txt"
    own.parent.mkdir()
    own.write_text("years of work", encoding="utf-8")
    with pytest.raises(RunError, match=r"out-failed-[0-9a-f]{8}/log\.icoFoam"):
        solve_case(case, out=target)
    assert own.read_text(encoding="utf-8") == "years of work"
    own.rename(tmp_path / "thesis.txt")
    own.parent.rmdir()
    for _ in range(2):
        with pytest.raises(RunError, match=r"out-failed/log\.icoFoam"):
            solve_case(case, out=target)
    assert len(list(tmp_path.glob("out-failed*"))) == 2


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_a_folder_with_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("years of work", encoding="utf-8")
    with pytest.raises(InputError, match="Name another folder"):
        solve_case("cavity", 16, out=tmp_path)
    with pytest.raises(InputError, match="at least 4 cells"):
        solve_case("cavity", 2)


def test_no_solution_goes_among_the_files_of_its_case(tmp_path: Path) -> None:
    case = _copy(tmp_path)
    with pytest.raises(InputError, match="a folder that is no part of the case"):
        solve_case(case, out=case / "system" / "out")
    assert not (case / "system" / "out").exists()


@pytest.mark.openfoam
@needs_openfoam
def test_a_mesh_of_two_layers_is_refused_before_it_is_solved(
    own_cache: Path, tmp_path: Path
) -> None:
    case = _copy(tmp_path, "system/blockMeshDict", "($cells $cells 1)", "($cells $cells 2)")
    told: list[str] = []
    with pytest.raises(InputError, match=r"own: expected a plane case, .* 2 cells thick along z"):
        solve_case(case, report=lambda stage, _: told.append(stage))
    assert told == ["flow own, 16 cells: mesh"]
    assert not list((own_cache / "flows").iterdir())


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.usefixtures("own_cache")
def test_a_trusted_case_is_copied_without_pipes_and_links_to_nowhere(tmp_path: Path) -> None:
    case = _copy(tmp_path)
    os.mkfifo(case / "constant" / "pipe")
    (case / "system" / "nowhere").symlink_to(tmp_path / "nowhere")
    solved = solve_case(case, 8, trust=True)
    assert (solved / "system" / "blockMeshDict").is_file()
    assert not (solved / "constant" / "pipe").exists()


@pytest.mark.openfoam
@needs_openfoam
def test_the_hash_knows_inputs_but_not_processes(tmp_path: Path) -> None:
    case = _copy(tmp_path)
    first = inputs_hash(case, 16)
    parameters = case / "system" / "parameters"
    text = parameters.read_text(encoding="utf-8")
    parameters.write_text(text.replace("processes   1;", "processes   4;"), encoding="utf-8")
    assert inputs_hash(case, 16) == first
    assert inputs_hash(case, 17) != first
    parameters.write_text(text.replace("1e-9", "1e-8"), encoding="utf-8")
    assert inputs_hash(case, 16) != first
    # What follows a number of cells in a comment is content.
    parameters.write_text("/*\ncells 16 */ atRest 1e-8;", encoding="utf-8")
    second = inputs_hash(case, 16)
    parameters.write_text("/*\ncells 16 */ atRest 1e-7;", encoding="utf-8")
    assert inputs_hash(case, 16) not in (first, second)


def test_the_content_knows_every_file_that_is_read(tmp_path: Path) -> None:
    """Where the case lies does not matter; links to folders are followed; two files are not one."""
    case = _copy(tmp_path)
    first = content_hash(case)
    (tmp_path / "polyMesh").mkdir()
    moved = case.rename(tmp_path / "polyMesh" / "own")
    assert content_hash(moved) == first
    control = moved / "system" / "controlDict"
    control.write_text(control.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    second = content_hash(moved)
    assert second != first
    (moved / "system" / "blockMeshDict").unlink()
    points = tmp_path / "mesh" / "points"
    points.parent.mkdir()
    (moved / "constant" / "polyMesh").symlink_to(points.parent)
    found = set()
    for text in ("one", "two"):
        points.write_text(text, encoding="utf-8")
        found.add(content_hash(moved))
    (moved / "constant" / "a").write_bytes(b"xconstant/b\0y")
    found.add(content_hash(moved))
    (moved / "constant" / "a").write_bytes(b"x")
    (moved / "constant" / "b").write_bytes(b"y")
    assert len(found | {second, content_hash(moved)}) == 5
    (moved / "constant" / "loop").symlink_to(moved)
    (moved / "constant" / "loop2").symlink_to(moved)
    with pytest.raises(InputError, match="at most 2000 files"):
        content_hash(moved)


@pytest.mark.openfoam
@needs_openfoam
def test_a_case_that_changes_while_it_is_solved(own_cache: Path, tmp_path: Path) -> None:
    """Its solution is not kept under the name of what the case has become, nor of what it was."""
    case = _copy(tmp_path)

    def change(stage: str, _done: float) -> None:
        if stage.endswith("mesh"):
            (case / "system" / "fvSchemes").write_text("// changed", encoding="utf-8")

    with pytest.raises(RunError, match="own has changed while it was solved"):
        solve_case(case, report=change)
    assert not list((own_cache / "flows").iterdir())


def test_an_unknown_case_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"a built-in case \(.*cavity"):
        case_folder("no_such_case")


def test_a_case_without_parameters_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="an entry 'cells VALUE;'"):
        parameter(tmp_path, "cells")


def test_missing_openfoam_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(RunError, match="apt-get install -y --no-install-recommends openfoam"):
        solve_case("cavity", 16)
