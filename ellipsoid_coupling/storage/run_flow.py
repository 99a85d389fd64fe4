"""The flow of an earlier run: the one in its folder, and no other.

A run folder keeps the flow that the run used. `figures`, `export`, `compare RUN`, `run RUN/run.toml` and
`--resume` take the flow from there; its digest in run.toml must agree.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.reading import exists, is_folder
from ellipsoid_coupling.flow import FlowField, closed_form_flow, find_flow, flow_at, load_flow
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, load_run_part, load_scene
from ellipsoid_coupling.scenes.scene import Domain, Flow
from ellipsoid_coupling.storage.run_folder import FLOW_FILE, RESULT_FILE, RUN_FILE

# The digest of a run without a flow, and of a folder without a digest.
_NONE = "none"


def load_runs(
    runs: Sequence[str | Path], given: Path | None = None
) -> tuple[list[Result], list[FlowField | None]]:
    """Finished runs and, in the same order, the flow that each of them used.

    given : another path of that flow, for folders of an older version

    Raises
    ------
    InputError
        As `Result.load` and `run_flow`.
    """
    for path in runs:
        _require_result(Path(path))
    results = [Result.load(path) for path in runs]
    digests = [str(result.attributes.get("flow_digest", _NONE)) for result in results]
    other = None if given is None else flow_at(given, allow_misfit=True)
    flows = [
        run_flow(Path(path), result.scene, digest, other)
        for path, result, digest in zip(runs, results, digests, strict=True)
    ]
    return results, flows


def _require_result(path: Path) -> None:
    """Refuse a path without a result; what is there instead, its files tell."""
    if exists(path / RESULT_FILE if is_folder(path) else path):
        return
    found, remedy = "none", "Check the path."
    if is_folder(path):
        found, remedy = "a folder without one", "Name the folder that a run has printed last."
    if exists(path / RUN_FILE):
        named = shlex.quote(str(path)), shlex.quote(str(path / RUN_FILE))
        found = "a run that has not ended: it was killed, or is running"
        remedy = f"`ellipsoid run {named[1]} --resume --out {named[0]}` continues it."
    elif exists(path / "errors.csv"):
        found, remedy = "the folder of a comparison", "Only `ellipsoid report` takes one."
    elif exists(path / "sweep.toml"):
        found, remedy = "the folder of a sweep", "Name the folders of its points."
    raise InputError(str(path), "a finished run: its folder, or its result.nc", found, remedy)


def repeated_flow(name: str, scene: Scene) -> FlowField | None:
    """The flow of the run that is repeated from its run.toml, where `scene` still names that flow.

    Parameters
    ----------
    name : str
        The user's argument: a run.toml, or any scene.
    scene : Scene
        That scene with the user's other settings.

    Returns
    -------
    None where the scene's own flow is to be taken.

    Raises
    ------
    InputError
        As `run_flow`.
    """
    digest = load_run_part(name).flow_digest
    before = load_scene(name).flow if digest != _NONE else None
    if before is None or scene.flow is None or before.named != scene.flow.named:
        return None
    return run_flow(Path(name), scene, digest)


def run_flow(
    run: Path, scene: Scene, digest: str = _NONE, other: FlowField | None = None
) -> FlowField | None:
    """The flow that an earlier run used, from its folder; nothing is solved for it.

    A folder of an older version holds no flow. Then the flow's formula is taken, or a field with the same
    digest that is shipped or in the cache.

    Parameters
    ----------
    run : Path
        The run folder, or a file in it.
    scene : Scene
        The run's.
    digest : str
        The flow's, where it is known from elsewhere than run.toml (result.nc); else "none".
    other : FlowField or FlowSeries, optional
        Taken instead of the one in the folder; it must have the same digest.

    Returns
    -------
    None for a scene without a fluid.

    Raises
    ------
    InputError
        If there is none, or another one than the run used.
    """
    if scene.flow is None:
        return None
    folder = run if is_folder(run) else run.parent
    file = folder / FLOW_FILE
    digests = {digest, _digest_in(folder)} - {_NONE}
    if other is not None or exists(file):
        field = load_flow(file) if other is None else other
        if digests != {field.digest}:
            raise InputError(
                "--flow" if other is not None else str(file),
                f"the flow that the run used, digest {_either(digests)}",
                f"one with digest {field.digest}", "Give the run's own.",
            )  # fmt: skip
        return field
    elsewhere = _flow_elsewhere(scene.flow, scene.domain, digests)
    if elsewhere is None or not digests <= {elsewhere.digest}:
        raise InputError(
            str(file), f"the flow that the run used, digest {_either(digests)}", "none",
            f"Run it again with its flow: ellipsoid run {folder / RUN_FILE} --flow CASE.",
        )  # fmt: skip
    return elsewhere


def _flow_elsewhere(part: Flow, domain: Domain, digests: set[str]) -> FlowField | None:
    """A flow for a folder without one: its formula, or a shipped or cached field with such a digest."""
    if part.source == "closed_form":
        return closed_form_flow(part, domain)
    fields = (find_flow(part.name, part.cells, digest) for digest in sorted(digests))
    return next((field for field in fields if field is not None), None)


def _digest_in(folder: Path) -> str:
    """The flow's digest in run.toml; "none" if either is missing."""
    file = folder / RUN_FILE
    return load_run_part(file).flow_digest if exists(file) else _NONE


def _either(digests: set[str]) -> str:
    return " or ".join(sorted(digests)) or "unknown"
