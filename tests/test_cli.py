"""The command line: exit statuses, one clear message, folders."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.result import Result
from tests.command_line import FLOW, SMALL, status_of


def run_small(folder: Path, model: str, scene: str = "cavity_free") -> None:
    assert status_of("run", scene, "--model", model, *FLOW, *SMALL, "--out", str(folder)) == 0


def test_run_leaves_a_run_folder_and_prints_its_path_last(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_small(tmp_path / "a", "microscopic", "cavity")
    out, err = capsys.readouterr()
    assert out.strip().splitlines()[-1] == str(tmp_path / "a")
    assert "100 %" in err  # plain lines, as there is no terminal
    assert "\x1b" not in err
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == [
        "flow.npz", "result.nc", "run.toml",
    ]  # fmt: skip


def test_a_run_is_repeated_from_its_run_toml(tmp_path: Path) -> None:
    run_small(tmp_path / "a", "microscopic")
    again = ["run", str(tmp_path / "a" / "run.toml"), "--out", str(tmp_path / "b")]
    assert status_of(*again) == 0
    first, second = Result.load(tmp_path / "a"), Result.load(tmp_path / "b")
    assert (first.variables["x"] == second.variables["x"]).all()


BAD: list[tuple[list[str], str]] = [
    (["run", "cavity", "--model", "nonsense", *FLOW], "rho_mono_kinetic"),
    (["run", "cavity", "--model", "microscopic", "--scheme", "best", *FLOW], "accurate"),
    (["run", "no_scene", "--model", "microscopic"], "cavity_free"),
    (["run", "cavity"], "--model"),
    (["run", "cavity", "--model", "microscopic", "--set", "nonsense"], "key=value"),
    (["run", "cavity", "--model", "microscopic", "--set", "particles.size=3"], "particles.size"),
    (["run", "cavity", "--model", "microscopic", "--set", "particles.length=-1"], "greater than 0"),
    (["run", "cavity", "--model", "microscopic", "--flow", "nowhere"], "nowhere"),
    (["run", "cavity", "--model", "microscopic", "--resume"], "--out"),
    (["run", "cavity", "--model", "microscopic", "--realisations", "0", *FLOW], "from 1"),
    (["run", "cavity", "--modell", "microscopic"], "--model"),
    (["run"], "SCENE"),
    (["plan", "cavity", "--model", "nonsense"], "microscopic"),
    (["flow", "no_such_case"], "no_such_case"),
    (["compare", "nowhere"], "nowhere"),
    (["compare", "rotation", "--longest", "0"], "--longest"),
    (["figures", "nowhere"], "nowhere"),
    (["export", "nowhere"], "nowhere"),
    (["sail"], "sail"),
]


# What the command line and the scene alone tell wrong.
BEFORE_A_FLOW: list[tuple[list[str], str]] = [
    (["--model", "nonsense"], "rho_mono_kinetic"),
    (["--model", "microscopic", "--scheme", "best"], "accurate"),
    (["--model", "microscopic", "--set", "particles.size=3"], "particles.size"),
    (["--model", "microscopic", "--set", "times=[2.0, 1.0]"], "increasing times"),
    (["--model", "microscopic", "--seed", "-1"], "--seed"),
    (["--model", "microscopic", "--realisations", "0"], "--realisations"),
    (["--model", "microscopic", "--set", "particles.number=1000000000000"], "TB"),
    (["--model", "microscopic", "--longest", "0"], "--longest"),
    (["--model", "microscopic", "--out", __file__], "a folder"),
    (["--model", "microscopic", "--out", str(Path(__file__).parent)], "--force"),
    (["--model", "microscopic", "--resume", "--out", str(Path(__file__).parent)], "to resume"),
    (["--model", "rho_mono_kinetic", "--set", "numerics.cell=0.7"], "whole cells"),
    (["--model", "q_mono_kinetic", "--set", "numerics.cell=0.7"], "whole cells"),
    (["--model", "q_mono_kinetic", "--set", "numerics.angle_cells=2"], "angle cells"),
    (["--model", "diffusive", "--set", "flow.drag=0"], "no diffusive limit"),
    (["--model", "stationary_state"], "no [flow]"),
]


# Likewise of other commands.
OTHERS_BEFORE_A_FLOW: list[tuple[list[str], str]] = [
    (["advise", "cavity", "--error", "0"], "--error"),
    (["advise", "cavity", "--error", "nan"], "--error"),
    (["advise", "cavity", "--error", "0.1", "--seconds", "0"], "--seconds"),
    (["compare", "cavity", "--longest", "0"], "--longest"),
]


@pytest.mark.parametrize(
    ("tokens", "told"),
    [
        *((["run", "cavity", *tokens], told) for tokens, told in BEFORE_A_FLOW),
        *OTHERS_BEFORE_A_FLOW,
    ],
    ids=lambda v: " ".join(v)[-50:],
)
def test_what_is_wrong_is_told_before_a_flow_is_touched(
    tokens: list[str],
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Whoever asks for a flow fails the test."""

    def touched(*_: object, **__: object) -> None:
        raise AssertionError("a flow is touched")

    monkeypatch.setattr("ellipsoid_coupling.simulation.scene_flow", touched)
    assert status_of(*tokens) == 2
    assert told in capsys.readouterr().err


def test_resuming_another_run_is_refused_before_a_flow_is_touched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_small(tmp_path / "a", "microscopic")

    def touched(*_: object, **__: object) -> None:
        raise AssertionError("a flow is touched")

    monkeypatch.setattr("ellipsoid_coupling.simulation.scene_flow", touched)
    tokens = ["run", "cavity_free", "--model", "microscopic", *SMALL, "--seed", "7"]
    assert status_of(*tokens, "--out", str(tmp_path / "a"), "--resume") == 2
    assert "[run] seed" in capsys.readouterr().err


@pytest.mark.parametrize(("tokens", "told"), BAD, ids=lambda value: " ".join(value)[:60])
def test_bad_input_gets_one_message_and_status_2(
    tokens: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_of(*tokens) == 2
    out, err = capsys.readouterr()
    assert told in err
    assert "Traceback" not in err + out


def test_a_failed_run_has_status_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stiff = [*SMALL, "flow.drag=1e6", "times=[5.0]"]
    tokens = ["run", "cavity_free", "--model", "microscopic", "--scheme", "paper", *FLOW, *stiff]
    assert status_of(*tokens, "--out", str(tmp_path)) == 1
    assert "beyond what forces" in capsys.readouterr().err
    assert Result.load(tmp_path).status.startswith("failed")


def test_plan_lists_every_term(capsys: pytest.CaptureFixture[str]) -> None:
    assert status_of("plan", "cavity_free", "--model", "rho_mono_kinetic") == 0
    out = capsys.readouterr().out
    for term in ("flow", "interaction", "walls", "outer_potential", "noise", "angle"):
        assert term in out
    assert "no [interaction]: no neighbour list, no kernel spectra" in out


def test_compare_export_and_figures_of_finished_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [str(tmp_path / model) for model in ("microscopic", "rho_mono_kinetic")]
    for folder in runs:
        run_small(Path(folder), Path(folder).name)
    assert status_of("compare", *runs, "--out", str(tmp_path / "compare")) == 0
    assert (tmp_path / "compare" / "errors.csv").is_file()
    assert len(list((tmp_path / "compare").glob("*.png"))) == 1
    assert status_of("figures", *runs, "--out", str(tmp_path / "figures")) == 0
    assert len(list((tmp_path / "figures").glob("*.png"))) >= 4
    for folder in runs:
        assert status_of("export", folder) == 0
        assert list(Path(folder, "paraview").glob("*.pvd"))
    assert capsys.readouterr().out.strip().splitlines()[-1] == str(Path(runs[-1]) / "paraview")


def test_every_command_has_help(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("flow", "plan", "run", "compare", "stability", "export", "figures"):
        assert status_of(command, "--help") == 0
        assert command in capsys.readouterr().out


def test_both_ways_to_start_it() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "ellipsoid_coupling", "--version"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "0.1.0"


@pytest.mark.parametrize(
    ("tokens", "work"),
    [
        (["run", "rotation", "--model", "microscopic"], "simulation.simulate"),
        (["compare", "rotation"], "compare.run_frontier"),
        (["stability", "--quick"], "compare.stability.map_stability"),
        (["flow", "cavity"], "flow.openfoam.solve.solve_case"),
    ],
)
def test_a_command_says_something_before_its_work_begins(
    tokens: list[str],
    work: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Before a kernel is compiled or a flow solved: the first thing that takes long."""
    before: list[str] = []

    def begin(*_: object, **__: object) -> None:
        before.append(capsys.readouterr().err)
        raise InputError("test", "an end", "a beginning", "Stop here.")

    monkeypatch.setattr(f"ellipsoid_coupling.{work}", begin)
    assert status_of(*tokens) == 2
    assert f"{tokens[0]}: 0 %" in before[0].splitlines()
