"""The flow of an earlier run: the one that lies in its folder, and no other.

What a run was given it keeps. `figures`, `export`, `compare RUN`, `run RUN/run.toml` and `--resume`
take the flow from here; its digest in run.toml tells whether it is still the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.reading import exists, is_folder
from ellipsoid_coupling.flow import FlowField, closed_form_flow, find_flow, flow_at
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, load_run_part, load_scene
from ellipsoid_coupling.scenes.scene import Domain, Flow
from ellipsoid_coupling.storage.run_folder import FLOW_FILE, RUN_FILE

# What stands for a digest where there is no flow, or nobody wrote it down.
_NONE = "none"


def load_runs(
    runs: Sequence[str | Path], given: Path | None = None
) -> tuple[list[Result], list[FlowField | None]]:
    """Finished runs and, in the same order, the flow that each of them used.

    given : where else that flow lies, for folders of an older version

    Raises
    ------
    InputError
        As `Result.load` and `run_flow`.
    """
    results = [Result.load(path) for path in runs]
    told = [str(result.attributes.get("flow_digest", _NONE)) for result in results]
    other = None if given is None else flow_at(given, allow_misfit=True)
    flows = [
        run_flow(Path(path), result.scene, digest, other)
        for path, result, digest in zip(runs, results, told, strict=True)
    ]
    return results, flows


def repeated_flow(name: str, scene: Scene) -> FlowField | None:
    """The flow of the run that is repeated from its run.toml, where `scene` still names that flow.

    Parameters
    ----------
    name : str
        What the user named: a run.toml, or any scene.
    scene : Scene
        What has become of it by other settings.

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

    A folder of an older version holds no flow: a formula serves, and a field that is shipped or in the
    cache, if it is the very one.

    Parameters
    ----------
    run : Path
        The run folder, or a file in it.
    scene : Scene
        The run's.
    digest : str
        The flow's, where it is known from elsewhere than run.toml (result.nc); else "none".
    other : FlowField, optional
        Taken instead of what lies in the folder; it must be the very one, too.

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
    told = {digest, _told_digest(folder)} - {_NONE}
    if other is not None or exists(file):
        field = FlowField.load(file) if other is None else other
        if told != {field.digest}:
            raise InputError(
                "--flow" if other is not None else str(file),
                f"the flow that the run used, digest {_either(told)}",
                f"one with digest {field.digest}", "Give the run's own.",
            )  # fmt: skip
        return field
    found = _flow_elsewhere(scene.flow, scene.domain, told)
    if found is None or not told <= {found.digest}:
        raise InputError(
            str(file), f"the flow that the run used, digest {_either(told)}", "none",
            f"Run it again with its flow: ellipsoid run {folder / RUN_FILE} --flow CASE.",
        )  # fmt: skip
    return found


def _flow_elsewhere(part: Flow, domain: Domain, told: set[str]) -> FlowField | None:
    """A flow for a folder that holds none: by its formula, or what is shipped or cached of `told`."""
    if part.source == "closed_form":
        return closed_form_flow(part, domain)
    found = (find_flow(part.field, part.cells, digest) for digest in sorted(told))
    return next((field for field in found if field is not None), None)


def _told_digest(folder: Path) -> str:
    """The flow's digest in run.toml; "none" where that is missing, or tells none."""
    file = folder / RUN_FILE
    return load_run_part(file).flow_digest if exists(file) else _NONE


def _either(told: set[str]) -> str:
    return " or ".join(sorted(told)) or "unknown"
