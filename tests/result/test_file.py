"""result.nc for other programs: the rules of CF, empty cells, packing; opened by xarray alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import ellipsoid_coupling as ec
from ellipsoid_coupling.result import DIMENSIONS, Layout, Result
from ellipsoid_coupling.scenes import load_scene
from tests.known_axes import even_axis

SIZES = {"time": 3, "realisation": 2, "particle": 5, "angle": 4, "y": 6, "x": 7}
# The units that this package writes, as UDUNITS reads them.
BARE = {"1", "rad", "rad-1"}
SI = {"1", "rad", "s", "m", "m s-1", "rad s-1", "m-2", "m-2 rad-1"}


def some_result(layout: Layout, settings: dict[str, Any] | None = None) -> Result:
    """Random numbers; density 0 in one column of cells."""
    scene = load_scene("top_bottom", settings or {})
    times = np.array(scene.times)
    shape = (times.size, *(SIZES[name] for name in DIMENSIONS[layout][1:]))
    random = np.random.default_rng(1)
    names = {
        "particles": ("x", "y", "angle"), "rho": ("density", "mean_angle"), "q": ("density",),
    }[layout]  # fmt: skip
    names = (*names, "velocity_x", "velocity_y", "angular_velocity")
    variables = {name: random.random(shape) + 0.1 for name in names}
    if layout != "particles":
        for name in names:
            variables[name][..., 2] = 0.0
    axes = () if layout == "particles" else DIMENSIONS[layout][1:]
    coordinates = {name: even_axis(scene, name, SIZES[name]) for name in axes}
    told = {"status": "completed", "seed": 0, "steps": 4}
    return Result(scene, "any", "accurate", layout, times, variables, coordinates, told)


LAYOUTS: list[Layout] = ["particles", "rho", "q"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("units", [None, "SI"])
def test_the_file_keeps_the_rules_of_cf(layout: Layout, units: str | None, tmp_path: Path) -> None:
    """CF-1.11: 2.6.1 Conventions, 2.4 coordinates, 3.1 units, 3.2 long_name, 4 axis, 2.5.1 fill values."""
    some_result(layout, {"units": units}).save(tmp_path / "result.nc")
    with xr.open_dataset(tmp_path / "result.nc", engine="h5netcdf", decode_cf=False) as raw:
        assert raw.attrs["Conventions"] == "CF-1.11"
        for name in ("title", "source", "references"):
            assert raw.attrs[name]
        for dimension, size in raw.sizes.items():
            values = raw[dimension].to_numpy()
            assert values.shape == (size,)
            assert (np.diff(values) > 0).all()
        for variable in raw.variables.values():
            assert variable.attrs["units"] in (SI if units else BARE)
            assert variable.attrs["long_name"]
            assert set(variable.attrs) <= {"units", "long_name", "axis", "comment", "_FillValue"}
            fill = variable.attrs.get("_FillValue")
            assert fill is None or (np.isnan(fill) and variable.dtype == np.float64)
        assert raw["time"].attrs["units"] == ("s" if units else "1")
        axes = {name: raw[name].attrs.get("axis") for name in raw.sizes}
        wanted = {"time": "T", "x": "X", "y": "Y"}
        assert axes == {name: wanted.get(str(name)) for name in raw.sizes}
        angle = "mean_angle" if layout == "rho" else "angle"
        assert "anticlockwise from the x axis" in raw[angle].attrs["comment"]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_xarray_alone_opens_and_decodes_it(layout: Layout, tmp_path: Path) -> None:
    """In a process without this package: numbers to the bit, times as numbers, empty cells as NaN."""
    result = some_result(layout)
    result.save(tmp_path / "result.nc")
    code = f"""
import sys, numpy, xarray
with xarray.open_dataset({str(tmp_path / "result.nc")!r}, engine="h5netcdf") as data:
    data.load()
assert "ellipsoid_coupling" not in sys.modules
assert data.time.dtype == numpy.float64
numpy.savez({str(tmp_path / "again.npz")!r}, **{{k: v.values for k, v in data.variables.items()}})
"""
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, cwd=tmp_path)
    with np.load(tmp_path / "again.npz") as again:
        for name, values in result.variables.items():
            empty = np.zeros(values.shape, bool)
            if layout != "particles" and name != "density":
                empty = result.variables["density"] == 0.0
                assert empty.any()
            assert np.array_equal(np.isnan(again[name]), empty)
            assert np.array_equal(again[name][~empty], values[~empty])
        if layout == "particles":
            assert again["realisation"].tolist() == [0, 1]
            assert again["particle"].tolist() == list(range(SIZES["particle"]))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_is_read_back_is_what_was_saved(layout: Layout, tmp_path: Path) -> None:
    """To the bit: the package counts with 0 in empty cells, so that a product with the density is 0."""
    result = some_result(layout)
    result.save(tmp_path / "result.nc")
    read = Result.load(tmp_path / "result.nc")
    assert read.attributes == result.attributes
    assert read.coordinates.keys() == result.coordinates.keys()
    for name, values in result.variables.items():
        assert read.variables[name].tobytes() == values.tobytes()


def test_a_data_set_in_memory_has_the_same_holes() -> None:
    result = some_result("rho")
    data = result.to_dataset()
    assert np.isnan(data["velocity_x"].to_numpy()[..., 2]).all()
    assert not np.isnan(data["density"]).any()
    assert (result.variables["velocity_x"][..., 2] == 0.0).all()


def test_a_hole_where_there_is_mass_is_refused(tmp_path: Path) -> None:
    result = some_result("rho")
    result.variables["velocity_x"][1, 2, 3] = np.nan
    result.save(tmp_path / "result.nc")
    with pytest.raises(ec.InputError, match=r"velocity_x\[1, 2, 3\]: expected a finite number"):
        Result.load(tmp_path / "result.nc")


def test_a_run_has_no_angle_where_it_has_no_mass(tmp_path: Path) -> None:
    """A start angle that is held everywhere: the file has it where there is mass, and the same bits."""
    scene = load_scene("rotation", {"times": [0.1], "numerics.cell": 0.1, "start.angle": 1.0,
        "flow.angular_drag": 0.0, "interaction": None})  # fmt: skip
    result = ec.simulate(scene, "rho_mono_kinetic", folder=tmp_path / "run")
    empty = result.variables["density"] == 0.0
    assert empty.any()
    assert (result.variables["mean_angle"][empty] == 0.0).all()
    assert np.allclose(result.variables["mean_angle"][~empty], 1.0)
    read = Result.load(tmp_path / "run")
    for name, values in result.variables.items():
        assert read.variables[name].tobytes() == values.tobytes()


def test_a_part_of_a_large_run_has_its_numbers(tmp_path: Path) -> None:
    settings = {"particles.number": 2, "particles.realisations": 6, "times": [0.1]}
    part = ec.simulate(load_scene("rotation", settings), "microscopic", realisations=range(2, 5))
    part.save(tmp_path / "result.nc")
    with xr.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as data:
        assert data["realisation"].to_numpy().tolist() == [2, 3, 4]
    assert Result.load(tmp_path / "result.nc").to_dataset()["realisation"].to_numpy()[0] == 2
