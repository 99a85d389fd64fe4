"""Every key of scene files has a meaning, and every meaning a key."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from ellipsoid_coupling.scenes.meanings import MEANINGS
from ellipsoid_coupling.scenes.scene import Flow, Numerics, Particles

SCRIPTS = Path(__file__).parents[2] / "workflows" / "docs"

Keys = dict[str, tuple[str, str]]


@pytest.fixture(scope="module")
def keys() -> Keys:
    """(default, allowed values) by key, from a process in which no test has registered a kind."""
    script = "import json, scene_keys; print(json.dumps(list(scene_keys.scene_keys())))"
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=SCRIPTS, capture_output=True, text=True, check=True)
    listed = json.loads(done.stdout)
    assert len({name for name, _, _ in listed}) == len(listed)
    return {name: (default, allowed) for name, default, allowed in listed}


def test_the_meanings_are_those_of_the_keys(keys: Keys) -> None:
    """A new key needs a line in scenes/meanings.py."""
    assert set(keys) == set(MEANINGS)
    for text, _ in MEANINGS.values():
        assert text
        assert not text.endswith(".")


def test_the_walk_reaches_every_field(keys: Keys) -> None:
    """Counted another way: the fields of three sections, by name."""
    for section, part in (("particles", Particles), ("flow", Flow), ("numerics", Numerics)):
        assert {f"{section}.{name}" for name in part.model_fields} <= set(keys)


def test_defaults_and_ranges_are_those_of_the_code(keys: Keys) -> None:
    assert keys["numerics.cfl"] == ("0.9", "number, at least 1e-06, at most 1")
    assert keys["domain.boundary"] == ("required", '"open", "reflecting", "periodic"')
    assert keys["particles.length"] == ("required", "number, above 0")
    assert keys["start.points"][1] == "[[number, ...], ...]"
    assert keys["angular_potential.kind"] == ('"sine"', '"axis", "sine"')
    assert keys["walls.sides"][0] == "–"
