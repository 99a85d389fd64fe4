"""How long a user waits: for help, for the first step, for the first compile."""

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
    yield Row("ellipsoid --help", "0.3 s", f"{help_:.2f} s", "", {"seconds": help_})
    yield Row(
        "a run of one step, whole process",
        "at most 2 s with cached kernels, 30 s with none",
        ", ".join(f"{m} {again[m]:.1f} and {compiled[m]:.1f} s" for m in again),
        "python, numba and scipy loaded, kernels read; then compiled as well",
        {f"{m}_cached": again[m] for m in again} | {f"{m}_compiled": compiled[m] for m in again},
    )
