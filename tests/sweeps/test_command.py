"""`ellipsoid sweep` and `run --realisations A:B`: what they take, refuse, print and return."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import xarray as xr

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.sweeps import job as job_module
from tests.command_line import status_of
from tests.sweeps.small import MODEL, ON_COMMAND_LINE, names_in, same_variables, small_scene

SWEEP = ["sweep", "stationary", "--model", MODEL, "--set", *ON_COMMAND_LINE]
HERE = ["--workers", "1"]

BAD: list[tuple[list[str], str]] = [
    (["sweep"], "a scene, or --out with a sweep"),
    (["sweep", "stationary", "--set", "noise.noise=0,1"], "--model"),
    ([*SWEEP, "--workers", "1", "--scheduler", "tcp://a:1"], "one place to run"),
    ([*SWEEP, "--task", "0/3", "--out", "a"], "1 <= I <= N"),
    ([*SWEEP, "--task", "1/3"], "--out"),
    ([*SWEEP, "--resume"], "--out"),
    ([*SWEEP, "--collect"], "--out"),
    ([*SWEEP, "--seeds", "3:1"], "0 <= A < B"),
    ([*SWEEP, "--seeds", "a"], "a whole number"),
    ([*SWEEP, "--realisations", "0:8:0"], "0 <= A < B"),
    ([*SWEEP, "--workers", "0"], "the cores"),
    ([*SWEEP, "--scheme", "best"], "accurate"),
    ([*SWEEP, "--set", "noise.noise=0,,1"], "key=value,value"),
    ([*SWEEP, "--set", "noise.noise=0,-1", *HERE], "point 1-"),
    ([*SWEEP, "--set", "noise.noise=0,1", "particles.number=1,2,3", "--zip"], "lengths"),
    (["run", "stationary", "--model", MODEL, "--realisations", "2:2"], "0 <= A < B"),
    (["run", "stationary", "--model", MODEL, "--realisations", "0:4:2"], "--realisations"),
]


@pytest.mark.parametrize(("words", "part"), BAD, ids=lambda value: str(value)[-40:])
def test_mistakes_are_told_in_words(
    words: list[str],
    part: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert status_of(*words) == 2
    told = capsys.readouterr().err
    assert part in told
    assert "Traceback" not in told
    assert not list(tmp_path.rglob("*.nc"))


def test_a_sweep_prints_its_folder_and_is_repeated_from_its_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert status_of(*SWEEP, "--seeds", "4,6:8", *HERE) == 0
    out, told = capsys.readouterr()
    folder = Path(out.strip().splitlines()[-1])
    assert folder == Path("results/sweep-stationary")
    assert names_in(folder) == {"sweep.toml", "runs", "results.nc"}
    assert "3 points, 1 worker: 100 %" in told
    assert status_of("sweep", str(folder / "sweep.toml"), "--out", "again", *HERE) == 0
    with xr.open_dataset(folder / "results.nc") as a, xr.open_dataset("again/results.nc") as b:
        assert a["seed"].values.tolist() == [4, 6, 7]
        xr.testing.assert_identical(a["density"], b["density"])
    # Without a scene the folder says what to go on with; nothing is left to do.
    assert status_of("sweep", "--resume", "--out", str(folder), *HERE) == 0


def test_failed_points_are_status_1_until_they_are_repeated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fragile(scene: ec.Scene, *how: Any, **given: Any) -> ec.Result:
        if given["seed"] == 1:
            raise RunError("no step is short enough")
        return ec.simulate(scene, *how, **given)

    words = [*SWEEP, "--seeds", "0:2", "--out", str(tmp_path / "s")]
    with monkeypatch.context() as patched:
        patched.setattr(job_module, "simulate", fragile)
        assert status_of(*words, *HERE) == 1
        assert "1-microscopic-seed=1: failed: no step" in capsys.readouterr().err
        assert status_of(*words, "--resume", "--task", "1/1") == 1
        assert "no step" in capsys.readouterr().err
    assert status_of(*words, "--collect") == 1
    assert status_of(*words, "--resume", *HERE) == 0


def test_a_part_of_a_run_has_its_bits_and_is_repeated_from_its_run_toml(tmp_path: Path) -> None:
    scene = small_scene()
    whole = ec.simulate(scene, MODEL, realisations=5)
    words = ["run", "stationary", "--model", MODEL, "--set", *ON_COMMAND_LINE]
    assert status_of(*words, "--realisations", "2:4", "--out", str(tmp_path / "part")) == 0
    part = ec.Result.load(tmp_path / "part")
    for name, values in part.variables.items():
        assert values.tobytes() == whole.variables[name][:, 2:4].tobytes()
    again = ["run", str(tmp_path / "part" / "run.toml"), "--out", str(tmp_path / "again")]
    assert status_of(*again) == 0
    assert same_variables(ec.Result.load(tmp_path / "again"), part)
