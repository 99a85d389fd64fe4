"""A sweep on a cluster whose workers a batch queue starts: dask-jobqueue.

pip install 'ellipsoid_coupling[cluster]' dask-jobqueue

Run it on the login node, or in a small job of its own. It may be stopped and started again: with the same
--out it goes on with what is missing.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import run_in_words
from ellipsoid_coupling.output.progress import ProgressReporter

# One process a core: runs of some seconds gain nothing from threads.
RESOURCES = {"cores": 16, "processes": 16, "memory": "32GB", "walltime": "02:00:00"}


def queue_cluster(jobs: int, queue: str | None) -> Any:
    """A cluster of so many jobs of SLURM's; other queues have classes of their own."""
    from dask_jobqueue import SLURMCluster

    cluster = SLURMCluster(queue=queue, **RESOURCES)
    cluster.scale(jobs=jobs)
    return cluster


def run(address: str, out: Path, *, quick: bool) -> None:
    """The noise of the cavity against its particles, 100 seeds each; `quick` for a try."""
    settings: dict[str, object] = {"particles.realisations": 1}
    if quick:
        settings |= {"times": [0.1], "interaction": None}
    scene = ec.load_scene("stationary" if quick else "cavity", settings)
    values = {"particles.number": [10, 20] if quick else [250, 500, 1000]}
    with ProgressReporter("sweep") as report:
        data = ec.sweep(
            scene,
            values,
            models=["microscopic"],
            seeds=range(2 if quick else 100),
            out=out,
            resume=(out / "sweep.toml").exists(),
            scheduler=address,
            report=report,
        )
    print(data["rms_speed"].mean("seed").isel(model=0).to_pandas().to_string())


def main(words: Sequence[str] | None = None) -> None:
    """Run on the cluster of --scheduler, or on one that is started here."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/sweep-cavity"))
    parser.add_argument("--jobs", type=int, default=8)
    parser.add_argument("--queue")
    parser.add_argument("--scheduler", help="of a cluster that is there already")
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args(words)
    if given.scheduler:
        run(given.scheduler, given.out, quick=given.quick)
        return
    with queue_cluster(given.jobs, given.queue) as cluster:
        run(cluster.scheduler_address, given.out, quick=given.quick)


if __name__ == "__main__":
    run_in_words(main)
