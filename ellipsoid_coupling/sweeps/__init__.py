"""Many runs of one scene over lists of values: on one machine, on a Dask cluster, in batch queues."""

from ellipsoid_coupling.sweeps.command import described, require_completed, statuses_of
from ellipsoid_coupling.sweeps.description import Lists, Sweep
from ellipsoid_coupling.sweeps.from_python import scene_table, sweep
from ellipsoid_coupling.sweeps.running import Where, run_sweep, run_task

__all__ = [
    "Lists",
    "Sweep",
    "Where",
    "described",
    "require_completed",
    "run_sweep",
    "run_task",
    "scene_table",
    "statuses_of",
    "sweep",
]
