"""Where a flow comes from, and that it says so."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, flow_at, obtain_flow, provide
from ellipsoid_coupling.flow.openfoam import programs
from ellipsoid_coupling.flow.openfoam.solved_cases import case_folder
from ellipsoid_coupling.flow.provide import SHIPPED
from tests.flow.known import points


@pytest.fixture
def no_openfoam(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provide, "openfoam_available", lambda: False)


@pytest.mark.usefixtures("no_openfoam")
def test_the_shipped_field_stands_in_and_says_so() -> None:
    flow = obtain_flow("cavity", 64)
    assert flow.origin.startswith("shipped, as OpenFOAM is not installed: foam_cases/cavity, 100 x")
    assert "OpenFOAM 1912" in flow.origin
    assert (SHIPPED / "cavity.npz").stat().st_size < 200_000


@pytest.mark.usefixtures("no_openfoam")
def test_a_case_that_is_not_shipped_needs_openfoam(tmp_path: Path) -> None:
    """An own case of the name cavity is not the shipped one."""
    own = shutil.copytree(case_folder("cavity"), tmp_path / "cavity")
    with pytest.raises(InputError, match="Install it: apt-get"):
        obtain_flow(str(own), 20)
    with pytest.raises(InputError, match=r"a built-in case \(cavity"):
        obtain_flow("no_such_case", 20)


def test_shipped_field_is_the_cavity() -> None:
    """Walls at rest, the lid's Gaussian at the nodes to 1e-5 (100 cells, see rectangle._along)."""
    flow, nodes = FlowField.load(SHIPPED / "cavity.npz"), np.linspace(0.0, 1.0, 101)
    lid = flow.evaluate(nodes, np.ones(101))
    np.testing.assert_allclose(lid.velocity_x, np.exp(-((nodes - 0.5) ** 2) / 0.02), atol=1e-5)
    for wall in (flow.evaluate(0.0 * nodes, nodes), flow.evaluate(nodes, 0.0 * nodes)):
        assert np.hypot(wall.velocity_x, wall.velocity_y).max() < 1e-12


def test_a_path_is_read_whatever_it_is(cavity_16: Path, tmp_path: Path) -> None:
    by_case = obtain_flow("cavity", 64, cavity_16)
    assert by_case.origin.startswith("given: OpenFOAM case cavity_16, time 3.95, 3.4 % off U (rms)")
    by_case.save(tmp_path / "flow.npz")
    for path in (cavity_16 / "VTK", cavity_16 / "VTK" / "cavity_16_79", tmp_path / "flow.npz"):
        sample = flow_at(path).evaluate(*points(50))
        expected = by_case.evaluate(*points(50)).velocity_x
        np.testing.assert_allclose(sample.velocity_x, expected, atol=1e-6)


def test_a_missing_path_is_an_input_error(tmp_path: Path) -> None:
    for name in ("nowhere", "nowhere.npz"):
        with pytest.raises(InputError, match="nowhere"):
            flow_at(tmp_path / name)
    with pytest.raises(InputError, match="system/controlDict"):
        flow_at(tmp_path)


def test_neither_pyvista_nor_meshio_is_imported_with_the_package() -> None:
    """They take a second, which every start would pay."""
    program = (
        "import sys, ellipsoid_coupling.flow\n"
        "print({'pyvista', 'meshio', 'vtk'} & set(sys.modules))"
    )
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert found.stdout.strip() == "set()"


@pytest.mark.openfoam
@pytest.mark.skipif(not programs.openfoam_available(), reason="OpenFOAM is not installed")
@pytest.mark.usefixtures("own_cache")
def test_solved_then_from_the_cache() -> None:
    first, second = obtain_flow("cavity", 16), obtain_flow("cavity", 16)
    assert first.origin.startswith("new icoFoam run: OpenFOAM case cavity-16-")
    assert second.origin.startswith("cache: OpenFOAM case cavity-16-")
    np.testing.assert_array_equal(first.arrays.coefficients, second.arrays.coefficients)
