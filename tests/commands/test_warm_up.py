"""`warm-up`: which runs it takes, and that they compile what real runs need."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import pytest

from ellipsoid_coupling.cli import main
from ellipsoid_coupling.commands.warm_up import compile_all, tiny_runs
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models import SCHEMES, kind_named, model_kinds


def silent(_stage: str, _part: float) -> None:
    pass


def test_every_model_and_scheme_with_and_without_interaction() -> None:
    """At the scenes' own resolution, by which methods are chosen, and for a short time."""
    runs = tiny_runs((), None, silent)
    ours = [kind for kind in model_kinds() if kind.rank < 100]
    made = {(run.model, run.scheme, run.scene.interaction is not None) for run in runs}
    for kind, scheme, interacting in product(ours, SCHEMES, (True, False)):
        # A state at rest needs a potential, and of such scenes there is one with interaction.
        if interacting or not kind.equilibrium:
            assert (kind.name, scheme, interacting) in made
    for run in runs:
        assert run.scene.times[-1] < 0.01
        assert (run.flow is None) == (run.scene.flow is None)


def test_own_scenes_and_some_models(tmp_path: Path) -> None:
    runs = tiny_runs(("rotation",), ["microscopic", "diffusive"], silent)
    assert {(run.scene.name, run.model) for run in runs} == {
        ("rotation", "microscopic"),
        ("rotation", "diffusive"),
    }
    with pytest.raises(InputError, match="one of"):
        tiny_runs((), ["nonsense"], silent)
    with pytest.raises(InputError, match="models that fit"):
        tiny_runs(("rotation",), ["stationary_state"], silent)
    with pytest.raises(InputError, match="neither"):
        tiny_runs((str(tmp_path / "none.toml"),), None, silent)


def test_progress_counts_the_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[str, float]] = []
    ran: list[tuple[str, str]] = []

    def simulate(_scene: object, model: str, scheme: str, flow: object) -> SimpleNamespace:
        del flow
        ran.append((model, scheme))
        return SimpleNamespace(attributes={"compile_seconds": 1.5})

    monkeypatch.setattr("ellipsoid_coupling.simulation.simulate", simulate)
    runs = tiny_runs(("stationary",), ["microscopic"], silent)
    assert compile_all(runs, lambda stage, part: told.append((stage, part))) == 3.0
    assert ran == [("microscopic", scheme) for scheme in SCHEMES]
    assert told == [
        (f"1 of 2: stationary, microscopic, {SCHEMES[0]}", 0.0),
        (f"2 of 2: stationary, microscopic, {SCHEMES[1]}", 0.5),
        ("warm-up", 1.0),
    ]


def test_a_mistake_is_one_message(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["warm-up", "--model", "nonsense"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("expected") == 1


@pytest.mark.heavy
@pytest.mark.parametrize("model", ["microscopic", "rho_mono_kinetic"])
def test_after_it_a_real_run_compiles_nothing(model: str, tmp_path: Path) -> None:
    """In a cache of its own: none of the run's seconds is numba's."""
    assert kind_named(model).name == model
    changed = os.environ | {"ELLIPSOID_CACHE": str(tmp_path / "cache")}
    start = [sys.executable, "-m", "ellipsoid_coupling"]
    warm = [*start, "warm-up", "cavity_free", "--model", model]
    subprocess.run(warm, env=changed, check=True, capture_output=True)
    out = tmp_path / "run"
    run = [*start, "run", "cavity_free", "--model", model, "--out", str(out)]
    run += ["--set", "times=[0.05]", "particles.realisations=2"]
    subprocess.run(run, env=changed, check=True, capture_output=True)
    script = "import sys, ellipsoid_coupling as ec; print(ec.Result.load(sys.argv[1]).attributes"
    command = [sys.executable, "-c", f"{script}['compile_seconds'])", str(out)]
    done = subprocess.run(command, env=changed, check=True, capture_output=True, text=True)
    assert float(done.stdout) == 0.0
