"""Runs in a flow that changes in time, from the command line to ParaView: folders, resuming, repeating."""

from __future__ import annotations

import shutil
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField, FlowSeries, load_flow
from tests.command_line import status_of
from tests.written_cases import plate, write_case

BOX = ((-1.0, 2.0), (0.0, 1.0))
NAMES = ("0", "0.25", "0.5", "0.75", "1")
SCENE = """
name = "plate"
times = [0.4, 0.75, 1.0]
domain = { x = [0.0, 1.0], y = [0.0, 1.0], boundary = "open" }
particles = { length = 0.1, width = 0.05, number = 8 }
start = { x = [0.4, 0.6], y = [0.2, 0.4] }
flow = { case = "cases/plate", time = "all", drag = 10.0, angular_drag = 10.0 }
numerics = { cell = 0.1, angle_cells = 8, time_step = 0.015625 }
"""


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene file and, in a folder beside it, its case."""
    folder = tmp_path_factory.mktemp("moving")
    flows = {name: plate(float(name)) for name in NAMES}
    write_case(folder / "cases" / "plate", BOX, (12, 8), flows)
    (folder / "plate.toml").write_text(SCENE)
    return folder


@pytest.fixture
def folder(solved: Path, tmp_path: Path) -> Path:
    """A copy of both, which may be spoilt."""
    return shutil.copytree(solved, tmp_path / "mine")


def scene_of(folder: Path, **settings: object) -> ec.Scene:
    return ec.load_scene(
        folder / "plate.toml", {k.replace("__", "."): v for k, v in settings.items()}
    )


def same(one: ec.Result, other: ec.Result) -> bool:
    names = set(one.variables) | set(other.variables)
    return all(np.array_equal(one.variables[name], other.variables[name]) for name in names)


def test_a_run_keeps_all_times_and_later_commands_take_them(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The case is found beside the scene's file, and no more needed after the run."""
    run = tmp_path / "run"
    tokens = ["run", str(folder / "plate.toml"), "--model", "microscopic", "--out", str(run)]
    assert status_of(*tokens) == 0
    assert "5 times from 0 to 1, linear in" in capsys.readouterr().out
    told = tomllib.loads((run / "run.toml").read_text())
    assert told["scene"]["flow"]["time"] == "all"
    assert told["scene"]["flow"]["case"] == str(folder / "cases" / "plate")
    flow = load_flow(run / "flow.npz")
    assert isinstance(flow, FlowSeries)
    assert (
        flow.digest == told["run"]["flow_digest"] == ec.Result.load(run).attributes["flow_digest"]
    )
    shutil.rmtree(folder / "cases")
    again = tmp_path / "again"
    assert status_of("run", str(run / "run.toml"), "--out", str(again)) == 0
    assert same(ec.Result.load(run), ec.Result.load(again))
    assert (again / "flow.npz").read_bytes() == (run / "flow.npz").read_bytes()
    given = tmp_path / "given"
    tokens[-1] = str(given)
    assert status_of(*tokens, "--flow", str(run / "flow.npz")) == 0
    assert same(ec.Result.load(run), ec.Result.load(given))
    assert status_of("compare", str(run), "--out", str(tmp_path / "compared")) == 0
    assert status_of("figures", str(run), "--out", str(tmp_path / "figures")) == 0
    assert (tmp_path / "figures" / "flow_plate.png").is_file()
    # Another field for one of the times: refused when it is drawn, and named.
    broken = FlowSeries.of_fields(flow.times, [flow.at(0.0)] * 4 + [flow.at(0.5)])
    broken.save(run / "flow.npz")
    capsys.readouterr()
    assert status_of("export", str(run)) == 2
    assert "the flow that the run used, digest" in capsys.readouterr().err


def test_exports_have_the_flow_of_each_time(folder: Path, tmp_path: Path) -> None:
    """A series for each file of a steady flow's; velocities are those of `at`."""
    import pyvista

    run = tmp_path / "run"
    result = ec.simulate(scene_of(folder), "microscopic", folder=run)
    assert status_of("export", str(run)) == 0
    flow = load_flow(run / "flow.npz")
    for name, suffix in (("flow", "vti"), ("flow_particles", "vtp"), ("flow_cells", "vti")):
        entries = ET.parse(run / "paraview" / f"{name}.pvd").getroot().iter("DataSet")
        times = {float(e.attrib["timestep"]): e.attrib["file"] for e in entries}
        assert list(times) == [0.4, 0.75, 1.0]
        for number, (time, file) in enumerate(times.items()):
            mesh: Any = pyvista.read(run / "paraview" / file)
            assert file == f"{name}_{number:04d}.{suffix}"
            x, y, _ = np.moveaxis(
                mesh.cell_centers().points if name == "flow_cells" else mesh.points, 1, 0
            )
            velocity = mesh["velocity"][:, 0]
            np.testing.assert_allclose(velocity, flow.at(time).evaluate(x, y).velocity_x, atol=1e-6)
            if name == "flow_particles":
                assert np.allclose(x, result.variables["x"][number, 0])


class Stop(BaseException):
    pass


MODELS = [
    ("microscopic", "paper"),
    ("microscopic", "accurate"),
    ("rho_mono_kinetic", "accurate"),
    ("q_mono_kinetic", "accurate"),
    ("q_maxwellian", "accurate"),
]


@pytest.mark.parametrize(("model", "scheme"), MODELS)
@pytest.mark.parametrize("repeat", [False, True])
def test_a_resumed_run_goes_on_to_the_bit(
    model: str, scheme: str, repeat: bool, folder: Path, tmp_path: Path
) -> None:
    """Wherever it was stopped, also between a save time and the next time of the flow."""
    times = [0.3, 0.75, 1.6] if repeat else [0.3, 0.75, 1.0]
    scene = scene_of(folder, times=times, flow__repeat=repeat)
    how = {"model": model, "scheme": scheme}
    whole = ec.simulate(scene, **how)  # type: ignore[arg-type]
    last = -1.0

    def stop(_stage: str, part: float) -> None:
        nonlocal last
        if 0.0 < part < 1.0 and part > last + 0.09 and "reading" not in _stage:
            last = part
            raise Stop

    for number in range(50):
        place = ec.RunFolder(tmp_path / "run", resume=number > 0, checkpoint_seconds=0.0)
        flow = None if number else folder / "cases" / "plate"
        try:
            resumed = ec.simulate(scene, **how, folder=place, flow=flow, report=stop)  # type: ignore[arg-type]
        except Stop:
            continue
        break
    assert number >= 3
    assert same(resumed, whole)


def test_two_periods_by_repeat_are_two_written_out(folder: Path) -> None:
    """To the bit; the times are such that they are added without rounding."""
    scene = scene_of(folder, times=[0.4, 1.1, 2.0], flow__repeat=True)
    fields = plate_fields(folder)
    fields[4] = fields[0]
    once = FlowSeries.of_fields([float(name) for name in NAMES], fields, repeat=True)
    out = FlowSeries.of_fields([0.25 * k for k in range(9)], [*fields, *fields[1:]])
    for model in ("microscopic", "rho_mono_kinetic"):
        results = [ec.simulate(scene, model, flow=flow) for flow in (once, out)]
        assert same(*results)
        assert results[0].status == "completed"


def plate_fields(folder: Path) -> list[FlowField]:
    from ellipsoid_coupling.flow.openfoam.reader import read_case

    return [read_case(folder / "cases" / "plate" / name) for name in NAMES]


def test_equal_fields_give_particles_the_bits_of_a_steady_flow(folder: Path) -> None:
    """Where save times are those of the flow: steps then end at the same times in both.

    A steady case in five folders is read as a steady flow, so that this holds for all models and save
    times; here it is a series all the same.
    """
    field = plate_fields(folder)[1]
    series = FlowSeries.of_fields([float(name) for name in NAMES], [field] * 5)
    scene = scene_of(folder, times=[0.25, 0.5, 0.75, 1.0])
    for scheme in ("paper", "accurate"):
        results = [ec.simulate(scene, "microscopic", scheme, flow=f) for f in (series, field)]
        assert same(*results)


@pytest.mark.parametrize(
    ("model", "scheme"), [("microscopic", "accurate"), ("rho_mono_kinetic", "paper")]
)
def test_steps_end_where_the_flow_is_given(
    model: str, scheme: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At every time of the flow, exactly, and with the pair of fields around."""
    from ellipsoid_coupling.flow.window import SeriesWindow

    seen: list[float] = []
    move = SeriesWindow.move_to

    def moved(self: SeriesWindow, t: float) -> bool:
        assert t <= self.until
        changed = move(self, t)
        if changed:
            seen.append(t)
        return changed

    monkeypatch.setattr(SeriesWindow, "move_to", moved)
    result = ec.simulate(scene_of(folder), model, scheme)  # type: ignore[arg-type]
    assert seen == [0.25, 0.5, 0.75]
    assert result.status == "completed"


def test_what_does_not_fit_is_refused_before_anything_is_written(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    tokens = [
        "run",
        str(folder / "plate.toml"),
        "--model",
        "microscopic",
        "--out",
        str(out),
        "--set",
    ]
    for setting, message in (
        ("times=[1.5]", "covers the scene's times [0, 1.5], found one at [0, 1]"),
        ("flow.time=[0.5, 1.0]", "covers the scene's times [0, 1], found one at [0, 0.5]"),
        ("flow.time=0.6", "a time with U (0, 0.25, ..., 1), found 0.6"),
        ("flow.time=first", "flow.time"),
        ("flow.time=[1.0, 0.5]", "time = [low, high] with low < high"),
        ("flow.field=cavity", "either field or case"),
        ("flow.source=closed_form", "case, time, repeat and divergence are OpenFOAM's"),
        ("flow.case=elsewhere", "elsewhere: expected a solved OpenFOAM case folder"),
    ):
        assert status_of(*tokens, setting) == 2, setting
        err = capsys.readouterr().err
        assert message in err, err
        assert "Traceback" not in err
        assert not out.exists()
    with pytest.raises(InputError, match="stationary"):
        ec.simulate(scene_of(folder), "stationary_state")


def test_a_field_lost_on_the_way_fails_the_run_and_keeps_what_was_reached(
    folder: Path, tmp_path: Path
) -> None:
    """Which time is the first one that is missed depends on how far ahead it has been read."""
    series = FlowSeries.of_fields([float(name) for name in NAMES], plate_fields(folder))

    def spoil(_stage: str, _part: float) -> None:
        series.path.write_bytes(b"")

    with pytest.raises(RunError, match=r"The flow at time [\d.]+ cannot be read"):
        ec.simulate(
            scene_of(folder), "microscopic", flow=series, folder=tmp_path / "run", report=spoil
        )
    result = ec.Result.load(tmp_path / "run")
    assert result.status.startswith("failed: The flow at time ")
    assert list(result.times) in ([], [0.4])


def test_the_last_time_alone_stays_the_default(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With a line that says so."""
    scene = scene_of(folder, flow__time="latest", times=[0.1])
    result = ec.simulate(scene, "microscopic")
    assert "time 1, the last of 4, changed by" in str(result.attributes["flow"])
    assert status_of("plan", str(folder / "plate.toml")) == 0
    assert "all times" in capsys.readouterr().out
