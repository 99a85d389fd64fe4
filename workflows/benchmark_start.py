"""Waiting times and memory of a user: help, the first step, the first compile, peak memory."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmark_tools import Row, Sizes

COMMAND = (sys.executable, "-m", "ellipsoid_coupling")


def wall(arguments: Sequence[str], cache: Path | None = None) -> float:
    """Seconds of a whole command."""
    environment = dict(os.environ)
    if cache is not None:
        environment["ELLIPSOID_CACHE"] = str(cache)
    started = time.perf_counter()
    subprocess.run([*COMMAND, *arguments], check=True, capture_output=True, env=environment)
    return time.perf_counter() - started


# Particles so small that a million have some 40 neighbours each.
_MEMORY = """
import re, sys
from pathlib import Path
import ellipsoid_coupling as ec
settings = {"particles.number": int(sys.argv[1]), "particles.realisations": 1, "times": [1e-4]}
size = {"particles.length": 0.005, "particles.width": 0.0025}
ec.simulate(ec.load_scene("top_bottom", settings | size), "microscopic")
# Not ru_maxrss, which starts from the peak of the process that started this one.
print(1024 * int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]))
"""


def bytes_a_particle(few: int, many: int) -> float:
    """The growth of a whole run's peak memory, start and result included."""
    peaks = [
        int(
            subprocess.run(
                (sys.executable, "-c", _MEMORY, str(n)), check=True, capture_output=True
            ).stdout
        )
        # The first compiles, which takes memory as well.
        for n in (few, few, many)
    ]
    return (peaks[2] - peaks[1]) / (many - few)


def start_rows(sizes: Sizes) -> Iterator[Row]:
    """Rows of whole processes; none at `--quick`."""
    if not sizes.start:
        return
    help_ = sorted(wall(["--help"]) for _ in range(5))[2]
    settings = ["--set", "times=[1e-3]", "particles.realisations=1"]
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) / "cache"
        compiled, again = {}, {}
        for model in ("microscopic", "rho_mono_kinetic", "q_mono_kinetic"):
            run = ["run", "top_bottom", "--model", model, *settings]
            compiled[model] = wall([*run, "--out", f"{folder}/{model}"], cache)
            again[model] = wall([*run, "--out", f"{folder}/{model}-again"], cache)
    each = bytes_a_particle(10_000, 1_000_000)
    yield Row(
        "microscopic, peak memory of a run, N = 1e+06",
        "stated",
        f"{each:.0f} bytes a particle",
        "state, trial step, sorted copies, start and result",
        {"bytes": each},
    )
    yield Row("ellipsoid --help", "0.3 s", f"{help_:.2f} s", "", {"seconds": help_})
    yield Row(
        "a run of one step, whole process",
        "at most 2 s with cached kernels, 30 s with none",
        ", ".join(f"{m} {again[m]:.1f} and {compiled[m]:.1f} s" for m in again),
        "python, numba and scipy loaded, kernels read; then compiled as well",
        {f"{m}_cached": again[m] for m in again} | {f"{m}_compiled": compiled[m] for m in again},
    )
