"""The stability map: what it measures, and that `accurate` holds on the thinned one."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.compare.stability import (
    CASES,
    Case,
    MapEntry,
    chosen_cases,
    examine,
    map_stability,
)
from ellipsoid_coupling.compare.stability.distance import Shape, distances
from ellipsoid_coupling.models import kind_named, model_names
from ellipsoid_coupling.output.stability_report import report_stability, summary_rows

SHORT = {"times": [0.1]}


# Sections of the scene that a case gives or takes out: their terms need kernels of their own.
TERMS = {"flow", "interaction", "walls", "noise"}
# Strong noise with the terms of the scene `stationary`, whose kernels other tests need as well.
NOISY = Case(
    "noise",
    "100, in a trap",
    {
        "flow": None,
        "walls": None,
        "domain.boundary": "open",
        "outer_potential": {"stiffness": 10.0},
        "angular_potential": {"amplitude": 1.0},
        "noise": {"noise": 100.0, "angular_noise": 100.0},
    },
)


def shared_cases(model: str) -> list[Case]:
    """Those of the thinned map that other tests compile for, too, and `NOISY` for those with noise."""
    free = model in ("microscopic", "rho_mono_kinetic")  # as in the scene `cavity_free`
    cases = [
        case
        for case in chosen_cases(quick=True)
        if not TERMS & set(case.settings) or (free and case.name == "eps0 0")
    ]
    noisy = model in ("microscopic", "q_maxwellian", "q_mono_kinetic")
    cases = [case for case in cases if case.value != "1 (circle)"] + [NOISY] * noisy
    # Half as many angles as the map has.
    return [replace(case, settings={"numerics.angle_cells": 8} | case.settings) for case in cases]


def require_accurate_holds(model: str, cases: Sequence[Case]) -> None:
    """Finite, mass to 1e-12, no negative density, particles inside the walls (`run_case.MapEntry`)."""
    entries = [
        entry
        for case in cases
        for entry in examine(replace(case, reference=False), model, ("accurate",))
    ]
    accurate = [f for f in entries if f.outcome != "not applicable"]
    refused = {f.case for f in accurate if f.outcome == "refused"}
    assert refused <= {"start outside"}
    missed = [f"{f.case}: {f.reason}" for f in accurate if f.outcome in ("stopped", "broken")]
    assert not missed
    assert all(f.mass_drift < 1e-12 for f in accurate if f.outcome == "completed")


@pytest.mark.parametrize("model", model_names())
def test_accurate_completes_the_thinned_map(model: str) -> None:
    """Must catch a step control, a limiter or a closure that stiffness, density or walls break.

    On few angles, and without the cases that need kernels of their own, which are most of the work:
    circles, other terms, nothing at all. The twin below has them.
    """
    cases = shared_cases(model)
    assert len(cases) >= 20
    require_accurate_holds(model, cases)


@pytest.mark.heavy
@pytest.mark.parametrize("model", model_names())
def test_accurate_completes_the_whole_thinned_map(model: str) -> None:
    """All of them."""
    require_accurate_holds(model, chosen_cases(quick=True))


def test_every_case_has_its_own_name_and_builds() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    outside = [case.name for case in CASES if case.family == "start" and case.value == "outside"]
    for case in CASES:
        if case.name not in outside:
            case.scene(kind_named("microscopic"))


def test_a_run_that_fails_says_why_and_what_it_would_need() -> None:
    """The leapfrog under stiff drag: dt drag = 100, where it needs 2."""
    case = Case("drag", "1e4", {"flow.drag": 1e4, "times": [5.0]})
    entries = {entry.scheme: entry for entry in examine(case, "microscopic", ("paper", "accurate"))}
    paper, accurate = entries["paper"], entries["accurate"]
    assert paper.outcome == "stopped"
    assert "beyond what forces" in paper.reason
    assert paper.needed_step == 2e-4
    assert accurate.outcome == "completed"
    assert accurate.error < 1e-2
    assert math.isnan(accurate.needed_step)


def test_what_leaves_through_open_edges_is_counted() -> None:
    """All of the mass is blown out; what is missing is what was measured at the edges."""
    settings = {"walls": None, "domain.boundary": "open", "flow.field": "top_bottom"}
    case = Case("open", "", settings | {"times": [5.0]})
    for model in ("rho_mono_kinetic", "q_mono_kinetic", "q_maxwellian", "diffusive"):
        for entry in examine(case, model, ("paper", "accurate")):
            assert entry.outcome == "completed", entry
            assert entry.mass_drift < 1e-12


def test_distances_are_those_of_shifted_masses() -> None:
    """A marginal moved by a tenth of the width is 0.1 away, axes turned by 90 degrees 2."""
    places = (np.arange(480) + 0.5) / 480
    one = Shape(np.array([places > 0.3, places > 0.5], np.float64), 1.0)
    other = Shape(np.array([places > 0.4, places > 0.5], np.float64), -1.0)
    place, angle = distances(one, other, turns=True)
    assert (place, angle) == pytest.approx((0.1, 2.0), abs=1e-3)
    assert distances(one, other, turns=False)[1] == 0.0


def test_the_report_is_whole(tmp_path: Path) -> None:
    cases = [Case("as it is", "", SHORT), Case("start", "outside", CASES[0].settings)]
    entries = map_stability(cases[:1], ["microscopic", "stationary_state"])
    stopped = replace(entries[0], value="<b>", outcome="stopped", reason="a & b")
    report_stability([*entries, stopped], cases, tmp_path)
    lines = list(csv.DictReader((tmp_path / "stability.csv").read_text().splitlines()))
    assert len(lines) == 5
    assert set(lines[0]) == {*MapEntry.__dataclass_fields__, "error"}
    assert float(lines[0]["error"]) == entries[0].error
    page = (tmp_path / "index.html").read_text()
    assert "&lt;b&gt;" in page
    assert "a &amp; b" in page
    assert (tmp_path / "stability.png").stat().st_size > 10_000
    assert (tmp_path / "stability_cases.png").stat().st_size > 10_000
    assert [row[:3] for row in summary_rows(entries)][-2:] == [
        ("all", "paper", "2"),
        ("all", "accurate", "2"),
    ]
