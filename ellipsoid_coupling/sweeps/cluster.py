"""Points on a Dask cluster; the only place that imports Dask (extra `cluster`).

    dask scheduler                                   on one machine
    dask worker ADDRESS --nthreads 1 --nworkers N    on each of the others

All of them see the sweep's folder under the same path. Dask gives the points of a worker that is lost to
another one; a client that goes away is followed by another one with --resume.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numba

from ellipsoid_coupling.errors import EllipsoidError, InputError, RunError
from ellipsoid_coupling.files.reading import exists
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.sweeps.folder import SWEEP_FILE, flow_file, flow_key
from ellipsoid_coupling.sweeps.job import Job, load_flow
from ellipsoid_coupling.sweeps.points import Point
from ellipsoid_coupling.sweeps.records import Record, failed

# Seconds to find the scheduler.
_PATIENCE = 10


def require_dask() -> Any:
    """The library distributed; InputError, with the remedy, where the extra `cluster` is missing."""
    try:
        import distributed
    except ImportError:
        raise InputError(
            "--scheduler", "the package distributed", "it is not installed",
            "Install it: pip install 'ellipsoid_coupling[cluster]'; or use --workers.",
        ) from None  # fmt: skip
    return distributed


def run_on_cluster(job: Job, points: Sequence[Point], address: str) -> Iterator[tuple[int, Record]]:
    """Run the points on the cluster of a scheduler; yields number and record as they end.

    Raises
    ------
    InputError
        Without the extra, or where no scheduler answers.
    RunError
        If the scheduler goes away.
    """
    distributed = require_dask()
    with _connected(distributed, address) as client:
        handed = _hand_out(client, job, points)
        for future in distributed.as_completed(handed, loop=client.loop):
            yield handed[future], _record(future)
            # The scheduler forgets it, and its memory.
            handed.pop(future)
            future.release()


def _connected(distributed: Any, address: str) -> Any:
    try:
        return distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        found = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(
            f"--scheduler {address}", "a Dask scheduler, as in tcp://host:8786", found,
            "Start one with: dask scheduler.",
        ) from None  # fmt: skip


def _hand_out(client: Any, job: Job, points: Sequence[Point]) -> dict[Any, int]:
    """Give all points to the scheduler; each flow goes to the workers once."""
    # The workers' own folders are others.
    shared = client.scatter(replace(job, path=job.path.absolute()), hash=False, broadcast=True)
    flows: dict[str, Any] = {}
    handed = {}
    for point in points:
        key = flow_key(job.sweep.scene_of(point))
        if key is not None and key not in flows:
            field = load_flow(flow_file(job.path, key))
            flows[key] = client.scatter(field, hash=False, broadcast=True)
        flow = None if key is None else flows[key]
        future = client.submit(_run, shared, point, flow, pure=False, key=f"point-{point.name}")
        handed[future] = point.number
    return handed


def _record(future: Any) -> Record:
    """What a point has become; a worker that was lost too often has killed it."""
    if future.status == "cancelled":
        raise RunError("the scheduler has gone. Continue with --resume.")
    error = future.exception()
    if isinstance(error, EllipsoidError):
        return failed(str(error))
    if error is not None:
        return failed(f"{type(error).__name__}: {error}")
    record: Record = future.result()
    return record


def _run(job: Job, point: Point, flow: FlowField | None) -> Record:
    """One point, on a worker; a point has one thread unless the worker was told otherwise."""
    if not exists(job.path / SWEEP_FILE):
        raise InputError(
            str(job.path), "the sweep's folder, seen by every worker under this path", "none",
            "Choose an --out on a file system that all machines share.",
        )  # fmt: skip
    if "NUMBA_NUM_THREADS" not in os.environ:
        numba.set_num_threads(1)
    return job.run(point, lambda _part: None, flow)
