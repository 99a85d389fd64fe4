"""Sweeps that run, in this process and in others: the bits of single runs, failures, resuming."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.sweeps import (
    Where,
    local,
    require_completed,
    run_sweep,
    run_task,
    statuses_of,
)
from ellipsoid_coupling.sweeps import job as job_module
from ellipsoid_coupling.sweeps import running as run_module
from ellipsoid_coupling.sweeps.folder import claim
from ellipsoid_coupling.sweeps.job import Job
from ellipsoid_coupling.sweeps.local import cores
from ellipsoid_coupling.sweeps.points import value_text
from tests.sweeps.small import (
    MODEL,
    ON_COMMAND_LINE,
    SETTINGS,
    names_in,
    same_variables,
    small_scene,
    small_sweep,
)

HERE = Where(workers=1)
VALUES = {"noise.noise": ["0.5", "1"]}


def single(noise: float, seed: int) -> ec.Result:
    scene = ec.load_scene("stationary", SETTINGS | {"noise.noise": noise})
    return ec.simulate(scene, MODEL, seed=seed)


def require_bits_of_single_runs(out: Path) -> None:
    """Two values of the noise and two seeds, in the order of the points."""
    runs = sorted((out / "runs").iterdir())
    assert len(runs) == 4
    for run, (noise, seed) in zip(runs, ((0.5, 0), (0.5, 1), (1.0, 0), (1.0, 1)), strict=True):
        assert same_variables(ec.Result.load(run), single(noise, seed)), run


def test_python_gives_the_data_set_of_single_runs(tmp_path: Path) -> None:
    out = tmp_path / "sweep"
    values = {"noise.noise": [0.5, np.float64(1.0)]}
    data = ec.sweep(small_scene(), values, models=MODEL, seeds=range(2), workers=1, out=out)
    require_bits_of_single_runs(out)
    alone = single(1.0, 1)
    found = data.sel({"model": MODEL, "noise.noise": 1.0, "seed": 1})
    np.testing.assert_array_equal(found["density"].values, alone.density(20))
    assert float(found["steps"]) == alone.attributes["steps"]
    with xr.open_dataset(out / "results.nc") as stored:
        xr.testing.assert_identical(stored.load(), data)
    # Every folder is one of an ordinary run.
    run = out / str(found["run"].values)
    assert names_in(run) == {"run.toml", "result.nc"}
    assert ec.load_scene(run / "run.toml").noise == small_scene().noise


def test_processes_give_the_bits_of_single_runs(tmp_path: Path) -> None:
    """Spawned ones, each with its part of the cores; one that is killed loses nothing.

    The sweep runs in a process of its own, which the test's threads and signals do not disturb.
    """
    if cores() < 2:
        pytest.skip("one core, one worker")
    out = tmp_path / "sweep"
    done = subprocess.run(
        command(out, "--workers", "2"), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "4 points, 2 workers: 100 %" in done.stderr
    require_bits_of_single_runs(out)


def command(out: Path, *further: str, values: str = "noise.noise=0.5,1") -> list[str]:
    start = [sys.executable, "-m", "ellipsoid_coupling", "sweep", "stationary", "--model", MODEL]
    lists = ["--seeds", "0:2", "--set", values, *ON_COMMAND_LINE]
    return [*start, *lists, "--out", str(out), *further]


def test_bad_settings_of_any_point_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    out = tmp_path / "sweep"
    with pytest.raises(InputError, match=r"point 2-.*particles.number"):
        run_sweep(small_sweep({"particles.number": ["5", "6", "-1"]}), out, HERE)
    with pytest.raises(InputError, match="model"):
        run_sweep(small_sweep(models=[MODEL, "other"]), out, HERE)
    with pytest.raises(InputError, match="independent realisations"):
        run_sweep(small_sweep(models=["mckean_vlasov"], realisations=[0, 2, 1]), out, HERE)
    with pytest.raises(InputError, match="--workers"):
        run_sweep(small_sweep(), out, Where(workers=cores() + 1))
    with pytest.raises(InputError, match="flow"):
        run_sweep(small_sweep(flow=str(tmp_path)), out, HERE)
    assert not out.exists()


def test_a_flow_that_cannot_be_read_leaves_the_folder_free(tmp_path: Path) -> None:
    """The same folder takes the next try, with other settings."""
    flow = {"source": "closed_form", "field": "rotation", "drag": 1.0, "angular_drag": 1.0}
    for seed in (0, 1):
        lists: dict[str, Any] = {"keys": ["flow"], "values": [[value_text(flow)]], "seeds": [seed]}
        with pytest.raises(InputError, match="no such file"):
            run_sweep(small_sweep(**lists, flow=str(tmp_path / "a.npz")), tmp_path / "s", HERE)


def test_failed_points_are_listed_and_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that fails and one that meets a bug end no other; resuming runs those two alone."""
    real, asked = ec.simulate, list[int]()

    def fragile(scene: ec.Scene, model: str, scheme: Any, **given: Any) -> ec.Result:
        asked.append(given["seed"])
        if given["seed"] == 1 and len(asked) <= 4:
            raise RunError("no step is short enough")
        if given["seed"] == 2 and len(asked) <= 4:
            raise ZeroDivisionError("a bug")
        return real(scene, model, scheme, **given)

    monkeypatch.setattr(job_module, "simulate", fragile)
    sweep = small_sweep(seeds=[0, 1, 2, 3])
    data = run_sweep(sweep, tmp_path, HERE)
    with pytest.raises(RunError, match="2 of 4 points") as error:
        require_completed(statuses_of(data))
    assert "no step is short enough" in str(error.value)
    assert "ZeroDivisionError: a bug" in str(error.value)
    assert asked == [0, 1, 2, 3]
    again = run_sweep(sweep, tmp_path, HERE, resume=True)
    require_completed(statuses_of(again))
    assert asked == [0, 1, 2, 3, 1, 2]


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "note").write_text("mine")
    with pytest.raises(InputError, match="empty folder"):
        run_sweep(small_sweep(), tmp_path, HERE)
    (tmp_path / "note").unlink()
    small_sweep(seeds=[0]).save(tmp_path / "sweep.toml")
    (tmp_path / "runs").mkdir()
    with pytest.raises(InputError, match="empty folder"):
        run_sweep(small_sweep(seeds=[0]), tmp_path, HERE)
    with pytest.raises(InputError, match=r"seeds = \[0\]"):
        run_sweep(small_sweep(seeds=[1]), tmp_path, HERE, resume=True)


def test_a_damaged_result_is_computed_again(tmp_path: Path) -> None:
    sweep = small_sweep(seeds=[5])
    first = run_sweep(sweep, tmp_path, HERE)
    file = next((tmp_path / "runs").iterdir()) / "result.nc"
    file.write_bytes(file.read_bytes()[:-100])
    again = run_sweep(sweep, tmp_path, HERE, resume=True)
    np.testing.assert_array_equal(first["density"].values, again["density"].values)
    assert same_variables(ec.Result.load(file), ec.simulate(small_scene(), MODEL, seed=5))


@pytest.mark.parametrize("first", [0, 3])
def test_split_realisations_are_those_of_the_whole(first: int, tmp_path: Path) -> None:
    """Five realisations in pieces of two, to the bit; their folder repeats the whole run."""
    data = run_sweep(small_sweep(realisations=[first, first + 5, 2]), tmp_path, HERE)
    folder = tmp_path / str(data["run"].values[0])
    whole = ec.simulate(small_scene(), MODEL, realisations=range(first, first + 5))
    joined = ec.Result.load(folder)
    assert len(list((tmp_path / "runs").iterdir())) == 3
    assert same_variables(joined, whole)
    # Of several rows of clock these are the largest, the sum and the mean.
    for name in ("steps", "rejected_steps", "mass_end", "resolution", "shortest_step"):
        assert joined.attributes[name] == whole.attributes[name]
    np.testing.assert_array_equal(data["density"].values[0], whole.density(20))
    repeated = ec.simulate(
        ec.load_scene(folder / "run.toml"), MODEL, realisations=range(first, first + 5)
    )
    assert same_variables(joined, repeated)


def test_realisations_that_do_not_exist_are_refused() -> None:
    for wrong in (range(3, 3), range(0, 4, 2), range(-1, 2)):
        with pytest.raises(InputError, match="--realisations"):
            ec.simulate(small_scene(), MODEL, realisations=wrong)
    with pytest.raises(InputError, match="one density of all"):
        ec.simulate(small_scene(), "mckean_vlasov", realisations=range(1, 2))


def test_tasks_share_the_points_in_any_order(tmp_path: Path) -> None:
    """Task 3 of 4 alone does all that nobody has taken; collecting tells what a lost task has left."""
    sweep = small_sweep(VALUES, seeds=[0, 1])
    out = tmp_path / "sweep"
    sweep.save(out / "sweep.toml")
    assert claim(out, "0-microscopic-noise=0.5-seed=0", "1/4", again=False)
    assert run_task(sweep, out, (3, 4)) == {}
    assert run_task(sweep, out, (2, 4)) == {}
    data = run_sweep(sweep, out, Where(collect=True))
    assert [*statuses_of(data).values()] == ["missing", "completed", "completed", "completed"]
    # The lost task comes back.
    assert run_task(sweep, out, (1, 4)) == {}  # its claim stands
    assert run_task(sweep, out, (1, 4), resume=True) == {}
    require_completed(statuses_of(run_sweep(sweep, out, Where(collect=True), resume=True)))
    require_bits_of_single_runs(out)


def test_workers_are_as_many_as_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_module, "cores", lambda: 8)
    monkeypatch.setattr(run_module, "memory_left", lambda: 10e9)
    assert run_module.fitting_workers(None, 100, 1e9) == 8
    assert run_module.fitting_workers(None, 3, 1e9) == 3
    assert run_module.fitting_workers(None, 100, 3e9) == 3
    assert run_module.fitting_workers(4, 100, 1e9) == 4
    assert run_module.fitting_workers(None, 100, 20e9) == 1
    with pytest.raises(InputError, match="at most 3"):
        run_module.fitting_workers(4, 100, 3e9)


def test_processes_get_their_part_of_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Threads of numba and of linear algebra; a user who wants fewer gets fewer."""
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    before = dict(os.environ)
    with local._environment(3):
        assert os.environ["NUMBA_NUM_THREADS"] == os.environ["OMP_NUM_THREADS"] == "3"
    assert dict(os.environ) == before
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    with local._environment(3):
        assert os.environ["NUMBA_NUM_THREADS"] == "2"


def test_a_point_whose_process_ends_is_tried_three_times(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the memory is short: the other points are not touched, and the process's end is told."""
    calls = list[int]()

    def start(job: Job, threads: int) -> local._Worker:
        worker = real(job, threads)
        calls.append(threads)
        worker.process.kill()
        return worker

    real = local._start
    monkeypatch.setattr(local, "_start", start)
    sweep = small_sweep(seeds=[0])
    job = Job(tmp_path, sweep)
    found = dict(local.run_in_processes(job, list(sweep.points()), 1, lambda _parts: None))
    assert len(calls) == 3
    assert found[0].status.startswith("failed: its process ended 3 times (SIGKILL)")


def test_the_flow_is_kept_once_and_linked(tmp_path: Path) -> None:
    """Run folders hold the flow that they used, without a copy each."""
    flow = {"source": "closed_form", "field": "rotation", "drag": 1.0, "angular_drag": 1.0}
    values = {"flow": [flow, flow | {"drag": 2.0}]}
    scene = ec.load_scene("rotation", SETTINGS)
    data = ec.sweep(scene, values, models=MODEL, workers=1, out=tmp_path / "sweep")
    (kept,) = (tmp_path / "sweep" / "flows").glob("*.npz")
    for run in (tmp_path / "sweep" / "runs").iterdir():
        assert (run / "flow.npz").samefile(kept)
    alone = ec.simulate(scene, MODEL)
    swept = ec.Result.load(tmp_path / "sweep" / str(data["run"].values[0, 0]))
    assert same_variables(swept, alone)
    assert swept.attributes["flow_digest"] == alone.attributes["flow_digest"]
    with pytest.raises(InputError, match="started with"):
        ec.sweep(
            scene, values, models=MODEL, workers=1, out=tmp_path / "sweep", resume=True,
            flow=analytic_flow("top_bottom"),
        )  # fmt: skip


def test_a_killed_sweep_goes_on_where_it_was(tmp_path: Path) -> None:
    """SIGTERM: runs in hand leave checkpoints, the message says how to go on; then the same bits."""
    out, environment = tmp_path / "sweep", os.environ | {"PYTHONUNBUFFERED": "1"}
    # Long runs: some seconds each, unless they are stopped.
    long = [*command(out, "--workers", str(min(2, cores()))), "--set", "times=[0.05, 2000.0]"]
    process = subprocess.Popen(long, env=environment, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline and not list((out / "runs").glob("*/run.toml")):
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    _, told = process.communicate(timeout=120.0)
    assert process.returncode == 128 + signal.SIGTERM, told
    assert f"--resume --out {out}" in told
    assert not list((out / "runs").glob("*/result.nc"))
