"""`sweep`: many runs from Python, by lists of values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import ADAPTIVE_SCHEME, scheme_named
from ellipsoid_coupling.scenes import Scene, load_scene
from ellipsoid_coupling.storage.run_folder import numbered_folder
from ellipsoid_coupling.sweeps.description import Sweep, checked_lists
from ellipsoid_coupling.sweeps.points import value_text
from ellipsoid_coupling.sweeps.running import Report, Where, run_sweep

if TYPE_CHECKING:
    import xarray as xr


class Further(TypedDict, total=False):
    """The rarer arguments of `sweep`.

    scheme : "paper" or "accurate"
    zipped : take the lists of values in pairs; else their product is run
    realisations : (first, end, how many a point), which splits the realisations of one large run
    flow : FlowField or path, replaces the scene's own
    scheduler : address of a Dask scheduler, instead of `workers`
    report : called with the stage and its finished part
    """

    scheme: str
    zipped: bool
    realisations: tuple[int, int, int]
    flow: FlowField | str | Path
    scheduler: str
    report: Report


def sweep(
    scene: Scene | str | Path | Mapping[str, Any],
    values: Mapping[str, Iterable[object]] | None = None,
    *,
    models: str | Sequence[str],
    seeds: Iterable[int] | None = None,
    workers: int | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    **further: Unpack[Further],
) -> xr.Dataset:
    """Run a scene at all combinations of values, models and seeds, on all cores or on a cluster.

    ec.sweep("cavity", {"noise.noise": [0, 0.5, 1]}, models=["microscopic"], seeds=range(8))

    In a script, what calls this stands below ``if __name__ == "__main__":``, unless `workers` is 1.

    Parameters
    ----------
    scene : Scene, name, path or table
    values : mapping
        Lists of values by dotted key of the scene; None takes a part out.
    models : str or list of str
    seeds : list of int, optional
        Without, all runs have seed 0.
    workers : int, optional
        Processes of this machine, each with its part of the cores; 1 is this process. Without, as many as
        there are cores and the memory has room for.
    out : path, optional
        The sweep's folder; without, a new one in results/.
    resume : bool
        Go on with the sweep in `out`.
    **further
        See `Further`.

    Returns
    -------
    xarray.Dataset
        Over model, the keys, seed: density (time, y, x), angle_distribution (time, angle), series, errors
        against the model highest in the hierarchy, counts, `status` of each point.

    Raises
    ------
    InputError
        For values that do not fit, before anything is run.
    Interrupted
        After a signal; to be resumed.
    """
    flow = further.get("flow")
    lists = checked_lists(
        {
            "models": [models] if isinstance(models, str) else list(models),
            "scheme": scheme_named(further.get("scheme", ADAPTIVE_SCHEME)).name,
            "keys": list(values or {}),
            "values": [[value_text(one) for one in many] for many in (values or {}).values()],
            "zipped": further.get("zipped", False),
            "seeds": None if seeds is None else [int(seed) for seed in seeds],
            "realisations": further.get("realisations"),
            "flow": None
            if flow is None or isinstance(flow, FlowField)
            else str(Path(flow).absolute()),
        },
        "sweep",
    )
    described = Sweep(lists, scene_table(scene))
    where = Where(workers, further.get("scheduler"))
    given = flow if isinstance(flow, FlowField) else None
    report = further.get("report")
    if out is not None:
        return run_sweep(described, Path(out), where, resume=resume, flow=given, report=report)
    if resume:
        raise InputError("sweep", "out, the folder to resume", "none", "Give out.")
    with numbered_folder(Path("results") / f"sweep-{described.name}") as folder:
        return run_sweep(described, folder, where, flow=given, report=report)


def scene_table(scene: Scene | str | Path | Mapping[str, Any]) -> dict[str, Any]:
    """What a scene's file says, without what follows from it; settings are then as if set there."""
    loaded = scene if isinstance(scene, Scene) else load_scene(scene)
    table: dict[str, Any] = loaded.model_dump(mode="json", exclude_unset=True, exclude_none=True)
    return table
