"""Scenes in Python: changed copies, numpy's numbers, their files, and how they are shown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.scenes import Scene, builtin_scenes, load_scene

NUMBERS = st.floats(1e-6, 1e6)


def test_a_changed_scene_is_a_new_one() -> None:
    scene = load_scene("cavity")
    changed = scene.with_({"numerics.cell": 0.01, "walls": None}, times=[1.0, 2.0])
    assert (changed.numerics.cell, changed.walls, changed.times) == (0.01, None, (1.0, 2.0))
    assert scene == load_scene("cavity")
    assert changed == load_scene(
        "cavity", {"numerics.cell": 0.01, "walls": None, "times": [1.0, 2.0]}
    )
    assert scene.with_(**{"numerics.cell": 0.01}) == scene.with_({"numerics.cell": 0.01})


@pytest.mark.parametrize("name", builtin_scenes())
def test_a_scene_without_changes_is_equal(name: str) -> None:
    scene = load_scene(name)
    assert scene.with_() == scene


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"numerics.cel": 0.1}, "an unknown key"),
        ({"numerics.cell": -1.0}, "greater than 0"),
        ({"interaction": None}, "walls"),
        ({"particles.number": np.float64(2.5)}, "particles.number"),
        ({"particles.number": np.bool_(True)}, "particles.number"),
        ({"times": np.array([[1.0]])}, "times"),
        ({"flow.drag": np.nan}, "flow.drag"),
    ],
)
def test_a_change_is_checked(changes: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        load_scene("cavity").with_(changes)


def test_numpys_numbers_and_paths_are_taken_everywhere(tmp_path: Path) -> None:
    """As TOML's own: a scene from them is equal to that from Python's numbers and texts."""
    plain: dict[str, Any] = {
        "particles.number": 3,
        "particles.length": 0.0625,
        "times": [0.5, 1.0],
        "domain.x": [0.0, 1.0],
        "start": {"points": [[0.25, 0.5], [0.5, 0.5], [0.75, 0.5]]},
        "flow": {"case": str(tmp_path), "drag": 1.0, "angular_drag": 1.0, "repeat": False},
        "interaction.strength": 2.0,
    }
    from_numpy = plain | {
        "particles.number": np.int32(3),
        "particles.length": np.float32(0.0625),
        "times": np.linspace(0.5, 1.0, 2),
        "domain.x": (np.float64(0.0), np.int8(1)),
        "start": {"points": np.array(plain["start"]["points"])},
        "flow": plain["flow"]
        | {"case": tmp_path, "drag": np.float64(1.0), "repeat": np.bool_(False)},
        "interaction.strength": np.array(2.0),
    }
    assert load_scene("cavity", from_numpy) == load_scene("cavity", plain)


def test_a_table_is_not_changed_by_settings() -> None:
    table = load_scene("rotation").model_dump(mode="json", exclude_none=True)
    before = repr(table)
    load_scene(table, {"numerics.cell": 0.5, "particles.number": 1})
    assert repr(table) == before


def between(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers that scenes take: none but 0 is below 1e-100."""
    return st.floats(low, high).map(lambda value: value if abs(value) > 1e-100 else 0.0)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Any scene with a square domain around 0, of every part that is a plain table."""
    half, count = draw(st.floats(0.5, 1e6)), draw(st.integers(1, 4))
    inside = between(-half, half)
    points = draw(
        st.lists(st.tuples(inside, inside, between(-1e3, 1e3)), min_size=count, max_size=count)
    )
    start: dict[str, Any] = {
        "x": [-half, half],
        "y": [-half / 2, half],
        "angle": draw(between(-9.0, 9.0)),
    }
    settings: dict[str, Any] = {
        "title": draw(st.text(st.characters(categories=["L", "N", "P", "S"]), max_size=20)),
        "units": draw(st.sampled_from([None, "SI"])),
        "times": sorted(draw(st.sets(st.floats(0.1, 100.0), min_size=1, max_size=4))),
        "domain": {"x": [-half, half], "y": [-half, half], "boundary": "reflecting"},
        "particles": {"length": draw(NUMBERS), "width": 1e-6, "number": count},
        "start": start if draw(st.booleans()) else {"points": points},
        "boundaries": draw(
            st.sampled_from([None, {"left": {"kind": "stick"}}, {"in(1)": {"kind": "remove"}}])
        ),
        "interaction": {"strength": draw(NUMBERS)} if draw(st.booleans()) else None,
        "outer_potential": {"kind": "harmonic", "stiffness": draw(NUMBERS)},
        "angular_potential": draw(
            st.sampled_from([None, {"kind": "axis", "amplitude": 0.1, "direction": 1.0}])
        ),
        "noise": {"noise": draw(NUMBERS), "angular_noise": 0.0},
        "numerics.cell": draw(NUMBERS),
        "numerics.tolerance": draw(st.floats(1e-14, 1.0)),
    }
    return load_scene("rotation", settings)


@settings(max_examples=150, derandomize=True, deadline=None, database=None)
@given(scene=scenes())
def test_every_scene_is_read_back_from_its_text(
    scene: Scene, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Numbers to the last bit, whatever parts there are."""
    file = tmp_path_factory.getbasetemp() / "any_scene.toml"
    file.write_text(scene.to_toml(), encoding="utf-8")
    assert load_scene(file) == scene
    assert scene.with_() == scene


def test_simulate_takes_names_and_paths(tmp_path: Path) -> None:
    """Of a scene, a flow and a folder, as text or Path: one result to the bit."""
    small = {"particles.number": 2, "particles.realisations": 1, "times": [0.1]}
    scene = load_scene("rotation", small)
    file = tmp_path / "small.toml"
    file.write_text(scene.to_toml())
    first = ec.simulate(scene, model="microscopic", folder=str(tmp_path / "run"))
    results = [
        ec.simulate(str(file), model="microscopic", seed=np.int64(0)),
        ec.simulate(file, "microscopic", flow=str(tmp_path / "run" / "flow.npz")),
        ec.simulate(scene.model_dump(exclude_none=True), "microscopic"),
        ec.Result.load(str(tmp_path / "run")),
    ]
    for result in results:
        assert all(np.array_equal(result.variables[k], v) for k, v in first.variables.items())


def test_a_scene_is_shown_in_one_line_and_as_a_table() -> None:
    """What stands in a title stays text, in a terminal and in a page."""
    scene = load_scene("cavity", {"flow": {"case": "<b>\x1b[1m", "drag": 1.0, "angular_drag": 1.0}})
    line, table = repr(scene), scene._repr_html_()
    assert line.isprintable()
    assert len(line) < 160
    assert line.startswith(
        "<Scene cavity: particles 1000 of 0.05 x 0.025, 128 realisations, times 2, 3.5, 5"
    )
    assert str(scene) == line
    assert "&lt;b&gt;\\x1b[1m" in table
    assert "<b>" not in table
    assert table.count("<tr>") >= 6
