"""The time loop: results, run folders, resuming, failures."""

from __future__ import annotations

import gc
import sys
import tomllib
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.models import build_model, model_names
from ellipsoid_coupling.result import DIMENSIONS, Layout, Result
from ellipsoid_coupling.scenes import Scene

# The package's name `simulate` is the function.
module = sys.modules[ec.simulate.__module__]

MODELS = [("microscopic", "paper"), ("microscopic", "accurate"), ("rho_mono_kinetic", "accurate")]
EACH = pytest.mark.parametrize(("model", "scheme"), MODELS)


def small_scene(settings: dict[str, Any] | None = None, name: str = "rotation") -> Scene:
    small = {
        "particles.number": 40,
        "particles.realisations": 2,
        "numerics.cell": 0.1,
        "times": [0.1, 0.3],
    }
    return ec.load_scene(name, small | (settings or {}))


@EACH
def test_a_result_survives_its_file(model: str, scheme: Any, tmp_path: Path) -> None:
    result = ec.simulate(small_scene(), model, scheme, folder=tmp_path)
    loaded = Result.load(tmp_path)
    assert loaded.scene == result.scene
    assert (loaded.model, loaded.scheme, loaded.layout) == (model, scheme, result.layout)
    assert loaded.attributes == result.attributes
    for name, values in result.variables.items():
        assert np.array_equal(values, loaded.variables[name])


@EACH
def test_the_file_is_what_the_contract_says(model: str, scheme: Any, tmp_path: Path) -> None:
    ec.simulate(small_scene(), model, scheme, folder=tmp_path, seed=5)
    with xr.open_dataset(tmp_path / "result.nc", engine="h5netcdf") as data:
        layout: Layout = "particles" if model == "microscopic" else "rho"
        assert list(data["time"].values) == [0.1, 0.3]
        assert all(v.dims == DIMENSIONS[layout] for v in data.data_vars.values())
        assert all({"units", "long_name"} <= set(v.attrs) for v in data.variables.values())
        needed = "scene model scheme resolution seed package_version status steps wall_seconds"
        needed += " compile_seconds mass_start mass_end mass_left"
        assert set(needed.split()) <= set(data.attrs)
        assert data.attrs["status"] == "completed"
        expected = {"particles": {"x", "y", "angle"}, "rho": {"density", "mean_angle"}}[layout]
        assert expected | {"velocity_x", "velocity_y", "angular_velocity"} == set(data.data_vars)


def test_run_toml_is_enough_to_repeat_the_run(tmp_path: Path) -> None:
    first = ec.simulate(small_scene(), "microscopic", "paper", folder=tmp_path, seed=7)
    told = tomllib.loads((tmp_path / "run.toml").read_text())["run"]
    scene = ec.load_scene(tmp_path / "run.toml")
    again = ec.simulate(
        scene, told["model"], told["scheme"], seed=told["seed"], realisations=told["realisations"]
    )
    for name, values in first.variables.items():
        assert np.array_equal(values, again.variables[name]), name


def test_a_failed_run_keeps_what_it_reached(tmp_path: Path) -> None:
    """Euler-Maruyama with dt gamma = 2.5: reaches the first time, explodes before the second."""
    scene = small_scene({"flow.drag": 250.0, "interaction": None, "times": [0.01, 30.0]})
    with pytest.raises(RunError, match="beyond what forces"):
        ec.simulate(scene, "microscopic", "paper", folder=tmp_path)
    failed = Result.load(tmp_path)
    assert failed.status.startswith("failed: ")
    assert list(failed.times) == [0.01]
    assert failed.variables["x"].shape == (1, 2, 40)


def test_compile_time_is_not_wall_time() -> None:
    """Run twice in one process: the second compiles nothing."""
    ec.simulate(small_scene(), "microscopic")
    assert ec.simulate(small_scene(), "microscopic").attributes["compile_seconds"] == 0.0


@pytest.mark.parametrize("model", model_names())
def test_a_run_that_is_over_leaves_its_memory(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, not when garbage is collected: the next run would ask the system for new memory."""
    built: list[weakref.ref[Any]] = []

    def build(*details: Any) -> Any:
        made = build_model(*details)
        built.append(weakref.ref(made))
        return made

    monkeypatch.setattr(module, "build_model", build)
    name = "stationary" if model == "stationary_state" else "rotation"
    scene = small_scene({"times": [0.1], "numerics.angle_cells": 12}, name)
    # While kernels are compiled, the compiler refers to their arguments.
    ec.simulate(scene, model)
    gc.disable()
    try:
        ec.simulate(scene, model)
        assert built[-1]() is None
    finally:
        gc.enable()


def test_results_of_all_models_share_bins() -> None:
    micro = ec.simulate(small_scene(), "microscopic")
    rho = ec.simulate(small_scene(), "rho_mono_kinetic")
    assert (micro.density(cells=30) - rho.density(cells=30)).shape == (2, 30, 30)
    assert micro.density(cells=30)[0].mean() * 9 == pytest.approx(1.0)
    assert rho.density(cells=30)[0].mean() * 9 == pytest.approx(1.0)
    difference = micro.angle_distribution(bins=60) - rho.angle_distribution(bins=60)
    assert difference.sum(axis=1) * 2 * np.pi / 60 == pytest.approx([0.0, 0.0], abs=1e-12)


def test_files_that_are_no_results_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="run folder"):
        Result.load(tmp_path / "nothing")
    (tmp_path / "result.nc").write_text("not a NetCDF file")
    with pytest.raises(InputError, match="result file"):
        Result.load(tmp_path)


def test_a_flow_for_a_scene_without_fluid_is_refused() -> None:
    with pytest.raises(InputError, match="Leave out --flow"):
        ec.simulate(ec.load_scene("stationary"), "microscopic", flow="somewhere")


def test_a_range_of_realisations_beyond_64_bits_is_refused() -> None:
    with pytest.raises(InputError, match="--realisations: expected A:B with 0 <= A < B"):
        module._numbers(small_scene(), "microscopic", range(10**30))


def test_data_sets_of_particles_and_grids_may_be_merged(tmp_path: Path) -> None:
    """With xarray alone: x and y are axes of grids and variables of particles, whose names differ."""
    results = [ec.simulate(small_scene(), name) for name in ("microscopic", "rho_mono_kinetic")]
    micro, rho = (result.to_dataset() for result in results)
    both = xr.merge([micro, rho], combine_attrs="drop")
    assert both.nbytes <= micro.nbytes + rho.nbytes
    assert both["particle_x"].dims == ("time", "realisation", "particle")
    assert both["density"].dims == ("time", "y", "x")
    assert np.array_equal(both["particle_x"], results[0].variables["x"])
    for k, data in enumerate((micro, rho)):
        data.to_netcdf(tmp_path / f"{k}.nc", engine="h5netcdf")
    files = [xr.open_dataset(tmp_path / f"{k}.nc", engine="h5netcdf") for k in range(2)]
    assert xr.combine_by_coords(files, combine_attrs="drop").nbytes <= both.nbytes
    for file in files:
        file.close()
