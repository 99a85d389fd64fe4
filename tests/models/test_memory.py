"""What a run takes at its peak against the estimate, and the limits that it is held against."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files import limits
from ellipsoid_coupling.models import SCHEMES, Setup, kind_named, model_names, model_terms
from ellipsoid_coupling.models.memory import peak_memory

# Runs each [scene, model, scheme, settings] of its input twice, with a folder: so that kernels (some are
# for many particles only) and libraries are there, and again from a fresh mark of the peak.
MEASURE = """
import ctypes, gc, json, pathlib, re, sys, tempfile
import ellipsoid_coupling as ec
from ellipsoid_coupling.models import Setup, kind_named, model_terms
from ellipsoid_coupling.models.memory import _LIBRARIES, peak_memory

def taken(key):
    status = pathlib.Path("/proc/self/status").read_text()
    return 1024 * int(re.search(key + r":\\s+(\\d+)", status)[1])

for scene, model, scheme, settings in json.load(sys.stdin):
    with tempfile.TemporaryDirectory() as folder:
        place = pathlib.Path(folder)
        ec.simulate(ec.load_scene(scene, settings), model, scheme, folder=place / "first")
        gc.collect()
        ctypes.CDLL(None).malloc_trim(0)
        pathlib.Path("/proc/self/clear_refs").write_text("5")
        before, made = taken("VmRSS"), ec.load_scene(scene, settings)
        ec.simulate(made, model, scheme, folder=place / "second")
        peak = taken("VmHWM") - before
    setup = Setup(made, model_terms(made, model), scheme, None, 0, made.particles.realisations)
    estimate = peak_memory(kind_named(model), setup) - _LIBRARIES
    print(json.dumps([model, scheme, peak, estimate]), flush=True)
"""
PARTICLES: dict[str, Any] = {
    "particles.number": 1000,
    "particles.realisations": 400,
    "numerics.time_step": 2e-3,
}
# Mass everywhere: pages of cells that nothing reaches are never given.
FULL: dict[str, Any] = {"start.x": [-1.5, 1.5], "start.y": [-1.5, 1.5]}
RHO = FULL | {"numerics.cell": 0.005}
Q = FULL | {"numerics.cell": 0.03, "numerics.angle_cells": 40}
SIZES: dict[str, dict[str, Any]] = {"particles": PARTICLES, "rho": RHO, "q": Q}
needs_proc = pytest.mark.skipif(
    not Path("/proc/self/clear_refs").exists(), reason="the system keeps no peak of memory"
)


def measured(model: str, scheme: str, **more: Any) -> list[Any]:
    """One run for `MEASURE`: about 100 MB, no interaction, two times to save."""
    layout = kind_named(model).layout
    scene = "stationary" if model == "stationary_state" else "rotation"
    size = SIZES[layout]
    if scene == "stationary":
        size = {"numerics.cell": 0.1, "numerics.angle_cells": 40}
    settings = size | {"times": [0.002, 0.004], "interaction": None} | more
    return [scene, model, scheme, settings]


def require_close(runs: list[list[Any]]) -> None:
    """Within 35 %: pages that the system gives late or takes back late are no part of the estimate."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURE], input=json.dumps(runs), capture_output=True, text=True,
        check=False, timeout=3600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(lines) == len(runs)
    wrong = [line for line in lines if not 0.65 < line[3] / line[2] < 1.35]
    assert not wrong


@needs_proc
def test_the_estimate_is_what_a_run_takes() -> None:
    require_close([measured(name, "accurate") for name in ("microscopic", "rho_mono_kinetic")])


@needs_proc
@pytest.mark.heavy
def test_the_estimate_is_what_a_run_of_any_model_takes() -> None:
    runs = [measured(name, scheme) for name in model_names() for scheme in SCHEMES]
    require_close(runs)


def test_a_copy_to_step_aside_from_is_counted() -> None:
    """Fields and drift of a rho-grid, 8 numbers a cell, more than the last variable put together takes."""
    taken = []
    for times in ([0.2], [0.1, 0.2]):
        scene = ec.load_scene("rotation", RHO | {"times": times, "interaction": None})
        setup = Setup(scene, model_terms(scene, "rho_mono_kinetic"), "accurate", None, 0, 1)
        taken.append(peak_memory(kind_named("rho_mono_kinetic"), setup))
    # One snapshot is kept; the second one's five variables are not made yet.
    assert taken[1] - taken[0] == pytest.approx(8 * 8 * 600**2)


def scene_of(number: int) -> ec.Scene:
    return ec.load_scene("rotation", {"particles.number": number, "particles.realisations": 1})


def test_a_run_that_does_not_fit_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """8 million particles at 3 save times take some 3 GB: not in 2.5 GB, of which kernels have some."""
    monkeypatch.setattr("ellipsoid_coupling.models.memory.memory_left", lambda: 2_500_000_000)
    folder = tmp_path / "run"
    with pytest.raises(InputError, match=r"8e\+06 particles, which take .* of .*GB") as caught:
        ec.simulate(scene_of(8_000_000), "microscopic", folder=folder)
    assert "keys particles.number" in str(caught.value)
    assert not folder.exists()


def test_the_shells_limit_counts_with_what_is_taken() -> None:
    """`ulimit -v` and `ulimit -d` bound addresses and data, of which a process has some already."""
    for kind, key in ((resource.RLIMIT_AS, "VmSize"), (resource.RLIMIT_DATA, "VmData")):
        before = resource.getrlimit(kind)
        status = Path("/proc/self/status").read_text("ascii")
        taken = 1024 * int(status.split(f"{key}:")[1].split()[0])
        try:
            resource.setrlimit(kind, (taken + 2_000_000_000, before[1]))
            assert limits.memory_limit() <= taken + 2_000_000_000
            assert 1_900_000_000 < limits.memory_left() < 2_100_000_000
        finally:
            resource.setrlimit(kind, before)


@pytest.mark.parametrize(
    ("version", "groups", "files"),
    [
        (1, "4:memory:/a/b\n0::/\n", {"a/b/memory.limit_in_bytes": "9223372036854771712",
                                      "a/memory.limit_in_bytes": "1000000000"}),
        (2, "0::/a/b\n", {"a/b/memory.max": "max", "a/memory.max": "1000000000"}),
        # Seen from within a container, whose own group is the mount.
        (2, "0::/../outside\n", {"memory.max": "1000000000"}),
    ],
)  # fmt: skip
def test_control_groups_of_both_versions_and_all_above_count(
    version: int,
    groups: str,
    files: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mount = tmp_path / "mount"
    for name, text in files.items():
        (mount / name).parent.mkdir(parents=True, exist_ok=True)
        (mount / name).write_text(text + "\n")
    kind = "cgroup2 cgroup2 rw" if version == 2 else "cgroup cgroup rw,memory"
    (tmp_path / "mountinfo").write_text(f"32 31 0:29 / {mount} rw,relatime shared:9 - {kind}\n")
    (tmp_path / "cgroup").write_text(groups)
    (tmp_path / "status").write_text("VmRSS:\t  100000 kB\n")
    monkeypatch.setattr(limits, "_PROCESS", tmp_path)
    assert limits.memory_limit() == 1_000_000_000
    assert limits.memory_left() == 1_000_000_000 - 102_400_000
