"""The same run gives the same bits: any number of threads, kernels compiled, loaded or shared."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

# Grids too small to be shared among threads are shared all the same.
PROGRAM = """
import contextlib, hashlib, sys
import numba
from ellipsoid_coupling.finite_volume import boundary, diagnostics
from ellipsoid_coupling.models import r_grid
from tests.small_runs import MODELS, small_runs
for module in (boundary, diagnostics, r_grid):
    assert module.threads_for
    module.threads_for = lambda work, least: contextlib.nullcontext()
for threads in map(int, sys.argv[1].split(",")):
    numba.set_num_threads(threads)
    for run, result in small_runs(MODELS, whole="whole" in sys.argv):
        digest = hashlib.sha256()
        for name in sorted(result.variables):
            digest.update(result.variables[name].tobytes())
        print(threads, run, digest.hexdigest())
"""
FEW, WHOLE = 13, 32


def begin(*words: str, cache: Path | None = None) -> subprocess.Popen[str]:
    """A process of its own that may use four threads and does small runs with those given."""
    environment = os.environ | {"NUMBA_NUM_THREADS": "4"}
    if cache is not None:
        environment["ELLIPSOID_CACHE"] = str(cache)
    command = [sys.executable, "-c", PROGRAM, *words]
    top = Path(__file__).parents[1]
    return subprocess.Popen(command, cwd=top, env=environment, stdout=subprocess.PIPE, text=True)


def digests(process: subprocess.Popen[str]) -> dict[str, str]:
    """What a process told: thread count, model, scheme and scene -> digest."""
    told, _ = process.communicate(timeout=3600.0)
    assert process.returncode == 0
    return dict(line.rsplit(" ", 1) for line in told.splitlines())


def require_same_bits(found: dict[str, str], count: int) -> None:
    """Of one, two and four threads, for so many runs."""
    runs = {key.split(" ", 1)[1] for key in found}
    assert len(runs) == count
    for run in runs:
        assert len({found[f"{threads} {run}"] for threads in (1, 2, 4)}) == 1, run


def test_any_number_of_threads_gives_the_same_bits() -> None:
    """Every model and scheme, in an order that leaves traces if anything does.

    Must catch a sum whose order depends on the threads, in particles, samples and grids, with noise and
    with walls. The heavy twin below has each model and scheme with all of these.
    """
    require_same_bits(digests(begin("4,1,2")), FEW)


@pytest.mark.heavy
def test_any_number_of_threads_gives_the_same_bits_everywhere() -> None:
    """Every model and scheme in the trap, in the fluid and between walls."""
    require_same_bits(digests(begin("4,1,2", "whole")), WHOLE)


@pytest.mark.heavy
def test_compiled_loaded_and_shared_kernels_give_the_same_bits(tmp_path: Path) -> None:
    """Two processes fill an empty cache at once; a third finds it full; the own cache is a fourth."""
    first, second = (begin("2", "whole", cache=tmp_path) for _ in range(2))
    found = [digests(first), digests(second), digests(begin("2", "whole", cache=tmp_path))]
    found.append(digests(begin("2", "whole")))
    assert len(found[0]) == WHOLE
    assert all(other == found[0] for other in found[1:])
