"""The numbers of `ellipsoid plan` against counted ones."""

from __future__ import annotations

import math

import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.models import (
    SCHEMES,
    kind_named,
    model_kinds,
    model_names,
    plan_numbers,
)
from ellipsoid_coupling.models.cost_table import COSTS, cost_of, machine_probe
from ellipsoid_coupling.models.plan_numbers import given_steps, item_count, neighbours_in_reach
from ellipsoid_coupling.scenes import builtin_scenes

SMALL = {
    "particles.number": 30,
    "particles.realisations": 2,
    "times": [0.3, 0.5],
    "interaction": None,
}


def facts(scene: ec.Scene, model: str, scheme: str = "accurate") -> dict[str, str]:
    """By name, with the flow of `rotation`."""
    told = plan_numbers(scene, model, scheme, analytic_flow("rotation"))
    return {fact.name: fact.value for fact in told}


@pytest.mark.parametrize("step", [0.01, 0.07, 0.3, 1.0])
def test_steps_of_a_fixed_length_are_those_of_the_run(step: float) -> None:
    """Exactly: equal ones to each save time, none longer than the step."""
    scene = ec.load_scene("rotation", SMALL | {"numerics.time_step": step})
    run = ec.simulate(scene, "microscopic", "paper")
    assert given_steps(scene) == run.attributes["steps"]
    assert facts(scene, "microscopic", "paper")["steps"] == f"{given_steps(scene)}"


def test_steps_of_a_grid_are_about_those_of_the_run() -> None:
    """T U/(C h) with U at the corners of the domain, where no mass is: at most four times too many."""
    scene = ec.load_scene("rotation", SMALL | {"numerics.cell": 0.05})
    steps = ec.simulate(scene, "rho_mono_kinetic", "paper").attributes["steps"]
    told = facts(scene, "rho_mono_kinetic", "paper")["steps"]
    expected = 0.5 * math.hypot(1.5, 1.5) / (0.9 * 0.05)
    assert float(told.removeprefix("about ")) == pytest.approx(expected, rel=0.05)
    assert expected / 4.0 < steps < expected * 1.5


@pytest.mark.parametrize(
    "model", ["microscopic", "mckean_vlasov", "rho_mono_kinetic", "q_mono_kinetic"]
)
def test_items_are_those_that_the_run_holds(model: str) -> None:
    scene = ec.load_scene("rotation", SMALL | {"numerics.cell": 0.1, "numerics.angle_cells": 12})
    variables = ec.simulate(scene, model, "paper").variables
    held = variables["x" if model in ("microscopic", "mckean_vlasov") else "density"]
    assert item_count(kind_named(model), scene) == held[0].size


def test_numbers_that_decide_are_those_of_their_formulas() -> None:
    """The reach is sqrt(2) 2 L; the start box of `rotation` is 0.5 x 0.5, its domain 3 x 3."""
    scene = ec.load_scene("rotation", {"numerics.cell": 0.02, "particles.number": 50})
    told, reach = facts(scene, "rho_mono_kinetic"), math.sqrt(2.0) * 0.2
    assert float(told["reach in cells"]) == pytest.approx(reach / 0.02, rel=0.01)
    near = 49 * math.pi * reach**2 / 0.25
    assert neighbours_in_reach(scene) == pytest.approx(min(near, 49.0))
    # Speed at the corner over drag 1 and side 3, up to half a point of 200.
    assert float(told["U/(gamma L)"]) == pytest.approx(math.hypot(1.5, 1.5) / 3.0, rel=0.02)


def test_a_potential_of_few_cells_is_warned_of() -> None:
    scene = ec.load_scene("rotation", {"numerics.cell": 0.1})
    told = plan_numbers(scene, "rho_mono_kinetic", "accurate")
    assert any("WARNING: too few" in fact.why for fact in told)


def test_every_model_has_numbers_of_every_scene() -> None:
    for name in builtin_scenes():
        scene = ec.load_scene(name, {"particles.number": 100})
        for model in model_names():
            told = {fact.name for fact in plan_numbers(scene, model, "paper")}
            assert "memory" in told


def test_every_kind_of_model_has_a_cost() -> None:
    for kind in model_kinds():
        for scheme in SCHEMES:
            assert cost_of(kind, scheme).item > 0.0
    assert all(cost.interacting > 0.0 for cost in COSTS.values())
    assert machine_probe() > 0.0


def test_plan_prints_the_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    main(["plan", "top_bottom", "--model", "rho_mono_kinetic", "--scheme", "paper"])
    out = capsys.readouterr().out
    for words in ("memory", "60 x 60", "reach in cells", "time", "U/(gamma L)"):
        assert words in out
