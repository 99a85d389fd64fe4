"""The state that start.file names: the last one of an earlier run's result.nc, read without trust."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.models import Earlier
from ellipsoid_coupling.result import VARIABLES, Result
from ellipsoid_coupling.scenes import Scene


def earlier_state(scene: Scene) -> Earlier | None:
    """The last state of the result that a scene starts from; None for a scene without start.file.

    Raises
    ------
    InputError
        For a file that is no result, one without a saved time, or with particles that are not in the fluid.
    """
    if scene.start.file is None:
        return None
    result = Result.load(Path(scene.start.file))
    where = f"scene {scene.name}, key start.file"
    if result.times.size == 0:
        found = "a run that failed before its first one"
        raise InputError(where, "a result with a saved time", found, "Give another result.")
    gone = result.frozen
    if gone is not None and gone[-1].any():
        raise InputError(
            where, "particles that are all in the fluid at the last of its times",
            f"{np.count_nonzero(gone[-1])} of {gone[-1].size} that have left, ended or not come in",
            "Let that run end earlier, or start on a grid from one on a grid.",
        )  # fmt: skip
    variables = {name: result.variables[name][-1] for name in VARIABLES[result.layout]}
    digest = hashlib.sha256()
    for name, values in sorted((variables | result.coordinates).items()):
        digest.update(name.encode() + np.ascontiguousarray(values).tobytes())
    number = result.attributes.get("particles_at_start", variables["x"].size) if result.layout == "particles" else 0.0
    return Earlier(
        scene.start.file, result.layout, variables, result.coordinates, float(number),
        digest.hexdigest()[:16],
    )  # fmt: skip
