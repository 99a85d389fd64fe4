"""Results with a right checksum and of the right shape, whose numbers no run can have."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.result import VARIABLES, Result
from tests.known_axes import even_axis
from tests.robustness.test_mutations import small_result


def small_grid() -> Result:
    """A rho result on 5 x 6 cells."""
    scene = small_result().scene
    shape = (len(scene.times), 5, 6)
    variables = {name: np.ones(shape) for name in VARIABLES["rho"]}
    axes = {name: even_axis(scene, name, size) for name, size in (("y", 5), ("x", 6))}
    told = {"status": "completed", "seed": 0}
    return Result(scene, "mine", "accurate", "rho", np.array(scene.times), variables, axes, told)


IMPOSSIBLE: dict[str, tuple[dict[str, Any], str]] = {
    "axis turned round": ({"x": lambda x: x[::-1]}, r"x: expected the centres of 6 equal cells"),
    "axis too long": ({"y": lambda y: 1e300 + y}, r"y: expected the centres of 5 equal cells"),
    "axis of one number": ({"y": lambda y: 0.0 * y}, r"y: expected the centres of 5 equal cells"),
    "negative density": ({"density": lambda d: -d}, r"density\[0, 0, 0\]: expected a density that"),
    "huge density": ({"density": lambda d: 1e300 * d}, r"density\[0, 0, 0\]: .*at most .*1e\+300"),
    "huge velocity": ({"velocity_x": lambda v: -1e200 * v}, r"velocity_x\[0, 0, 0\]: .*1e\+100"),
    "model 3": ({"model": 3}, r"attribute model: expected text .*found 3"),
    "scheme 0.5": ({"scheme": 0.5}, r"attribute scheme: expected text .*found .*0\.5"),
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_results_of_impossible_contents_are_refused(name: str, tmp_path: Path) -> None:
    """Whole files with a right checksum, of a model that nobody knows; the sound one is read."""
    path, (changes, told) = tmp_path / "result.nc", IMPOSSIBLE[name]
    sound = small_grid()
    sound.save(path)
    assert Result.load(path).model == "mine"
    for key, change in changes.items():
        if key in ("model", "scheme"):
            sound = dataclasses.replace(sound, **{key: change})
        else:
            arrays = sound.variables if key in sound.variables else sound.coordinates
            arrays[key] = change(arrays[key])
    sound.save(path)
    with pytest.raises(InputError, match=told):
        Result.load(path)
