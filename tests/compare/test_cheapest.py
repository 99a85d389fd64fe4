"""The front, the cheapest run below an error, and models that a scene does not have."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import Frontier, FrontierRow, choose, pareto_front, run_frontier
from ellipsoid_coupling.compare import frontier as frontier_module
from ellipsoid_coupling.compare import reference_solution as reference_module
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.resolutions import LEVELS, make_refinement
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import SCHEMES
from ellipsoid_coupling.output.frontier_report import choice_rows, frontier_text, warning_rows
from ellipsoid_coupling.scenes.files import builtin_scenes


def row(model: str, seconds: float, *errors: float) -> FrontierRow:
    return FrontierRow("", model, "paper", "h = 1", errors, errors, seconds)


ROWS = [
    row("slow", 9.0, 0.01, 0.02),
    row("quick", 0.1, 0.5, 0.2),
    row("beaten", 2.0, 0.2, 0.2),
    row("middle", 1.0, 0.01, 0.09),
    row("failed", math.nan, math.nan, math.nan),
]


def test_the_front_keeps_what_no_other_run_beats() -> None:
    """The largest error over the saved times decides."""
    assert [r.model for r in pareto_front(ROWS, "density")] == ["quick", "middle", "slow"]


def test_the_cheapest_run_below_each_error() -> None:
    ten, three, one = choose(ROWS, "angle")
    assert (ten.row, three.row, one.row) == (ROWS[3], ROWS[0], None)
    assert one.best is ROWS[0]
    assert choose(ROWS[-1:], "angle")[0].best is None


@pytest.mark.parametrize("name", builtin_scenes())
def test_refinements_rise_in_cost_and_fill_the_domain(name: str) -> None:
    """Five levels or more, the next always dearer, whole cells across."""
    scene = ec.load_scene(name)
    for model in frontier_module.frontier_models():
        for scheme in SCHEMES:
            refinement = make_refinement(scene, model, scheme)
            costs = [level.cost for level in refinement.levels]
            assert len(costs) >= LEVELS
            assert costs == sorted(costs)
            for level in refinement.levels:
                cells = scene.domain.width / level.scene.numerics.cell
                assert abs(cells - round(cells)) < 1e-9
                assert level.scene.numerics.angle_cells % 4 == 0


def test_what_runs_tell_is_reported() -> None:
    """Once, with the resolutions, where several of a model and scheme tell the same."""
    crossed = replace(ROWS[0], warnings=("Characteristics crossed at t = 0.5.",))
    rows = [crossed, replace(crossed, resolution="h = 2"), *ROWS[1:]]
    scene = ec.load_scene("rotation", {"times": [0.1]})
    result = ec.Result(scene, "microscopic", "accurate", "particles", np.array([0.1]), {}, {})
    none = Errors(np.zeros(1), np.zeros(1))
    told = Frontier(rows, result, exact=True, sampling=none, finest={})
    line = ("slow", "paper", "h = 1; h = 2", "Characteristics crossed at t = 0.5.")
    assert warning_rows(told) == [line]
    assert frontier_text(told).count("Characteristics crossed") == 1
    assert "Warnings of" not in frontier_text(replace(told, rows=ROWS))


def test_a_model_that_refuses_the_scene_is_left_out_and_named(
    monkeypatch: pytest.MonkeyPatch, rotation_flow: FlowField
) -> None:
    """Without drag there is no diffusive limit."""
    monkeypatch.setattr(reference_module, "_EXACT_SIDE", 64)
    values = {"interaction": None, "flow.drag": 0.0, "outer_potential.stiffness": 1.0}
    scene = ec.load_scene("rotation", values | {"times": [0.2]})
    models = ("rho_mono_kinetic", "diffusive")
    frontier = run_frontier(scene, rotation_flow, models=models, longest=1e-3)
    assert {r.model for r in frontier.rows} == {"rho_mono_kinetic"}
    assert [model for model, _ in frontier.left_out] == ["diffusive"]
    text = frontier_text(frontier)
    assert "diffusive is left out: scene rotation" in text
    assert "not run: would take about" in text or "stopped" in text
    assert [line[1] for line in choice_rows(frontier)] == 2 * ["10%", "3%", "1%"]
    with pytest.raises(InputError, match="a model that fits"):
        run_frontier(scene, rotation_flow, models=("diffusive",))
