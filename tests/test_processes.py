"""Runs in other processes and threads of a program that has run something itself before.

Bounded by nothing but the tests' own end: what fails here has always hung.
"""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import threading
from pathlib import Path

import pytest

from ellipsoid_coupling.compiled import threading_layer
from ellipsoid_coupling.compiled.threading_layer import taking_turns

# What a worker does: a run that shares realisations among Python's threads, and a loop of numba's.
WORK = """
    import hashlib, multiprocessing, sys
    from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
    import numba
    import numpy as np
    import ellipsoid_coupling as ec
    from ellipsoid_coupling.compiled.jit import parallel_kernel
    from ellipsoid_coupling.compiled.threading_layer import taking_turns

    @parallel_kernel
    def total(values: np.ndarray) -> float:
        found = 0.0
        for k in numba.prange(values.size):
            found += values[k]
        return found

    def work(seed: int) -> tuple[str, float]:
        settings = {"particles.number": 10, "interaction": None, "times": [0.1]}
        scene = ec.load_scene("rotation", settings)
        result = ec.simulate(scene, "microscopic", seed=seed, realisations=4)
        places = np.ascontiguousarray(result.variables["x"]).tobytes()
        with taking_turns():  # as `simulate` does for the loops in it
            return hashlib.sha256(places).hexdigest(), total(np.arange(1000.0))

    if __name__ == "__main__":
        alone = [work(seed) for seed in range(3)]
        how = sys.argv[1]
        if how == "threads":
            pool = ThreadPoolExecutor(2)
        else:
            pool = ProcessPoolExecutor(2, multiprocessing.get_context(how))
        with pool:
            assert list(pool.map(work, range(3))) == alone
        assert [work(seed) for seed in range(3)] == alone
        print(numba.threading_layer(), "as alone")
"""


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("processes") / "work.py"
    path.write_text(textwrap.dedent(WORK))
    return path


@pytest.mark.parametrize("layer", ["omp", "workqueue"])
@pytest.mark.parametrize("how", ["fork", "spawn", "forkserver", "threads"])
def test_a_pool_after_a_run_gives_the_same_bits(how: str, layer: str, script: Path) -> None:
    """Of three seeds, before in the parent, in the pool, and after in the parent: equal to the bit."""
    if layer == "workqueue" and how not in ("fork", "threads"):
        pytest.skip("processes that share nothing differ in nothing from the first")
    done = subprocess.run(
        # Warnings of later Pythons on forks are not ours to judge.
        [sys.executable, "-W", "ignore", str(script), how],
        env=os.environ | {"NUMBA_THREADING_LAYER": layer, "NUMBA_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == f"{layer} as alone\n", done.stderr


def test_threads_take_turns_where_two_at_once_would_end_the_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(threading_layer, "layer", lambda: "workqueue")
    order: list[str] = []
    entered, told_to_leave = threading.Event(), threading.Event()

    def first() -> None:
        with taking_turns(), taking_turns():  # one run within another is one turn
            entered.set()
            told_to_leave.wait()
            order.append("first")

    def second() -> None:
        entered.wait()
        told_to_leave.set()
        with taking_turns():
            order.append("second")

    threads = [threading.Thread(target=task) for task in (first, second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert order == ["first", "second"]


def test_they_need_not_where_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each waits inside for the other: with turns this would not end."""
    monkeypatch.setattr(threading_layer, "layer", lambda: "omp")
    both = threading.Barrier(2)

    def task() -> None:
        with taking_turns():
            both.wait()

    threads = [threading.Thread(target=task) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
