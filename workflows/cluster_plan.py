"""What a very large job needs on a cluster: memory, traffic and time, from figures that were measured here.

    .venv/bin/python workflows/cluster_plan.py [--cores 1000]

Two jobs: realisations of the microscopic cavity, which are independent, and samples of its mean-field
limit, which are one density. The formulas stand in `ensemble`, `samples` and `densities`, the figures in
`MEASURED`.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from typing import NamedTuple

from ellipsoid_coupling import load_scene
from ellipsoid_coupling.files.limits import in_words, time_in_words
from ellipsoid_coupling.models import Setup, kind_named, model_terms
from ellipsoid_coupling.models.memory import peak_memory
from ellipsoid_coupling.scenes import Scene

# Variables of particles in a result, float64 each, at every save time.
SAVED = 6
NUMBER = 8
ENSEMBLE, DENSITY = "microscopic", "mckean_vlasov"
CORES_OF_A_MACHINE = 64


class Measured(NamedTuple):
    """Figures of one machine: two cores with AVX-512, 2026-11-28; how each was measured stands beside it.

    Attributes
    ----------
    realisation : float
        Core seconds of one realisation of the cavity, 1000 particles, scheme accurate, tolerance 1e-4.
    sample_step, node_step : float
        Core seconds of a step of the cavity's mean-field limit: of one sample, and of all nodes together.
    steps : float
        Steps of the samples at the cavity's own tolerance.
    startup : float
        Core seconds of a process before its first step, kernels in the cache.
    cold_cache : float
        Core seconds of the first process of all, which compiles.
    point : float
        Core seconds of a point of a sweep beyond its run (`workflows/benchmark_sweeps.py`).
    process : float
        Bytes that a process has before its run.
    """

    realisation: float
    sample_step: float
    node_step: float
    steps: float
    startup: float
    cold_cache: float
    point: float
    process: float


# Processor seconds of runs with 4 realisations, and with 32 and 128 x 1000 samples; start and first compile
# from the table of benchmarks, microscopic; memory of a process after a run of 4 realisations.
MEASURED = Measured(
    realisation=0.27, sample_step=3.2e-7, node_step=0.040, steps=300.0, startup=1.4, cold_cache=16.7,
    point=0.011, process=2.4e8,
)  # fmt: skip


class Job(NamedTuple):
    """What a job needs.

    Attributes
    ----------
    what : str
    core_hours, hours : float
        Of computing, and by the clock on all cores that it can use.
    cores : int
        That it can use.
    process_bytes : float
        Memory of a process.
    result_bytes, files : float
        What is written.
    join_bytes : float
        Memory of the process that puts results together.
    first : str
        What breaks first.
    """

    what: str
    core_hours: float
    hours: float
    cores: int
    process_bytes: float
    result_bytes: float
    files: float
    join_bytes: float
    first: str


def ensemble(scene: Scene, realisations: int, cores: int, figures: Measured = MEASURED) -> Job:
    """Independent realisations, split into points of equal size, as many as there are cores.

    seconds on a core = startup + point + size realisation
    bytes = 6 x 8 x N x R x times, and as many again for the whole
    """
    size = math.ceil(realisations / cores)
    points = math.ceil(realisations / size)
    begun = figures.startup + figures.point
    result = saved_bytes(scene, realisations)
    return Job(
        what=f"{realisations:.0e} realisations of {scene.particles.number} particles",
        core_hours=(points * begun + realisations * figures.realisation) / 3600.0,
        hours=(figures.cold_cache + begun + size * figures.realisation) / 3600.0,
        cores=points,
        process_bytes=figures.process + peak(scene, ENSEMBLE, size),
        result_bytes=2.0 * result,
        files=5.0 * points + 3.0,
        join_bytes=figures.process + 2.0 * result,
        first="the one process that puts the pieces together, which holds all of them twice",
    )


def samples(scene: Scene, count: float, cores: int, figures: Measured = MEASURED) -> Job:
    """Samples of one density: all of them in one process, on the cores of one machine.

    seconds = steps (node_step + count sample_step) / cores of a machine
    """
    realisations = math.ceil(count / scene.particles.number)
    seconds = figures.steps * (figures.node_step + count * figures.sample_step)
    here = min(cores, CORES_OF_A_MACHINE)
    memory = figures.process + peak(scene, DENSITY, realisations)
    return Job(
        what=f"{count:.0e} samples of one density",
        core_hours=seconds / 3600.0,
        hours=(seconds / here + figures.startup) / 3600.0,
        cores=here,
        process_bytes=memory,
        result_bytes=saved_bytes(scene, realisations),
        files=4.0,
        join_bytes=0.0,
        first="the memory of one machine: a density is not shared among machines",
    )


def densities(
    scene: Scene, count: float, each: int, cores: int, figures: Measured = MEASURED
) -> Job:
    """The same samples as many densities of `each`, a seed and a core each.

    seconds on a core = startup + point + steps (node_step + each sample_step), for each of its points
    """
    points = math.ceil(count / each)
    realisations = math.ceil(each / scene.particles.number)
    step = figures.node_step + each * figures.sample_step
    seconds = figures.startup + figures.point + figures.steps * step
    rounds = math.ceil(points / cores)
    return Job(
        what=f"{points} densities of {each:.0e} samples",
        core_hours=points * seconds / 3600.0,
        hours=(rounds * seconds + figures.cold_cache) / 3600.0,
        cores=min(points, cores),
        process_bytes=figures.process + peak(scene, DENSITY, realisations),
        result_bytes=points * saved_bytes(scene, realisations),
        files=5.0 * points + 3.0,
        join_bytes=figures.process,
        first="the file system, which all write to as they end",
    )


def saved_bytes(scene: Scene, realisations: int) -> float:
    """Of result.nc, which is not compressed: 6 float64 a particle and save time."""
    return float(SAVED * NUMBER * len(scene.times)) * scene.particles.number * realisations


def peak(scene: Scene, model: str, realisations: int) -> float:
    """Bytes of a run on top of those of its process, as `ellipsoid run` estimates them."""
    setup = Setup(scene, model_terms(scene, model), "accurate", None, 0, realisations)
    return peak_memory(kind_named(model), setup)


COLUMNS = (
    "",
    *("core hours", "cores", "by the clock", "a process", "written", "joining", "breaks first"),
)


def rows(cores: int, figures: Measured = MEASURED) -> list[tuple[str, ...]]:
    """The two jobs of the page, and the second one in pieces, as texts under `COLUMNS`."""
    scene = load_scene("cavity")
    jobs = [
        ensemble(scene, 10_000, cores, figures),
        samples(scene, 1e9, cores, figures),
        densities(scene, 1e9, 1_000_000, cores, figures),
    ]
    return [
        (
            job.what,
            f"{job.core_hours:.3g}",
            f"{job.cores}",
            time_in_words(3600.0 * job.hours),
            in_words(job.process_bytes),
            in_words(job.result_bytes),
            in_words(job.join_bytes) if job.join_bytes else "-",
            job.first,
        )
        for job in jobs
    ]


def table(cores: int = 1000) -> str:
    """As a table of Markdown."""
    lines = [COLUMNS, ["---"] * len(COLUMNS), *rows(cores)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="what a very large job needs on a cluster")
    parser.add_argument("--cores", type=int, default=1000)
    sys.stdout.write(table(parser.parse_args(arguments).cores))


if __name__ == "__main__":
    main()
