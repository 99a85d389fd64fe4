"""Every key of scene files has a meaning, and every meaning a key."""

from __future__ import annotations

import sys
from pathlib import Path

from ellipsoid_coupling.scenes.kinds import ANGULAR_POTENTIALS, OUTER_POTENTIALS
from ellipsoid_coupling.scenes.meanings import MEANINGS
from ellipsoid_coupling.scenes.scene import Flow, Numerics, Particles

sys.path.append(str(Path(__file__).parents[2] / "workflows" / "docs"))
import scene_keys


def own_keys() -> list[scene_keys.Key]:
    """All keys but those of kinds that other tests have registered in this process."""
    package = {"harmonic", "sine", "axis", "periodic", "reflect", "remove", "stick"}
    known = {*OUTER_POTENTIALS.known(), *ANGULAR_POTENTIALS.known()}
    return [
        key for key in scene_keys.scene_keys() if not {*key.name.split(".")} & (known - package)
    ]


def test_the_meanings_are_those_of_the_keys() -> None:
    keys = [key.name for key in own_keys()]
    assert len(keys) == len(set(keys))
    assert set(keys) == set(MEANINGS)
    for text, _ in MEANINGS.values():
        assert text
        assert not text.endswith(".")


def test_the_walk_reaches_every_field() -> None:
    """Counted another way: the fields of three sections, by name."""
    keys = {key.name for key in scene_keys.scene_keys()}
    for section, part in (("particles", Particles), ("flow", Flow), ("numerics", Numerics)):
        assert {f"{section}.{name}" for name in part.model_fields} <= keys


def test_defaults_and_ranges_are_those_of_the_code() -> None:
    keys = {key.name: key for key in scene_keys.scene_keys()}
    assert keys["numerics.cfl"].default == "0.9"
    assert keys["numerics.cfl"].allowed == "number, at least 1e-06, at most 1"
    assert keys["domain.boundary"].allowed == '"open", "reflecting", "periodic"'
    assert keys["particles.length"].default == "required"
    assert keys["start.points"].allowed == "[[number, ...], ...]"
    assert keys["angular_potential.kind"].default == '"sine"'
