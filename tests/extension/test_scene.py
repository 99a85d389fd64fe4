"""How to add a scene: a TOML file, or a table of the same sections. Three steps:

* the table, whose sections are those of scene files; what it does not name is not computed;
* `load_scene`, which checks it and changes single keys;
* `simulate`, or the command line with the file's name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.scenes import scene_to_toml

# Heavy particles settle into a shear flow u = (y, 0).
SCENE: dict[str, Any] = {
    "name": "settling",
    "title": "Particles at rest in a shear flow",
    "times": [0.5, 2.0],
    "domain": {"x": [-2.0, 2.0], "y": [0.0, 1.0], "boundary": "open"},
    "particles": {"length": 0.1, "width": 0.1, "number": 50, "realisations": 2},
    "start": {"x": [-0.5, 0.5], "y": [0.25, 0.75]},
    "flow": {"source": "closed_form", "field": "shear", "drag": 3.0, "angular_drag": 0.0},
    "numerics": {"cell": 0.05, "tolerance": 1e-6},
}


def displacement(drag: float, t: float) -> float:
    """Of x over y: v' = gamma (y - v) from rest, so x - x0 = y (t - (1 - e^{-gamma t})/gamma)."""
    return t - (1.0 - float(np.exp(-drag * t))) / drag


@pytest.mark.parametrize("drag", [3.0, 5.0])
def test_a_table_is_a_scene(drag: float) -> None:
    """Everywhere in the cloud; 1e-5 at a tolerance of 1e-6 of a particle's length a step."""
    scene = ec.load_scene(SCENE, {"flow.drag": drag, "start.x": [0.0, 1e-6]})
    result = ec.simulate(scene, model="microscopic")
    for k, t in enumerate(scene.times):
        x, y = result.variables["x"][k], result.variables["y"][k]
        np.testing.assert_allclose(x, y * displacement(drag, t), atol=1e-5)


def test_the_table_stays_as_it_was() -> None:
    ec.load_scene(SCENE, {"flow.drag": 5.0, "numerics.cell": 0.1})
    assert SCENE["flow"]["drag"] == 3.0
    assert SCENE["numerics"]["cell"] == 0.05


def test_a_file_is_the_same_scene(tmp_path: Path) -> None:
    scene = ec.load_scene(SCENE)
    file = tmp_path / "settling.toml"
    file.write_text(scene_to_toml(scene))
    assert ec.load_scene(file) == scene


def test_a_mistake_names_scene_and_key() -> None:
    with pytest.raises(
        ec.InputError, match=r"scene settling, key particles\.lenght: expected one of"
    ):
        ec.load_scene(SCENE, {"particles.lenght": 1.0})
    with pytest.raises(ec.InputError, match="scene without a name, key name: expected a value"):
        ec.load_scene({key: value for key, value in SCENE.items() if key != "name"})
