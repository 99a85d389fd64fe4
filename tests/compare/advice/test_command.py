"""The command of an answer, read back."""

from __future__ import annotations

import shlex
from typing import Any

import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare.advice.command import (
    Asked,
    asked_for,
    command_line,
    differences,
)
from ellipsoid_coupling.scenes import parse_setting

CHANGES: list[dict[str, Any]] = [
    {},
    {"numerics.cell": 1.0 / 3.0, "times": [0.1, 0.25]},
    {"interaction": None, "walls": None},
    {"noise.noise": 0.5, "noise.angular_noise": 0.0, "title": "it's another"},
]


@pytest.mark.parametrize("changes", CHANGES)
def test_a_built_in_scene_is_named_by_what_differs(changes: dict[str, Any]) -> None:
    """The scene and the settings give the very scene; sections that are gone are taken out."""
    scene = ec.load_scene("cavity", changes)
    asked = asked_for(scene)
    assert asked.scene == "cavity"
    assert ec.load_scene("cavity", dict(map(parse_setting, asked.settings))) == scene
    assert len(asked.settings) == len(changes)


def test_a_scene_of_another_name_is_its_file() -> None:
    assert asked_for(ec.load_scene("cavity", {"name": "mine"})).scene == "mine.toml"


def test_values_replace_the_users_own_settings() -> None:
    """Spaces in a path are kept, and a run.toml's realisations are told by their option."""
    settings = ("numerics.cell=0.1", "flow.drag=2", "particles.realisations = 8")
    asked = Asked("a b/run.toml", settings, ("--flow", "my case"), is_run=True)
    values = {"numerics.cell": 0.05, "particles.realisations": 4}
    line = command_line(asked, "microscopic", "paper", values, 4)
    assert shlex.split(line) == [
        "ellipsoid", "run", "a b/run.toml", "--model", "microscopic", "--scheme", "paper",
        "--realisations", "4", "--flow", "my case",
        "--set", "flow.drag=2", "numerics.cell=0.05", "particles.realisations=4",
    ]  # fmt: skip


def test_equal_scenes_do_not_differ() -> None:
    scene = ec.load_scene("cylinder")
    assert differences(scene, scene) == {}
