"""Sections that come in kinds: read by name, written with it, and refused in one line."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.physics.angular import Axis, Sine
from ellipsoid_coupling.physics.outer import Harmonic
from ellipsoid_coupling.scenes import explain_terms, load_scene, scene_to_toml
from ellipsoid_coupling.scenes.kinds import Kinds
from ellipsoid_coupling.scenes.values import Positive


def test_files_without_a_kind_have_the_papers() -> None:
    scene = load_scene("stationary")
    assert isinstance(scene.outer_potential, Harmonic)
    assert isinstance(scene.angular_potential, Sine)


def test_a_kind_is_chosen_by_its_name_and_written_with_it(tmp_path: Path) -> None:
    axis = {"kind": "axis", "amplitude": 2, "direction": 0.5}
    scene = load_scene("stationary", {"angular_potential": axis})
    assert scene.angular_potential == Axis(2.0, 0.5)
    file = tmp_path / "scene.toml"
    file.write_text(scene_to_toml(scene))
    assert (
        '[angular_potential]\nkind = "axis"\namplitude = 2.0\ndirection = 0.5\n' in file.read_text()
    )
    again = load_scene(file)
    assert isinstance(again.angular_potential, Axis)
    assert again == scene
    (line,) = (term for term in explain_terms(scene) if term.name == "angular_potential")
    assert line.why == "V2 = -2 cos^2(theta - 0.5)"


def test_a_run_with_an_unknown_kind_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    """As where its registration is missing."""
    text = scene_to_toml(load_scene("stationary")).replace('"harmonic"', '"trap"')
    file = tmp_path / "scene.toml"
    file.write_text(text)
    with pytest.raises(
        InputError, match=r"outer_potential\.kind: expected .*'harmonic'.*, found 'trap'"
    ) as told:
        load_scene(file)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"angular_potential.stiffness": 1.0}, "one of kind, amplitude, found an unknown key"),
        (
            {"outer_potential.stiffness": float("nan")},
            "outer_potential.stiffness: expected a finite",
        ),
        (
            {"outer_potential.stiffness": "steep"},
            "outer_potential.stiffness: expected a valid number",
        ),
        (
            {"outer_potential.stiffness": None},
            "outer_potential.stiffness: expected a value, found none",
        ),
        ({"outer_potential.kind": 3}, "outer_potential.kind: expected 'harmonic'"),
        ({"outer_potential": 3.0}, "outer_potential: expected a valid dictionary"),
    ],
)
def test_mistakes_name_the_key(settings: dict[str, object], told: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene("stationary", settings)
    assert told in str(caught.value)


class Shelf(NamedTuple):
    """A record for kinds of this test's own."""

    height: Positive


def test_a_name_is_taken_once() -> None:
    kinds = Kinds("shelf", "plain", __name__)
    kinds.register("plain", Shelf, "{height:g} high")
    assert kinds.describe(Shelf(2.0)) == "2 high"
    with pytest.raises(ValueError, match=r"\[shelf\] has a kind plain"):
        kinds.register("plain", Shelf, "")
