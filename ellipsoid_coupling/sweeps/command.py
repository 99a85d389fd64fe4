"""What ``ellipsoid sweep`` does, from plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.files.reading import is_ordinary
from ellipsoid_coupling.scenes import load_run_part, load_scene
from ellipsoid_coupling.sweeps.description import Sweep, checked_lists, is_sweep_file
from ellipsoid_coupling.sweeps.folder import SWEEP_FILE
from ellipsoid_coupling.sweeps.from_python import scene_table
from ellipsoid_coupling.sweeps.points import parsed, split_values

if TYPE_CHECKING:
    import xarray as xr

# Failed points that a message lists.
_LISTED = 20


def described(
    scene: str | None, lists: Mapping[str, object], settings: Sequence[str], out: Path | None
) -> Sweep:
    """The sweep of a command line.

    Parameters
    ----------
    scene : str or None
        A scene, a sweep.toml, or None for the sweep.toml in `out`.
    lists : dict
        Entries of `Lists`; those that the user has left out are None.
    settings : list of str
        ``key=a,b,c``; a key with one value is no list, but changes the scene of all points.

    Raises
    ------
    InputError
        Without a scene or a model; for lists that do not fit together.
    """
    given = {key: value for key, value in lists.items() if value is not None}
    if scene is None:
        if out is None or not is_ordinary(out / SWEEP_FILE):
            raise InputError("sweep", "a scene, or --out with a sweep", "none", "Name a scene.")
        scene = str(out / SWEEP_FILE)
    if is_sweep_file(scene):
        named = [*given, *settings]
        if named:
            found = ", ".join(named)
            raise InputError(scene, "a sweep as it stands", f"{found} with it", "Leave that out.")
        return Sweep.load(Path(scene))
    model = given.pop("models", load_run_part(scene).model)
    if model is None:
        raise InputError("sweep", "--model", "none", "Example: --model microscopic.")
    pairs = [split_values(text) for text in settings]
    swept = [(key, values) for key, values in pairs if len(values) > 1]
    table = given | {
        "models": [part.strip() for part in str(model).split(",")],
        "keys": [key for key, _ in swept],
        "values": [list(values) for _, values in swept],
    }
    fixed = {key: parsed(key, values[0]) for key, values in pairs if len(values) == 1}
    return Sweep(checked_lists(table, "sweep"), scene_table(load_scene(scene, fixed)))


def statuses_of(data: xr.Dataset) -> dict[str, str]:
    """How each point of a sweep has ended, by the folder of its run."""
    pairs: Any = zip(data["run"].values.ravel(), data["status"].values.ravel(), strict=True)
    return {str(name): str(status) for name, status in pairs}


def require_completed(statuses: Mapping[str, str]) -> None:
    """RunError that lists the points that were not completed, if there are any."""
    wrong = {name: text for name, text in statuses.items() if text != "completed"}
    if not wrong:
        return
    lines = [f"  {name}: {text}" for name, text in list(wrong.items())[:_LISTED]]
    lines += [f"  and {len(wrong) - _LISTED} more"] if len(wrong) > _LISTED else []
    raise RunError(
        f"{len(wrong)} of {len(statuses)} points have not come to their end:\n"
        + "\n".join([*lines, "Repeat them with --resume."])
    )
