"""A whole export, read back."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import pyvista

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.paraview import export
from ellipsoid_coupling.result import Result


def read_series(path: Path, time: float) -> pyvista.DataSet:
    reader = pyvista.PVDReader(str(path))
    reader.set_active_time_value(time)
    block = reader.read()[0]
    assert isinstance(block, pyvista.DataSet)
    return block


def test_particle_result(particle_result: Result, lid_flow: FlowField, tmp_path: Path) -> None:
    folder = export(particle_result, tmp_path / "paraview", lid_flow)
    series = sorted(file.name for file in folder.glob("*.pvd"))
    assert series == ["ellipses.pvd", "histogram.pvd", "particles.pvd"]
    for name in series:
        times = pyvista.PVDReader(str(folder / name)).time_values
        assert list(times) == list(particle_result.times)
    last = read_series(folder / "particles.pvd", particle_result.times[1])
    np.testing.assert_array_equal(last.points[:, 0], particle_result.variables["x"][1, 0])
    assert len(list(folder.glob("flow*"))) == 5
    assert (folder / "open_in_paraview.py").is_file()


def test_all_or_one_realisation(particle_result: Result, tmp_path: Path) -> None:
    time = particle_result.times[0]
    everything = export(particle_result, tmp_path / "all", realisation=None)
    assert read_series(everything / "particles.pvd", time).n_points == 90
    assert read_series(everything / "ellipses.pvd", time).n_cells == 30
    one = read_series(
        export(particle_result, tmp_path / "one", realisation=2) / "ellipses.pvd", time
    )
    assert set(one.cell_data["realisation"]) == {2}
    with pytest.raises(InputError, match="from 0 to 2"):
        export(particle_result, tmp_path / "none", realisation=3)


@pytest.mark.parametrize("kind", ["rho_result", "q_result"])
def test_grid_result(kind: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    result: Result = request.getfixturevalue(kind)
    folder = export(result, tmp_path)
    assert [file.name for file in folder.glob("*.pvd")] == ["fields.pvd"]
    image = read_series(folder / "fields.pvd", result.times[1])
    names = {"density", "mean_angle", "velocity", "speed", "angular_velocity"}
    names |= {"orientation", "angle", "S"}
    assert set(image.cell_data.keys()) - {"alignment"} == names
    np.testing.assert_array_equal(image.cell_data["density"], result.cell_density()[1].ravel())
    assert ("alignment" in image.cell_data) == (kind == "q_result")


def test_importing_the_module_does_not_load_pyvista() -> None:
    code = "import ellipsoid_coupling.output.paraview, sys; sys.exit('pyvista' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
