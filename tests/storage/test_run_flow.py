"""What a run was given it keeps: every later command takes the flow from the run's folder."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, WallVelocity, Wanted, provide
from ellipsoid_coupling.flow.openfoam import programs, solve, solved_cases
from ellipsoid_coupling.flow.provide import SHIPPED
from ellipsoid_coupling.simulation import scene_flow
from ellipsoid_coupling.storage.run_flow import load_runs, run_flow
from tests.command_line import status_of

SMALL = ["--set", "particles.number=20", "particles.realisations=1", "times=[0.1, 0.2]"]
SMALL += ["particles.length=0.1", "particles.width=0.05", "numerics.cell=0.1"]


@pytest.fixture(autouse=True)
def no_solver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """No program of OpenFOAM's may start, and the cache of flows is empty; the cache's folder."""

    def refuse(*_details: Any, **_more: Any) -> None:
        raise AssertionError("a program was started")

    for module, name in (
        (provide, "solve_case"), (solve, "run_program"), (programs, "openfoam_version"),
        (solved_cases, "openfoam_version"),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, refuse)
    monkeypatch.setattr(provide, "openfoam_available", lambda: True)
    monkeypatch.setenv("ELLIPSOID_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def lid(speed: float, nodes: int = 13) -> FlowField:
    """A lid that moves with speed sin(pi x)^2 over the unit box."""
    at = np.linspace(0.0, 1.0, nodes)
    along = speed * np.sin(np.pi * at) ** 2
    still = np.zeros(nodes)
    walls = WallVelocity(bottom=still, top=along, left=still, right=still)
    psi = np.outer(at**2 * (at - 1.0), along)
    return FlowField.from_stream_function(psi, at, at, f"a lid of speed {speed:g}", walls)


def saved(flow: FlowField, path: Path) -> Path:
    flow.save(path)
    return path


def run(folder: Path, flow: Path, *more: str) -> None:
    tokens = ["run", "cavity_free", "--model", "microscopic", "--scheme", "paper", *SMALL]
    assert status_of(*tokens, *more, "--flow", str(flow), "--out", str(folder)) == 0


@pytest.fixture
def fast(tmp_path: Path) -> Path:
    """The folder of a run in a flow of its own; the file that this came from is gone."""
    own = saved(lid(2.0), tmp_path / "own.npz")
    run(tmp_path / "fast", own)
    own.unlink()
    return tmp_path / "fast"


def test_a_flow_for_a_scene_without_fluid_is_refused() -> None:
    """As a field like as a path: a run without it would carry its name."""
    for flow in (lid(1.0), "somewhere", Path("somewhere"), Wanted(Path("somewhere"))):
        with pytest.raises(InputError, match="Leave out --flow"):
            ec.simulate(ec.load_scene("stationary"), "microscopic", flow=flow)
    assert scene_flow(ec.load_scene("stationary"), Wanted(allow_misfit=True)) is None


def test_the_run_folder_holds_the_flow(fast: Path) -> None:
    told = tomllib.loads((fast / "run.toml").read_text())["run"]
    result = ec.Result.load(fast)
    assert FlowField.load(fast / "flow.npz").digest == told["flow_digest"] == lid(2.0).digest
    assert result.attributes["flow_digest"] == told["flow_digest"]
    assert result.attributes["flow"] == told["flow"] == "given: a lid of speed 2"


def test_later_commands_take_the_run_s_own_flow(
    fast: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And none of them starts a program."""
    seen: list[tuple[str, FlowField]] = []

    def note(name: str) -> Callable[..., None]:
        def noted(*details: Any, **more: Any) -> None:
            found = [*details, *more.values()]
            lists = [part for part in found if isinstance(part, list)]
            flows = [f for part in [found, *lists] for f in part if isinstance(f, FlowField)]
            seen.extend((name, flow) for flow in flows)

        return noted

    monkeypatch.setattr("ellipsoid_coupling.output.paraview.export", note("export"))
    monkeypatch.setattr("ellipsoid_coupling.output.figures.draw_all", note("figures"))
    monkeypatch.setattr("ellipsoid_coupling.compare.compare_runs", note("compare"))
    monkeypatch.setattr("ellipsoid_coupling.output.frontier_report.report_frontiers", note("-"))
    assert status_of("export", str(fast)) == 0
    assert status_of("export", str(fast / "result.nc"), "--force") == 0
    assert status_of("figures", str(fast), "--out", str(tmp_path / "f")) == 0
    assert status_of("compare", str(fast), "--out", str(tmp_path / "c")) == 0
    assert [name for name, _ in seen] == ["export", "export", "figures", "compare"]
    assert {flow.digest for _, flow in seen} == {lid(2.0).digest}


def test_a_run_is_repeated_in_its_own_flow(fast: Path, tmp_path: Path) -> None:
    """Bit for bit; with --flow in that one."""
    again, other = tmp_path / "again", tmp_path / "other"
    assert status_of("run", str(fast / "run.toml"), "--out", str(again)) == 0
    first, second = ec.Result.load(fast), ec.Result.load(again)
    assert np.array_equal(first.variables["x"], second.variables["x"])
    assert (again / "flow.npz").is_file()
    slow = saved(lid(1.0), tmp_path / "slow.npz")
    assert status_of("run", str(fast / "run.toml"), "--flow", str(slow), "--out", str(other)) == 0
    assert ec.Result.load(other).attributes["flow_digest"] == lid(1.0).digest


def test_settings_that_name_another_flow_take_that_one(
    fast: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    tokens = ["run", str(fast / "run.toml"), "--out", str(tmp_path / "b")]
    formula = ["flow.source=closed_form", "flow.field=shear", "domain.boundary=open"]
    assert status_of(*tokens, "--set", *formula) == 0
    assert "formula u = (y, 0)" in capsys.readouterr().out
    assert status_of(*tokens, "--force", "--set", "flow=none") == 0
    assert not (tmp_path / "b" / "flow.npz").exists()


def damaged(folder: Path, how: str) -> None:
    file = folder / "flow.npz"
    if how == "another":
        lid(2.0 + 1e-12).save(file)
    elif how == "cut":
        file.write_bytes(file.read_bytes()[:200])
    elif how == "a run.toml of another":
        text = (folder / "run.toml").read_text()
        text = re.sub(r'flow_digest = "\w+"', 'flow_digest = "0123456789abcdef"', text)
        (folder / "run.toml").write_text(text)
    elif how == "nobody tells":
        (folder / "run.toml").unlink()
        result = ec.Result.load(folder)
        del result.attributes["flow_digest"]
        result.save(folder / "result.nc")
    else:
        file.unlink()


WRONG = {
    "another": "expected the flow that the run used, digest",
    "cut": "flow.npz",
    "a run.toml of another": "digest 0123456789abcdef",
    "nobody tells": "digest unknown",
    "gone": r"--flow CASE",
}
COMMANDS = ("export", "figures", "compare", "run", "resume")
# Without run.toml there is nothing to repeat; a run that has not come so far has its flow elsewhere.
MEANT = [
    (how, command)
    for how in WRONG
    for command in COMMANDS
    if (how, command)
    not in (("nobody tells", "run"), ("nobody tells", "resume"), ("gone", "resume"))
]


@pytest.mark.parametrize(("how", "command"), MEANT)
def test_another_flow_in_the_folder_is_refused(
    how: str, command: str, fast: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One message, status 2, nothing written; where it is gone nothing is solved either."""
    damaged(fast, how)
    out = ["--out", str(tmp_path / "out")]
    tokens = {
        "export": ["export", str(fast)],
        "figures": ["figures", str(fast), *out],
        "compare": ["compare", str(fast), *out],
        "run": ["run", str(fast / "run.toml"), *out],
        "resume": ["run", str(fast / "run.toml"), "--out", str(fast), "--resume"],
    }[command]
    capsys.readouterr()
    assert status_of(*tokens) == 2
    _, err = capsys.readouterr()
    assert re.search(WRONG[how], err), err
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()
    assert not (fast / "paraview").exists()


def older(folder: Path, flow: Path, *more: str) -> Path:
    """A run folder as an older version left it: nothing but run.toml tells of the flow."""
    run(folder, flow, *more)
    (folder / "flow.npz").unlink()
    result = ec.Result.load(folder)
    del result.attributes["flow_digest"]
    result.save(folder / "result.nc")
    return folder


def test_an_older_folder_takes_the_shipped_field_if_it_is_the_one(tmp_path: Path) -> None:
    folder = older(tmp_path / "a", SHIPPED / "cavity.npz")
    _, (found,) = load_runs([folder])
    assert found is not None
    assert found.digest == FlowField.load(SHIPPED / "cavity.npz").digest
    other = older(tmp_path / "b", saved(lid(1.0), tmp_path / "own.npz"))
    with pytest.raises(InputError, match=r"run\.toml --flow CASE"):
        load_runs([other])


def test_an_older_folder_takes_the_cache_s_field_if_it_is_the_one(
    no_solver: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two solutions with as many cells, that one."""
    fields = {"cavity-100-aa": lid(1.0), "cavity-100-bb": lid(2.0)}
    for name in (*fields, "cavity-50-cc"):
        (no_solver / "flows" / name).mkdir(parents=True)
        (no_solver / "flows" / name / "case.foam").write_text("key")
    monkeypatch.setattr(provide, "kept_field", lambda solved, *_, **__: fields[solved.name])
    folder = older(tmp_path / "a", saved(lid(2.0), tmp_path / "own.npz"))
    scene = ec.load_scene("cavity_free")
    found = run_flow(folder, scene)
    assert found is not None
    assert found.digest == lid(2.0).digest
    with pytest.raises(InputError, match="the flow that the run used"):
        run_flow(older(tmp_path / "b", saved(lid(3.0), tmp_path / "own.npz")), scene)


def test_an_older_folder_takes_a_formula(tmp_path: Path) -> None:
    """Unless the run was given another flow instead."""
    formula = ["flow.source=closed_form", "flow.field=rotation", "domain.boundary=open"]
    own = saved(lid(1.0), tmp_path / "own.npz")
    folder = older(tmp_path / "a", own, *formula)
    with pytest.raises(InputError, match="the flow that the run used"):
        load_runs([folder])
    (folder / "run.toml").unlink()
    _, (found,) = load_runs([folder / "result.nc"])
    assert found is not None
    assert found.origin == "formula u = (y, -x)"


def test_figures_draw_each_run_s_own_flow(
    fast: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slow = tmp_path / "slow"
    run(slow, saved(lid(1.0), tmp_path / "own.npz"))
    assert status_of("figures", str(fast), str(slow), "--out", str(tmp_path / "figures")) == 0
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {"flow_cavity_free.png", "flow_cavity_free_2.png"} <= names
    ellipses = {f"ellipses_cavity_free_microscopic_flow_{k}.png" for k in (1, 2)}
    assert ellipses <= names
    capsys.readouterr()
    assert status_of("compare", str(fast), str(slow), "--out", str(tmp_path / "c")) == 2
    err = capsys.readouterr().err
    assert "expected runs in one flow, found given: a lid of speed 2 (digest" in err
    assert not (tmp_path / "c").exists()


class Stop(BaseException):
    pass


def stopped(folder: Path, flow: FlowField, scene: ec.Scene) -> ec.RunFolder:
    """A run that was stopped half-way, with a checkpoint."""

    def stop(_stage: str, part: float) -> None:
        if part > 0.6:
            raise Stop

    place = ec.RunFolder(folder, checkpoint_seconds=0.0)
    with pytest.raises(Stop):
        ec.simulate(scene, "microscopic", "paper", flow=flow, folder=place, report=stop)
    return ec.RunFolder(folder, resume=True)


def small_scene() -> ec.Scene:
    settings = {"particles.number": 20, "particles.realisations": 1, "times": [0.2, 0.6]}
    return ec.load_scene("cavity_free", settings)


def test_a_resumed_run_has_its_flow_from_its_folder(tmp_path: Path) -> None:
    """Digests are compared, not words: what was solved then is not solved, or named, anew."""
    from dataclasses import replace

    scene, flow = small_scene(), replace(lid(1.0), origin="new icoFoam run: of then")
    expected = ec.simulate(scene, "microscopic", "paper", flow=flow)
    place = stopped(tmp_path / "a", flow, scene)
    resumed = ec.simulate(scene, "microscopic", "paper", folder=place)
    assert np.array_equal(resumed.variables["x"], expected.variables["x"])
    assert resumed.attributes["flow"] == flow.origin
    place = stopped(tmp_path / "b", flow, scene)
    third = stopped(tmp_path / "c", flow, scene)
    asked = Wanted(allow_misfit=True)
    again = ec.simulate(scene, "microscopic", "paper", flow=asked, folder=third)
    assert again.attributes["flow"] == flow.origin
    cached = replace(flow, origin="cache: of now")
    assert ec.simulate(scene, "microscopic", "paper", flow=cached, folder=place).status == (
        "completed"
    )


def test_a_run_killed_before_its_flow_was_written_gets_it_when_resumed(
    tmp_path: Path,
) -> None:
    place = stopped(tmp_path, lid(1.0), small_scene())
    (tmp_path / "flow.npz").unlink()
    (tmp_path / ".flow.1234.npz").write_bytes(b"half")
    ec.simulate(small_scene(), "microscopic", "paper", flow=lid(1.0), folder=place)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["flow.npz", "result.nc", "run.toml"]
    assert FlowField.load(tmp_path / "flow.npz").digest == lid(1.0).digest
