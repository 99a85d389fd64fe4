"""Nothing lost: a run that is killed at any moment goes on bit for bit as if never stopped."""

from __future__ import annotations

import multiprocessing as mp
import os
import random
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.errors import EllipsoidError
from ellipsoid_coupling.stepping.step_control import Aside
from ellipsoid_coupling.storage.run_folder import CHECKPOINT_FILE, RunFolder
from tests.small_runs import IDLE, WALLS

MODELS = [
    (model, scheme)
    for model in (
        "microscopic",
        "mckean_vlasov",
        "q_maxwellian",
        "q_mono_kinetic",
        "rho_mono_kinetic",
        "diffusive",
    )
    for scheme in ("paper", "accurate")
]
# Interaction, both potentials and noise; torque and turning.
SETTINGS: dict[str, Any] = {
    "particles.number": 30,
    "particles.realisations": 2,
    "numerics.cell": 1.2,
    "numerics.angle_cells": 6,
    "numerics.time_step": 0.01,
    "numerics.tolerance": 1e-7,
    "numerics.cfl": 0.002,
    "times": [0.1, 0.6, 0.7],
}


class Killed(BaseException):
    pass


def killer(call: int) -> Callable[[str, float], None]:
    """A report that kills the run in its n-th call."""
    left = [call]

    def report(_stage: str, _part: float) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise Killed

    return report


def require_same(first: ec.Result, second: ec.Result) -> None:
    assert np.array_equal(first.times, second.times)
    for name, values in first.variables.items():
        assert values.tobytes() == second.variables[name].tobytes(), name
    for key, value in first.attributes.items():
        if not key.endswith("_seconds"):
            assert value == second.attributes[key], key


def run_with_kills(folder: Path, calls: list[int], *arguments: Any) -> ec.Result:
    """Kill the run in the given calls, one after the other, and take it to its end."""
    most = numba.get_num_threads()
    try:
        for number, call in enumerate(calls):
            numba.set_num_threads(1 + number % most)
            place = RunFolder(folder, resume=True, checkpoint_seconds=0.0)
            with pytest.raises(Killed):
                ec.simulate(*arguments, seed=3, folder=place, report=killer(call))
            assert not (folder / "result.nc").exists()
    finally:
        numba.set_num_threads(most)
    return ec.simulate(*arguments, seed=3, folder=RunFolder(folder, resume=True))


@pytest.mark.parametrize(("model", "scheme"), MODELS)
def test_every_model_resumes_bit_for_bit(model: str, scheme: Any, tmp_path: Path) -> None:
    """With noise; killed before the first checkpoint, soon after the start, and later.

    Each part runs on another number of threads.
    """
    # Short steps, so that there are moments to be killed at; those of a model with sound are short anyway.
    cfl = {"numerics.cfl": 0.01} if model == "q_maxwellian" else {}
    scene = ec.load_scene("stationary", SETTINGS | cfl)
    whole = ec.simulate(scene, model, scheme, seed=3)
    resumed = run_with_kills(tmp_path, [1, 2, 2, 3], scene, model, scheme)
    require_same(whole, resumed)
    assert not (tmp_path / CHECKPOINT_FILE).exists()
    assert resumed.attributes["wall_seconds"] > 0.0
    require_same(whole, ec.Result.load(tmp_path))


@pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov", "rho_mono_kinetic"])
def test_walls_fluid_and_chosen_steps_resume_too(model: str, tmp_path: Path) -> None:
    """Without noise: planned steps, rejections and what crossed are part of the state."""
    settings = {
        "particles.number": 50,
        "particles.realisations": 2,
        "numerics.cell": 0.4,
        "numerics.tolerance": 1e-8,
        "numerics.cfl": 0.01,
        "times": [0.2, 0.4],
        "interaction.strength": 3.0,
    }
    scene = ec.load_scene("stationary", WALLS | settings)
    whole = ec.simulate(scene, model, seed=3)
    require_same(whole, run_with_kills(tmp_path, [2, 3], scene, model, "accurate"))


@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_maxwellian"])
def test_grids_killed_between_save_times_and_in_the_step_aside_resume_too(
    model: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Save times change no other step, so what a short step leads to is not what a run goes on from."""
    grid = {"numerics.cell": 0.6, "numerics.angle_cells": 8, "numerics.cfl": 0.1}
    scene = ec.load_scene("stationary", grid | {"times": [0.1, 0.101, 0.25, 0.4]})
    whole = ec.simulate(scene, model, seed=3)
    kept, keep = [0], Aside.keep

    def keep_and_die(aside: Aside, arrays: dict[str, Any], until: float) -> None:
        keep(aside, arrays, until)
        kept[0] += 1
        # Once in each step aside, which is then taken by the run after it.
        if kept[0] % 2:
            raise Killed

    folder = tmp_path / "aside"
    with monkeypatch.context() as patched:
        patched.setattr(Aside, "keep", keep_and_die)
        for _ in range(3):
            place = RunFolder(folder, resume=True, checkpoint_seconds=0.0)
            with pytest.raises(Killed):
                ec.simulate(scene, model, seed=3, folder=place)
    assert kept[0] == 5
    require_same(whole, ec.simulate(scene, model, seed=3, folder=RunFolder(folder, resume=True)))
    arguments = scene, model, "accurate"
    require_same(whole, run_with_kills(tmp_path / "between", [2, 2, 2], *arguments))


def test_a_stationary_state_resumes_too(tmp_path: Path) -> None:
    """Killed between calls of ten iterations each."""
    strong = {"interaction.strength": 300.0, "numerics.cell": 0.6, "numerics.angle_cells": 8}
    scene = ec.load_scene("stationary", strong)
    whole = ec.simulate(scene, "stationary_state", seed=3)
    assert whole.attributes["steps"] > 10
    require_same(whole, run_with_kills(tmp_path, [1, 2], scene, "stationary_state", "accurate"))


def test_what_pushed_particles_once_is_remembered(tmp_path: Path) -> None:
    """Two particles push one another apart and fly on for ever: no force explains their speed later."""
    settings = {
        "start": {"points": [[0.0, 0.0, 0.0], [1.5, 0.0, 0.0]]},
        "particles.number": 2,
        "particles.realisations": 1,
        "times": [float(t) for t in range(1, 11)],
    }
    scene = ec.load_scene("stationary", IDLE | settings)
    whole = ec.simulate(scene, "microscopic", seed=3)
    assert whole.variables["velocity_x"][-1, 0, 1] > 0.1
    require_same(whole, run_with_kills(tmp_path, [8, 2], scene, "microscopic", "accurate"))


def test_a_finished_run_is_not_run_again(tmp_path: Path) -> None:
    scene = ec.load_scene("stationary", SETTINGS)
    first = ec.simulate(scene, "microscopic", folder=tmp_path)
    written = (tmp_path / "result.nc").stat().st_mtime_ns
    again = ec.simulate(scene, "microscopic", folder=RunFolder(tmp_path, resume=True))
    require_same(first, again)
    assert (tmp_path / "result.nc").stat().st_mtime_ns == written


# The kill test. Its child processes are forked off a server that has the package loaded already, so
# that most of their life is the run itself.
SERVER = mp.get_context("forkserver")
SERVER.set_forkserver_preload(["ellipsoid_coupling.cli", "ellipsoid_coupling.simulation", "xarray"])
KILL_SETTINGS = SETTINGS | {"times": [0.5, 2.0], "numerics.cfl": 0.01, "numerics.time_step": 0.002}


def run_command(folder: str, model: str, resume: bool) -> None:
    """`ellipsoid run` with a checkpoint at every call."""
    told = [f"{key}={value}" for key, value in KILL_SETTINGS.items()]
    tokens = ["run", "stationary", "--model", model, "--scheme", "paper", "--seed", "3"]
    tokens += ["--out", folder, "--checkpoint-seconds", "0", "--set", *told]
    sys.stdout = sys.stderr = Path(os.devnull).open("w")  # noqa: SIM115  # the process ends with it
    main([*tokens, "--resume"] if resume else tokens)


def start(folder: Path, model: str) -> Any:
    process = SERVER.Process(target=run_command, args=(str(folder), model, True), daemon=True)
    process.start()
    return process


def uninterrupted(folder: Path, model: str) -> ec.Result:
    """The result of a run left alone, with kernels from the cache as the killed ones have them.

    A process that compiles a kernel itself may round otherwise than one that loads it.
    """
    for name in ("compiles", "whole"):
        process = start(folder / name, model)
        process.join()
        assert process.exitcode == 0
    return ec.Result.load(folder / "whole")


@pytest.mark.parametrize(
    ("model", "kills"), [("microscopic", 10), ("q_mono_kinetic", 10), ("rho_mono_kinetic", 10)]
)
def test_sigkill_at_random_moments_loses_nothing(model: str, kills: int, tmp_path: Path) -> None:
    """SIGKILL at thirty random moments in all, a third of them while a checkpoint is being written.

    A kill comes up to a second after the process has begun, or as soon as a half file is seen; a
    run that ends before is begun again in another folder, so that every kill hits a living one.
    """
    whole = uninterrupted(tmp_path, model)
    rng = random.Random(model)
    done, folder, while_writing = 0, 0, 0
    while done < kills:
        place = tmp_path / str(folder)
        process = start(place, model)
        waits_for_file, delay = rng.random() < 0.33, rng.uniform(0.05, 1.0)
        begun = time.monotonic()
        while process.is_alive():
            half = next(place.glob(".checkpoint.*"), None) if place.exists() else None
            if (half is not None) if waits_for_file else (time.monotonic() - begun > delay):
                break
            if waits_for_file:
                continue  # a file lives for a millisecond or less
            time.sleep(0.005)
        process.kill()
        process.join()
        if process.exitcode == -signal.SIGKILL:
            done += 1
            while_writing += waits_for_file
            assert not (place / "result.nc").exists() or ec.Result.load(place).status
        else:
            assert process.exitcode == 0
            require_same(whole, ec.Result.load(place))
            folder += 1
    assert while_writing > 0
    process = start(tmp_path / str(folder), model)
    process.join()
    assert process.exitcode == 0
    require_same(whole, ec.Result.load(tmp_path / str(folder)))
    left = {p.name for p in (tmp_path / str(folder)).iterdir() if not p.name.startswith(".")}
    assert left == {"run.toml", "result.nc"}


# Each with the exit status of a run that it stops.
SIGNALS = {signal.SIGTERM: 143, signal.SIGINT: 130, signal.SIGHUP: 129}


@pytest.mark.parametrize(("number", "status"), SIGNALS.items())
def test_a_signal_writes_a_checkpoint_first(
    number: int, status: int, tmp_path: Path, obeyed: Callable[..., Any]
) -> None:
    """An hour between checkpoints, so that the one found is the signal's."""
    scene = ec.load_scene("stationary", SETTINGS)

    def send(_stage: str, part: float) -> None:
        if part > 0.3:
            os.kill(os.getpid(), number)

    with pytest.raises(ec.Interrupted, match="--resume") as caught:
        ec.simulate(
            scene,
            "microscopic",
            seed=3,
            folder=RunFolder(tmp_path, checkpoint_seconds=3600.0),
            report=send,
        )
    assert caught.value.exit_status == status
    assert (tmp_path / CHECKPOINT_FILE).is_file()
    assert signal.getsignal(number) is obeyed
    resumed = ec.simulate(scene, "microscopic", seed=3, folder=RunFolder(tmp_path, resume=True))
    require_same(ec.simulate(scene, "microscopic", seed=3), resumed)


def test_stop_after_leaves_a_run_that_resumes(tmp_path: Path) -> None:
    scene = ec.load_scene("stationary", SETTINGS)
    with pytest.raises(EllipsoidError, match="--stop-after") as caught:
        ec.simulate(scene, "microscopic", seed=3, folder=RunFolder(tmp_path, stop_after=1e-9))
    assert caught.value.exit_status == 1
    resumed = ec.simulate(scene, "microscopic", seed=3, folder=RunFolder(tmp_path, resume=True))
    require_same(ec.simulate(scene, "microscopic", seed=3), resumed)
