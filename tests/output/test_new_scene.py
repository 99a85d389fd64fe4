"""`ellipsoid new`: a scene that loads, fits its flow and runs, whatever the case's patches are called."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.grid import scene_grid
from ellipsoid_coupling.flow import FlowField, analytic_flow
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.new_scene import scene_text
from ellipsoid_coupling.output.scene_choices import Wishes, choose
from ellipsoid_coupling.scenes import Scene, load_scene, parse_toml, scene_to_toml
from ellipsoid_coupling.scenes.boundary import BoundaryPart
from ellipsoid_coupling.scenes.sides import known_kinds
from tests.command_line import status_of

DATA = Path(__file__).parents[1] / "data"
NAMES = ("inlet", "outlet", "low wall", "high wall")


def channel(
    names: tuple[str, ...] = NAMES,
    types: tuple[str, ...] = ("patch", "patch", "wall", "wall"),
    size: tuple[float, float] = (3.0, 1.0),
) -> FlowField:
    """The flow 4 y (1 - y) from the first patch, on the left, to the second: 2/3 flows through."""
    width, height = size
    x, y = np.linspace(0.0, width, 31), np.linspace(0.0, height, 11)
    eta = y / height
    psi = np.tile(((2.0 * eta**2 - 4.0 / 3.0 * eta**3) * height)[:, None], (1, x.size))
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    lines = {0: (3, 0), 1: (1, 2), 2: (0, 1), 3: (2, 3)}
    outline = polygon_outline(
        (names[k], types[k], corners[list(lines[k])], False) for k in range(len(names))
    )
    through = 2.0 / 3.0 * height
    outflow = np.array([-through, through, 0.0, 0.0])[: len(outline.outflow)]
    return FlowField.from_stream_function(
        psi, x, y, "a channel", outline=outline._replace(outflow=outflow)
    )


def text_of(field: FlowField, viscosity: float | None = None, wishes: Wishes | None = None) -> str:
    return scene_text(choose(field, "my case", viscosity, wishes), field, "/a/case", viscosity)


def loaded(text: str) -> Scene:
    return load_scene(parse_toml(text, "the new scene"))


def test_the_scene_fits_the_flow() -> None:
    """Domain the mesh's box, whole cells, start in the fluid, saved until the fluid has passed once."""
    scene = loaded(text_of(channel()))
    assert (scene.name, scene.domain.x, scene.domain.y) == ("my_case", (0.0, 3.0), (0.0, 1.0))
    grid = scene_grid(scene)
    assert (grid.ny, grid.nx, grid.cell) == (25, 75, 0.04)
    assert 0.0 < scene.start.x[0] < scene.start.x[1] < 3.0
    assert 0.0 < scene.start.y[0] < scene.start.y[1] < 1.0
    # The rms of 4 y (1 - y) is (8/15)^(1/2).
    assert scene.times[-1] == pytest.approx(3.0 / np.sqrt(8.0 / 15.0), rel=0.05)
    assert scene.numerics.time_step < scene.numerics.cell


def test_patches_get_their_kinds() -> None:
    """By type and by what flows through; an inlet where there is that kind."""
    scene = loaded(text_of(channel()))
    assert scene.boundaries is not None
    kinds = {name: part.kind for name, part in scene.boundaries.items()}
    inlet = "inlet" if "inlet" in known_kinds() else "remove"
    assert kinds == {
        "inlet": inlet, "outlet": "remove", "low wall": "reflect", "high wall": "reflect"
    }  # fmt: skip
    if inlet == "inlet":
        area = np.ptp(scene.start.x) * np.ptp(scene.start.y)
        assert scene.boundaries["inlet"].parameters["density"] == pytest.approx(
            1.0 / area, rel=1e-5
        )


def test_cyclic_patches_make_sides_periodic() -> None:
    """And the domain is exactly as long as the period, whatever the height."""
    types = ("cyclic", "cyclic", "wall", "symmetryPlane")
    scene = loaded(text_of(channel(types=types, size=(1.0, np.pi))))
    sides = {name: part.kind for name, part in scene.sides.items()}
    assert (sides["left"], sides["right"]) == ("periodic", "periodic")
    assert scene.domain.x == (0.0, 1.0)
    assert scene_grid(scene).nx > 10
    assert scene.domain.y[1] >= np.pi
    assert scene.domain.y[1] - np.pi < scene.numerics.cell


def test_rates_are_stokes_where_nu_is_known() -> None:
    wishes = Wishes(length=0.02, width=0.01, density=3.0)
    scene = loaded(text_of(channel(), 1e-3, wishes))
    rates = ec.stokes_rates(0.02, 0.01, 3.0, 1.0, 1e-3)
    assert scene.flow is not None
    found = (
        scene.flow.drag,
        scene.flow.angular_drag,
        scene.particles.mass,
        scene.particles.inertia,
    )
    assert found == pytest.approx(rates, rel=1e-5)
    assert (scene.particles.length, scene.particles.width) == (0.02, 0.01)
    with pytest.raises(InputError, match="width: expected at most the length"):
        text_of(channel(), None, Wishes(length=0.01, width=0.02))


def test_a_case_is_read_with_its_viscosity(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A decomposed one as well: nu is 0.1 in both."""
    for case in ("cavity_16", "collated_4"):
        assert status_of("new", str(DATA / case), "--length", "0.05", "--allow-misfit") == 0
        scene = loaded(capsys.readouterr().out)
        rates = ec.stokes_rates(0.05, 0.025, 2.0, 1.0, 0.1)
        assert scene.flow is not None
        assert scene.flow.drag == pytest.approx(rates.drag, rel=1e-5)
        assert scene.name == case
    # Nothing is written without --out.
    assert not list(tmp_path.iterdir())


def test_what_stands_behind_a_number_sign_can_be_switched_on() -> None:
    """Units, interaction and noise; what the noise is said to do is its stationary state, to two digits."""
    head, further = text_of(channel(), 1e-3).split("# Further terms")
    head = head.replace("# units", "units")
    lines = [line.removeprefix("# ") for line in further.splitlines()[1:]]
    scene = loaded("\n".join([head, *lines]))
    assert scene.units == "SI"
    assert scene.flow is not None
    assert scene.noise is not None
    assert scene.interaction is not None
    assert scene.interaction.strength == pytest.approx(scene.particles.mass * 8.0 / 15.0, rel=0.1)
    told = [float(re.findall(r"rms of ([\d.e+-]+)", line)[0]) for line in lines if "rms" in line]
    pairs = (
        (scene.noise.noise, scene.flow.drag),
        (scene.noise.angular_noise, scene.flow.angular_drag),
    )
    for rms, (noise, drag) in zip(told, pairs, strict=True):
        assert rms == pytest.approx(noise / np.sqrt(2.0 * drag + noise**2), rel=0.02)


def test_reynolds_numbers_beyond_stokes_are_told() -> None:
    assert "the true drag is larger" in text_of(channel(), 1e-3)
    assert "the true drag is larger" not in text_of(channel(), 1.0)
    assert "gives no nu" in text_of(channel())


@settings(max_examples=60, deadline=None)
@given(st.lists(st.text(min_size=1, max_size=20), min_size=4, max_size=4, unique=True))
def test_any_name_of_a_patch_is_quoted_right(names: list[str]) -> None:
    """Quotes, control characters, letters of all kinds, halves of letters: the text loads, names return."""
    assume(not {"left", "right", "bottom", "top"} & set(names))
    text = text_of(channel(tuple(names)))
    text.encode("utf-8")
    scene = loaded(text)
    printable = {name for name in names if name.isprintable()}
    assert set(scene.boundaries or {}) == printable


@settings(max_examples=60, deadline=None)
@given(st.text(alphabet=st.characters(exclude_categories=["C", "Z"]), min_size=1, max_size=20))
def test_a_scene_with_such_patches_survives_being_written(name: str) -> None:
    """As run.toml keeps it."""
    part = {name: BoundaryPart(kind="remove")}
    scene = load_scene("cavity_free").model_copy(update={"boundaries": part})
    assert tomllib.loads(scene_to_toml(scene))["boundaries"] == {name: {"kind": "remove"}}


def test_flows_that_make_no_scene_are_refused() -> None:
    still = FlowField.from_stream_function(
        np.zeros((11, 31)), np.linspace(0, 3, 31), np.linspace(0, 1, 11), "still"
    )
    solid = FlowField.from_stream_function(
        np.zeros((11, 31)), np.linspace(0, 3, 31), np.linspace(0, 1, 11), "solid",
        inside=np.zeros((10, 30), bool),
    )  # fmt: skip
    for bad, found in ((still, "at rest"), (solid, "no fluid")):
        with pytest.raises(InputError, match=found):
            text_of(bad)
    with pytest.raises(InputError, match="without an end"):
        text_of(analytic_flow("rotation"))


def test_without_an_outline_sides_follow_the_fluid() -> None:
    """What was saved by an older version: psi alone tells where the walls are."""
    field = channel()
    scene = loaded(text_of(FlowField(field.arrays, field.origin)))
    kinds = {name: part.kind for name, part in scene.sides.items()}
    assert kinds == {"left": "remove", "right": "remove", "bottom": "reflect", "top": "reflect"}


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    field = channel()
    path = tmp_path / "channel flow.npz"
    FlowField(field.arrays, field.origin).save(path)
    return path


def test_the_command_writes_once_and_tells_what_to_do(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new folder" / "my.toml"
    assert status_of("new", str(saved), "--out", str(out), "--length", "0.05") == 0
    told = capsys.readouterr().out
    assert f"ellipsoid run '{out}' --flow '{saved}' --model microscopic" in told
    assert load_scene(out).particles.length == 0.05
    before = out.read_text()
    assert status_of("new", str(saved), "--out", str(out)) == 2
    assert "--force" in capsys.readouterr().err
    assert out.read_text() == before
    assert status_of("new", str(saved), "--out", str(out), "--force") == 0
    assert out.read_text() != before


def test_a_misfit_that_is_allowed_here_is_allowed_in_what_comes_next(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A flow far off U would be refused there otherwise; nothing is added without the option."""
    for options, added in (([], ""), (["--allow-misfit"], " --allow-misfit")):
        out = tmp_path / f"{len(options)}.toml"
        assert status_of("new", str(saved), "--out", str(out), *options) == 0
        told = capsys.readouterr().out.splitlines()[1:]
        given = f"{out} --flow '{saved}'{added} --model microscopic"
        assert told == [f"  ellipsoid {command} {given}" for command in ("plan", "run")]


def test_without_out_the_scene_goes_to_standard_output(
    saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`ellipsoid new CASE > my.toml` is a scene."""
    assert status_of("new", str(saved)) == 0
    file = tmp_path / "my.toml"
    file.write_text(capsys.readouterr().out)
    assert load_scene(file).name == "channel_flow"


def test_the_new_scene_runs(saved: Path, tmp_path: Path) -> None:
    """From the command on: no particle is beyond a wall, and the fastest are carried a box long."""
    out = tmp_path / "my.toml"
    assert status_of("new", str(saved), "--out", str(out)) == 0
    scene = load_scene(out, {"particles.number": 50, "times": [0.5]})
    result = ec.simulate(scene, "microscopic", flow=saved)
    assert result.attributes["status"] == "completed"
    x = result.variables["x"][-1]
    start = np.asarray(scene.start.x).mean()
    assert 0.2 < x.mean() - start < 0.55
