"""The plan of very large jobs: each number against a count by hand."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import ellipsoid_coupling as ec

sys.path.append(str(Path(__file__).parents[2] / "workflows"))

import cluster_plan
from cluster_plan import Measured

TOP = Path(__file__).parents[2]

# Seconds and bytes that are easily added up by hand.
FIGURES = Measured(
    realisation=3.0, sample_step=1e-6, node_step=0.5, steps=100.0, startup=7.0, cold_cache=60.0, point=0.5,
    process=1e8,
)  # fmt: skip


def test_realisations_are_split_evenly_among_the_cores() -> None:
    """10 on 4 cores: three each and one, so four points; a core takes 7 + 0.5 + 3 x 3 s at most."""
    scene = ec.load_scene("cavity", {"particles.number": 100})
    job = cluster_plan.ensemble(scene, 10, 4, FIGURES)
    assert job.cores == 4
    assert job.core_hours * 3600 == pytest.approx(4 * 7.5 + 10 * 3.0)
    assert job.hours * 3600 == pytest.approx(7.5 + 9.0 + 60.0)
    # Six variables of 8 bytes at three times; in pieces and once more as a whole.
    assert job.result_bytes == 2 * 10 * 100 * 6 * 8 * 3
    assert job.process_bytes > FIGURES.process + 3 * 100 * 6 * 8 * 3


def test_bytes_of_a_result_are_those_of_its_file(tmp_path: Path) -> None:
    """A run of 4 x 200 particles at three times: the variables, and a header of less than 100 kB."""
    settings = {"particles.number": 200, "particles.realisations": 4, "times": [0.01, 0.02, 0.03]}
    scene = ec.load_scene("rotation", settings | {"interaction": None})
    ec.simulate(scene, "microscopic", "paper", folder=tmp_path / "run")
    written = (tmp_path / "run" / "result.nc").stat().st_size
    told = cluster_plan.saved_bytes(scene, 4)
    assert told == 4 * 200 * 6 * 8 * 3
    assert 0 < written - told < 1e5


def test_samples_of_one_density_stay_on_one_machine() -> None:
    """1e6 samples, 100 steps of 1 us each and 0.5 s: 150 core seconds on a machine's cores."""
    scene = ec.load_scene("cavity")
    job = cluster_plan.samples(scene, 1e6, 1000, FIGURES)
    assert job.cores == cluster_plan.CORES_OF_A_MACHINE
    assert job.core_hours * 3600 == pytest.approx(150.0)
    more = cluster_plan.samples(scene, 1e9, 1000, FIGURES)
    # Per sample some hundreds of bytes, whatever their number.
    assert 200 < (more.process_bytes - job.process_bytes) / (1e9 - 1e6) < 2000


def test_figures_are_measured_ones() -> None:
    assert all(number > 0.0 for number in cluster_plan.MEASURED)


def test_the_page_has_the_table_of_today() -> None:
    """`workflows/docs.sh` fills in what this prints."""
    page = (TOP / "workflows" / "docs" / "pages" / "clusters.md").read_text("utf-8")
    assert "% generated: cluster plan\n" in page
    lines = cluster_plan.table(1000).splitlines()
    assert len({line.count("|") for line in lines}) == 1
    assert len(lines) == 2 + len(cluster_plan.rows(1000))
