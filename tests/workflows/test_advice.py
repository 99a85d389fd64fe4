"""Advice against full comparisons: a tiny one, and with `-m heavy` the ten scenes of the documentation."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import Errors, Frontier, FrontierRow
from ellipsoid_coupling.compare.advice import AdviceRow, Asked, Interval
from ellipsoid_coupling.compare.cheapest import Kind
from ellipsoid_coupling.models import resolution_text
from ellipsoid_coupling.scenes import Scene

sys.path.append(str(Path(__file__).parents[2] / "workflows"))

import advice

PROMISES_KEPT, LARGEST_RATIO = 0.95, 2.0


def frontier_of(scene: Scene, *rows: tuple[str, float, float]) -> Frontier:
    """Runs of a model at the scene's own resolution: scheme, error and seconds."""
    text = resolution_text("rho_mono_kinetic", "accurate", scene, 1)
    made = [
        FrontierRow(scene.name, "rho_mono_kinetic", scheme, text, (error,), (error,), seconds)
        for scheme, error, seconds in rows
    ]
    times = np.array(scene.times[-1:])
    nothing = Errors(np.zeros(1), np.zeros(1))
    reference = ec.Result(scene, "exact", "", "particles", times, {}, {})
    return Frontier(made, reference, exact=True, sampling=nothing, finest={})


def test_a_check_leaves_all_it_promises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Advice of twice the cheapest seconds, whose error is kept for one of two targets."""

    def compared(scene: Scene, *_: object, **__: object) -> Frontier:
        return frontier_of(scene, ("accurate", 0.4, 2.0), ("paper", 0.45, 1.0))

    def advised(scene: Scene, *, error: float, quantity: Kind, **_: object) -> ec.Advice:
        text = resolution_text("rho_mono_kinetic", "accurate", scene, 1)
        expected = Interval(0.1, 0.2, 0.25)
        row = AdviceRow(
            "rho_mono_kinetic", "accurate", text, scene, expected, expected, True, True, "keeps it"
        )
        return ec.Advice(
            scene, error, quantity, 1.0, 0.5, "", 0.0, (row,), (), row, "", Asked("rotation")
        )

    monkeypatch.setattr(advice, "run_frontier", compared)
    monkeypatch.setattr(advice, "advise", advised)
    folder = advice.main(["--quick", "--out", str(tmp_path)])
    out = capsys.readouterr().out.strip().splitlines()
    assert out[-1] == str(folder)
    assert out[0].startswith(
        "4 questions, 4 promises that were checked, 2 of them kept; 2 of 2 cost"
    )
    rows = list(csv.DictReader((folder / "advice.csv").read_text().splitlines()))
    assert [row["kept"] for row in rows] == 2 * ["True", "False"]
    assert [row["cost_ratio"] for row in rows] == 2 * ["2.0", "nan"]
    text = (folder / "advice.md").read_text().splitlines()
    assert len(text) == 2 + 4 + 2
    assert matplotlib.image.imread(folder / "advice.png").ndim == 3


def verdict(found: float, error: float = 0.1, seconds: float = 1.0) -> advice.Verdict:
    return advice.Verdict(
        "a", "density", error, "m", "s", "h = 1", True, 0.05, 0.08, found, seconds, 1.0, "b", 0.5, 3.0, ""
    )  # fmt: skip


def test_promises_and_costs_are_counted() -> None:
    """Two kept of three; ratios 2, 4 and 1."""
    some = [verdict(0.05), verdict(0.1, seconds=2.0), verdict(0.11, seconds=0.5)]
    text = advice.summary(some)
    assert "3 promises that were checked, 2 of them kept" in text
    assert "2 of 3 cost at most twice the cheapest, the largest ratio is 4" in text


@pytest.mark.heavy
def test_promises_are_kept_and_cost_at_most_twice_the_best(tmp_path: Path) -> None:
    """Ten scenes, forty questions, an hour: 95 of 100 promises kept.

    What the advised run costs is held for the middle of the cases: single ones depend on the clock.
    """
    folder = advice.main(["--out", str(tmp_path)])
    rows = list(csv.DictReader((folder / "advice.csv").read_text().splitlines()))
    checked = [row for row in rows if row["promised"] == "True" and row["found"] != "nan"]
    assert len(rows) == 4 * len(advice.CASES)
    assert len(checked) > len(rows) // 4
    assert sum(row["kept"] == "True" for row in checked) >= PROMISES_KEPT * len(checked)
    ratios = sorted(float(row["cost_ratio"]) for row in checked if row["cost_ratio"] != "nan")
    assert ratios[len(ratios) // 2] <= LARGEST_RATIO
