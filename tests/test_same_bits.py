"""The same run gives the same bits: any number of threads, kernels compiled, loaded or shared."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

# Each model with both schemes: in a trap with noise and, where there may be, with fluid and walls.
PROGRAM = """
import hashlib, sys
import numba
import ellipsoid_coupling as ec
small = {"particles.number": 30, "particles.realisations": 3, "numerics.cell": 1.0, "times": [0.2],
         "numerics.angle_cells": 6}
walls = {"noise": None, "domain.boundary": "reflecting", "walls": {}, "flow": {
    "source": "closed_form", "field": "rotation", "drag": 1.0, "angular_drag": 1.0}}
for threads in map(int, sys.argv[1].split(",")):
    numba.set_num_threads(threads)
    for model in sys.argv[2].split(","):
        for scheme in ("paper", "accurate"):
            for parts in ({}, walls) if model != "q_maxwellian" else ({},):
                result = ec.simulate(ec.load_scene("stationary", small | parts), model, scheme, seed=1)
                digest = hashlib.sha256()
                for name in sorted(result.variables):
                    digest.update(result.variables[name].tobytes())
                print(threads, model, scheme, bool(parts), digest.hexdigest())
"""
MODELS = "microscopic,mckean_vlasov,q_maxwellian,q_mono_kinetic,rho_mono_kinetic,diffusive"


def begin(threads: str, models: str, cache: Path | None = None) -> subprocess.Popen[str]:
    """A process of its own that may use four threads."""
    environment = os.environ | {"NUMBA_NUM_THREADS": "4"}
    if cache is not None:
        environment["ELLIPSOID_CACHE"] = str(cache)
    command = [sys.executable, "-c", PROGRAM, threads, models]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)


def digests(process: subprocess.Popen[str]) -> dict[str, str]:
    """What a process told: thread count, model, scheme and scene -> digest."""
    told, _ = process.communicate(timeout=900.0)
    assert process.returncode == 0
    return dict(line.rsplit(" ", 1) for line in told.splitlines())


def test_any_number_of_threads_gives_the_same_bits() -> None:
    """One, two and four threads, in an order that leaves traces if anything does."""
    found = digests(begin("4,1,2", MODELS))
    runs = {key.split(" ", 1)[1] for key in found}
    assert len(runs) == 22
    for run in runs:
        assert len({found[f"{threads} {run}"] for threads in (1, 2, 4)}) == 1, run


@pytest.mark.heavy
def test_compiled_loaded_and_shared_kernels_give_the_same_bits(tmp_path: Path) -> None:
    """Two processes fill an empty cache at once; a third finds it full; the own cache is a fourth."""
    first, second = (begin("2", MODELS, tmp_path) for _ in range(2))
    found = [digests(first), digests(second), digests(begin("2", MODELS, tmp_path))]
    found.append(digests(begin("2", MODELS)))
    assert len(found[0]) == 22
    assert all(other == found[0] for other in found[1:])
