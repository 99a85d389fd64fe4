"""The state that start.file names: the last one of an earlier run's result.nc, read without trust.

A run's folder keeps a copy of the file, from which the run is resumed and repeated.
"""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import numpy as np

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.reading import exists
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.models import Earlier
from ellipsoid_coupling.result import VARIABLES, Result
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.storage.run_folder import START_FILE, RunFolder


def keep_start(scene: Scene, folder: RunFolder) -> None:
    """Copy what a scene starts from into a claimed folder, unless it is there already."""
    kept, given = folder.path / START_FILE, scene.start.file
    if given is None:
        kept.unlink(missing_ok=True)
    elif not (folder.resume and exists(kept)) and not (exists(kept) and kept.samefile(given)):
        folder.require_ours()
        with whole_file(kept, new_folder=False) as beside:
            shutil.copyfile(given, beside)


def earlier_state(scene: Scene, folder: RunFolder | None = None) -> Earlier | None:
    """The last state of the result that a scene starts from; None for a scene without start.file.

    folder : of the run; one that is resumed has the file from there

    Raises
    ------
    InputError
        For a file that is no result, one without a saved time, or with particles that are not in the fluid.
    """
    if scene.start.file is None:
        return None
    path = Path(scene.start.file)
    if folder is not None and folder.resume and exists(folder.path / START_FILE):
        path = folder.path / START_FILE
    result = Result.load(path)
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
    number = 0.0
    if result.layout == "particles":
        number = result.attributes.get("particles_at_start", variables["x"].size)
    return Earlier(
        str(path), result.layout, variables, result.coordinates, float(number),
        digest.hexdigest()[:16],
    )  # fmt: skip
