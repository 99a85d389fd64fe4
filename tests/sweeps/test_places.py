"""Sweeps on a cluster, in a batch queue and with cold caches: real processes on this machine.

All processes are bounded in time and are ended by the tests that started them.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
import xarray as xr

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.sweeps import Where, run_sweep
from ellipsoid_coupling.sweeps.local import cores
from tests.sweeps.small import MODEL, ON_COMMAND_LINE, SETTINGS, same_variables, small_sweep
from tests.workflows.test_workflows import WORKFLOWS, workflow

# Nothing here takes longer on a machine that others use as well.
PATIENCE = 300.0
SEEDS = 8
# Each of them some seconds on one thread, so that there is a middle to be killed in.
LONG = ["--set", "times=[0.05, 2000.0]"]


def command(out: Path, *further: str, seeds: int = SEEDS) -> list[str]:
    start = [sys.executable, "-m", "ellipsoid_coupling", "sweep", "stationary", "--model", MODEL]
    return [*start, "--seeds", f"0:{seeds}", "--set", *ON_COMMAND_LINE, "--out", str(out), *further]


def ended(process: subprocess.Popen[str]) -> str:
    """What a process has told; it must end well."""
    _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, told
    return told


def started(words: list[str], **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        words,
        env=os.environ | environment,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )


def wait_for(what: Callable[[], object], process: subprocess.Popen[str]) -> None:
    """Wait until something is there that `process` makes."""
    deadline = time.monotonic() + PATIENCE
    while not what():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)


def require_bits_of_single_runs(out: Path, times: list[float], seeds: int = SEEDS) -> None:
    with xr.open_dataset(out / "results.nc") as data:
        assert (data["status"] == "completed").all()
        names = data["run"].values.ravel()
    scene = ec.load_scene("stationary", SETTINGS | {"times": times})
    for seed in range(seeds):
        run = ec.Result.load(out / str(names[seed]))
        assert same_variables(run, ec.simulate(scene, MODEL, seed=seed)), seed


@pytest.mark.heavy
def test_an_array_of_tasks_at_once_computes_each_point_once(tmp_path: Path) -> None:
    """16 processes begin the same folder; 24 points are claimed by one task each."""
    out, points = tmp_path / "sweep", 24
    words = [command(out, "--task", f"{k}/16", seeds=points) for k in range(16, 0, -1)]
    for process in [started(one, NUMBA_NUM_THREADS="1") for one in words]:
        ended(process)
    claims = [file.read_text().split()[0] for file in (out / "claims").iterdir()]
    assert len(claims) == points
    assert len(set(claims)) > 1
    ended(started([*command(out, seeds=points), "--resume", "--collect"]))
    require_bits_of_single_runs(out, SETTINGS["times"], points)


@pytest.mark.heavy
def test_a_sweep_whose_first_process_was_killed_goes_on(tmp_path: Path) -> None:
    """Its workers end by themselves, after a checkpoint; the next sweep goes on."""
    if cores() < 2:
        pytest.skip("one core, one worker")
    out = tmp_path / "sweep"
    words = [*command(out, "--workers", "2", seeds=3), *LONG]
    first = started(words)
    wait_for(lambda: len(list((out / "runs").glob("*/run.toml"))) >= 2, first)
    first.send_signal(signal.SIGKILL)
    first.communicate(timeout=PATIENCE)  # until its workers have ended as well
    assert not (out / "results.nc").exists()
    ended(started([*words, "--resume"]))
    require_bits_of_single_runs(out, [0.05, 2000.0], 3)


def workers_of(process: subprocess.Popen[str]) -> list[int]:
    """The spawned processes of a sweep, oldest first."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    lines = {int(pid): Path(f"/proc/{pid}/cmdline").read_bytes() for pid in children}
    return [pid for pid, line in lines.items() if b"spawn_main" in line]


@pytest.mark.heavy
def test_a_worker_that_is_killed_loses_no_point(tmp_path: Path) -> None:
    """Another process takes its place, and its point."""
    if cores() < 2:
        pytest.skip("one core, one worker")
    out = tmp_path / "sweep"
    sweep = started([*command(out, "--workers", "2", seeds=3), *LONG])
    wait_for(lambda: len(list((out / "runs").glob("*/run.toml"))) >= 2, sweep)
    os.kill(workers_of(sweep)[0], signal.SIGKILL)
    told = ended(sweep)
    assert "3 points, 2 workers: 100 %" in told
    require_bits_of_single_runs(out, [0.05, 2000.0], 3)


@pytest.mark.heavy
def test_processes_with_one_cold_cache_compile_once(tmp_path: Path) -> None:
    """Two tasks with a cache of their own each, and two that share a third one.

    Those that share take turns: the second one finds the kernels, so that its points say 0 seconds of
    compiling or nearly so.
    """
    out = tmp_path / "sweep"
    caches = ("a", "b", "c", "c")
    tasks = [
        started(
            command(out, "--task", f"{k + 1}/4"),
            ELLIPSOID_CACHE=str(tmp_path / cache),
            NUMBA_NUM_THREADS="1",
        )
        for k, cache in enumerate(caches)
    ]
    for process in tasks:
        ended(process)
    ended(started([*command(out), "--collect"]))
    require_bits_of_single_runs(out, SETTINGS["times"])
    with xr.open_dataset(out / "results.nc") as data:
        seconds = sorted(data["compile_seconds"].values.ravel())
    # Three caches, three times to compile; all other points load what is there.
    assert seconds[-3] > 10.0 * seconds[-4]


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """The address of a scheduler on the loopback."""
    pytest.importorskip("distributed", reason="the extra cluster")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = ["scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    with dask(tmp_path, *words):
        yield f"tcp://127.0.0.1:{port}"


@contextmanager
def dask(folder: Path, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """A program of Dask's, which is ended with the context."""
    environment = os.environ | {"NUMBA_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.dask_{words[0]}", *words[1:]],
        cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def worker(
    folder: Path, address: str, name: str
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    local = str(folder / name)
    return dask(
        folder, "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
        "--name", name, "--local-directory", local,
    )  # fmt: skip


@pytest.mark.heavy
def test_a_cluster_survives_its_workers_and_its_client(scheduler: str, tmp_path: Path) -> None:
    """Three workers, one killed in mid-run and one added; the client killed, and followed by another."""
    out = tmp_path / "sweep"
    words = [*command(out, "--scheduler", scheduler), *LONG]
    with (
        worker(tmp_path, scheduler, "a") as first,
        worker(tmp_path, scheduler, "b"),
        worker(tmp_path, scheduler, "c"),
    ):
        client = started(words)
        wait_for(lambda: len(list((out / "runs").glob("*/run.toml"))) >= 3, client)
        first.kill()
        with worker(tmp_path, scheduler, "d"):
            wait_for(lambda: list((out / "runs").glob("*/result.nc")), client)
            client.send_signal(signal.SIGKILL)
            client.communicate(timeout=PATIENCE)
            assert not (out / "results.nc").exists()
            ended(started([*words, "--resume"]))
    require_bits_of_single_runs(out, [0.05, 2000.0])


@pytest.mark.heavy
def test_the_example_of_dask_jobqueue_runs_and_goes_on(
    scheduler: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On a cluster that is there already; the second time nothing is left to do."""
    words = ["--quick", "--scheduler", scheduler, "--out", str(tmp_path / "s")]
    with worker(tmp_path, scheduler, "a"):
        for _ in range(2):
            workflow("dask_jobqueue_example").main(words)
    table = capsys.readouterr().out
    assert table.count("particles.number") == 2
    assert len(list((tmp_path / "s" / "runs").glob("*/result.nc"))) == 4


def test_a_slurm_array_of_one_task_runs_all_points(tmp_path: Path) -> None:
    """The script as SLURM calls it, with its variables."""
    out = tmp_path / "sweep"
    entry = tmp_path / "ellipsoid"
    entry.write_text(f'#!/bin/sh\nexec {sys.executable} -m ellipsoid_coupling "$@"\n')
    entry.chmod(0o755)
    variables = {"SLURM_ARRAY_TASK_ID": "1", "SLURM_ARRAY_TASK_MAX": "1", "OUT": str(out)}
    words = [str(WORKFLOWS / "sweep.slurm"), "stationary", "--model", MODEL, "--seeds", "0:2"]
    told = ended(started([*words, "--set", *ON_COMMAND_LINE], **variables, ELLIPSOID=str(entry)))
    assert "task 1 of 1" in told
    assert {file.read_text().split()[0] for file in (out / "claims").iterdir()} == {"1/1"}
    assert len(list((out / "runs").glob("*/result.nc"))) == 2


def test_the_benchmark_tells_each_way_to_run(capsys: pytest.CaptureFixture[str]) -> None:
    costs = workflow("benchmark_sweeps").main(["--points", "10", "--workers", "1"])
    assert set(costs) == {"simulate", "1 workers"}
    assert capsys.readouterr().out.count("\n") == 3


def test_a_missing_extra_is_told_in_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"ellipsoid_coupling\[cluster\]"):
        run_sweep(small_sweep(), tmp_path, Where(scheduler="tcp://127.0.0.1:1"))
    assert not list(tmp_path.iterdir())


def test_a_scheduler_that_is_not_there_is_told(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the extra cluster")
    with pytest.raises(InputError, match="a Dask scheduler"):
        run_sweep(small_sweep(), tmp_path, Where(scheduler="nonsense"))
