"""What is kept of a result, and the data set of many; without a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import errors_against
from ellipsoid_coupling.result import DIMENSIONS, VARIABLES
from ellipsoid_coupling.sweeps import Sweep
from ellipsoid_coupling.sweeps.dataset import assemble, save
from ellipsoid_coupling.sweeps.records import MISSING, failed, record_of, series
from tests.sweeps.small import small_scene, small_sweep

TIMES = np.array([0.05, 0.1])


def particles(seed: int) -> ec.Result:
    """Random particles of two realisations at both save times."""
    random = np.random.default_rng(seed)
    variables = {name: random.uniform(-5.0, 5.0, (2, 2, 40)) for name in VARIABLES["particles"]}
    told: dict[str, Any] = {"status": "completed", "steps": 7.0, "wall_seconds": 0.5}
    return ec.Result(
        small_scene(), "microscopic", "accurate", "particles", TIMES, variables, {}, told
    )


def cells(value: float) -> ec.Result:
    """An r-grid of 6 x 12 cells whose density falls linearly in x, at rest but for v_x = `value`."""
    domain, shape = small_scene().domain, (2, 6, 12)
    x, y = (
        np.linspace(low, high, 2 * n + 1)[1::2]
        for (low, high), n in ((domain.x, 12), (domain.y, 6))
    )
    density = np.broadcast_to((1.0 - x / 12.0) / 144.0, shape).copy()
    variables = {name: np.zeros(shape) for name in VARIABLES["rho"]} | {"density": density}
    variables["velocity_x"] = np.full(shape, value)
    told = {"status": "completed", "steps": 3.0}
    coordinates = {"x": x, "y": y}
    return ec.Result(
        small_scene(), "rho_mono_kinetic", "accurate", "rho", TIMES, variables, coordinates, told
    )


def test_series_of_particles_are_their_moments() -> None:
    """To rounding: plain means."""
    result = particles(0)
    found = series(result)
    v = result.variables
    assert found["mass"] == pytest.approx([1.0, 1.0], rel=1e-14)
    assert found["mean_x"] == pytest.approx(v["x"].mean(axis=(1, 2)), rel=1e-13)
    assert found["mean_y"] == pytest.approx(v["y"].mean(axis=(1, 2)), rel=1e-13)
    speed = (v["velocity_x"] ** 2 + v["velocity_y"] ** 2).mean(axis=(1, 2))
    assert found["rms_speed"] == pytest.approx(np.sqrt(speed), rel=1e-13)
    turning = (v["angular_velocity"] ** 2).mean(axis=(1, 2))
    assert found["rms_angular_velocity"] == pytest.approx(np.sqrt(turning), rel=1e-13)


def test_series_leave_out_frozen_particles() -> None:
    result = particles(0)
    gone = np.zeros((2, 2, 40))
    gone[1, :, 10:] = 1.0
    found = series(replace(result, variables=result.variables | {"frozen": gone}))
    assert found["mass"] == pytest.approx([1.0, 0.25], rel=1e-14)
    assert found["mean_x"][1] == pytest.approx(result.variables["x"][1, :, :10].mean(), rel=1e-13)


def test_series_of_a_grid_are_integrals() -> None:
    """Rho = (1 - x/12)/144 on 12 x 12: mass 1; the midpoint sum of x rho on cells of width 1 is
    -(1/12)(12^2 - 1)/12 by sum k^2, exactly.
    """
    found = series(cells(0.5))
    assert found["mass"] == pytest.approx([1.0, 1.0], rel=1e-14)
    assert found["mean_x"] == pytest.approx([-143.0 / 144.0] * 2, rel=1e-13)
    assert found["mean_y"] == pytest.approx([0.0, 0.0], abs=1e-14)
    assert found["rms_speed"] == pytest.approx([0.5, 0.5], rel=1e-14)


def test_series_of_a_q_grid_are_those_of_its_density() -> None:
    """A density that does not depend on the angle: the r-grid's, to rounding."""
    r_grid, domain = cells(0.5), np.ones(4)[:, None, None] / (2.0 * np.pi)
    variables = {
        name: np.broadcast_to(r_grid.variables[name][:, None], (2, 4, 6, 12))
        for name in VARIABLES["q"]
    }
    variables |= {"density": r_grid.variables["density"][:, None] * domain}
    q_grid = replace(r_grid, layout="q", variables=variables)
    for name, values in series(r_grid).items():
        assert series(q_grid)[name] == pytest.approx(values, rel=1e-13, abs=1e-14)


def two_models() -> tuple[Sweep, dict[tuple[int, ...], Any]]:
    sweep = small_sweep(models=["rho_mono_kinetic", "microscopic"], seeds=[0, 1])
    results = [cells(0.0), cells(1.0), particles(0), particles(1)]
    return sweep, dict(zip(np.ndindex(2, 2), results, strict=True))


def test_errors_are_those_of_compare() -> None:
    """Against the model highest in the hierarchy, of the same seed; to rounding of a sum of 400 bins."""
    sweep, results = two_models()
    data = assemble(sweep, {k: record_of(r) for k, r in results.items()}, {})
    assert data.attrs["reference"] == "microscopic"
    for seed in (0, 1):
        errors = errors_against(results[0, seed], results[1, seed])
        found = data.sel(model="rho_mono_kinetic", seed=seed)
        np.testing.assert_allclose(found["density_error"], errors.density, rtol=1e-12)
        np.testing.assert_allclose(found["angle_error"], errors.angle, rtol=1e-12)
    assert bool(data["density_error"].sel(model="microscopic").isnull().all())


def test_points_without_a_result_are_nan_and_say_why() -> None:
    sweep, results = two_models()
    records = [record_of(results[0, 0]), failed("no step"), MISSING]
    data = assemble(sweep, dict(zip(np.ndindex(2, 2), records)), {(0, 0): "runs/a"})  # noqa: B905
    statuses = [["completed", "failed: no step"], ["missing", "missing"]]
    assert data["status"].values.tolist() == statuses
    assert data["steps"].values[0, 0] == 3.0
    assert np.isnan(data["density"].values[0, 1]).all()
    assert data["run"].values[0].tolist() == ["runs/a", ""]


def test_results_are_opened_by_xarray_alone(tmp_path: Path) -> None:
    """What was written is what is read, coordinates of pairs and texts included."""
    sweep = small_sweep(
        {"noise.noise": ["0", "1"], "interaction": ["none", "{strength = 1}"]}, zipped=True
    )
    data = assemble(sweep, {(0, 1): record_of(particles(0))}, {(0, 1): "runs/b"})
    save(data, tmp_path / "results.nc")
    with xr.open_dataset(tmp_path / "results.nc") as found:
        xr.testing.assert_identical(found.load(), data)
        assert set(found.coords) >= {"noise.noise", "interaction", "x", "y", "angle", "time"}
        # A variable of particles called x beside an axis called x would be spread over it.
        assert not set(found.data_vars) & set(map(str, found.dims))
        assert all(found[name].attrs["long_name"] for name in found.data_vars)


def test_domains_that_differ_have_no_common_centres() -> None:
    sweep = small_sweep({"domain.x": ["[-6.0, 6.0]", "[-7.0, 7.0]"]})
    data = assemble(sweep, {(0, 0): record_of(particles(0))}, {})
    assert "x" in data.dims
    assert "x" not in data.coords


def test_run_folders_are_opened_together(tmp_path: Path) -> None:
    """`open_mfdataset` on the results of one layout: another dimension is put in front of all variables."""
    pytest.importorskip("dask", reason="xarray opens several files by it: extra cluster")
    for layout, results in (
        ("particles", [particles(0), particles(1)]),
        ("rho", [cells(0.0), cells(1.0)]),
    ):
        files = [tmp_path / f"{layout}-{k}.nc" for k in range(2)]
        for file, result in zip(files, results, strict=True):
            result.save(file)
        with xr.open_mfdataset(files, combine="nested", concat_dim="point") as data:
            for name in VARIABLES[results[0].layout]:
                assert data[name].dims == ("point", *DIMENSIONS[results[0].layout])
                np.testing.assert_array_equal(data[name].values[1], results[1].variables[name])
