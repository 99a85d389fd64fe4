"""The numbers of `ellipsoid plan` against counted ones."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.flow.scales import FlowScales
from ellipsoid_coupling.models import (
    SCHEMES,
    kind_named,
    model_kinds,
    model_names,
    plan_numbers,
)
from ellipsoid_coupling.models.cost_table import COSTS, cost_of, machine_probe
from ellipsoid_coupling.models.plan_numbers import (
    fluid_acceleration,
    given_steps,
    item_count,
    neighbours_in_reach,
    phi3,
)
from ellipsoid_coupling.scenes import builtin_scenes
from tests.command_line import status_of

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


def test_steps_of_a_grid_are_at_most_those_of_the_fluid() -> None:
    """T U/(C h) with U at the corners; the mass starts at rest at a third of that radius."""
    scene = ec.load_scene("rotation", SMALL | {"numerics.cell": 0.05, "times": [3.0]})
    steps = ec.simulate(scene, "rho_mono_kinetic", "paper").attributes["steps"]
    told = facts(scene, "rho_mono_kinetic", "paper")["steps"]
    expected = 3.0 * math.hypot(1.5, 1.5) / (0.9 * 0.05)
    assert float(told.removeprefix("at most about ")) == pytest.approx(expected, rel=0.05)
    assert expected / 10.0 < steps <= expected


def test_steps_to_a_tolerance_are_about_those_of_the_run() -> None:
    """dt^3 phi3 gamma a = tolerance length with a = 1.22 in `rotation`: within a factor of two."""
    scene = ec.load_scene("rotation", SMALL | {"times": [3.0]})
    steps = ec.simulate(scene, "microscopic", "accurate").attributes["steps"]
    told = float(facts(scene, "microscopic")["steps"].removeprefix("about "))
    assert told / 2.0 < steps < told * 2.0


def test_the_acceleration_of_a_rotation_is_its_radius() -> None:
    """(u grad) u = -r: the root mean square over [-1.5, 1.5]^2 is 1.5 sqrt(2/3)."""
    box = (-1.5, 1.5), (-1.5, 1.5)
    found = fluid_acceleration(analytic_flow("rotation"), box)
    assert found == pytest.approx(1.5 * math.sqrt(2.0 / 3.0), rel=1e-3)
    for z in (1e-4, 1e-2, 1.0, 30.0):
        # The integral of (1 - s)^2 e^{-z s}/2 over s from 0 to 1.
        s = (np.arange(20_000) + 0.5) / 20_000
        integral = float(np.mean((1.0 - s) ** 2 * np.exp(-z * s)) / 2.0)
        assert phi3(z) == pytest.approx(integral, rel=1e-5)


@pytest.mark.parametrize(
    "model", ["microscopic", "mckean_vlasov", "rho_mono_kinetic", "q_mono_kinetic"]
)
def test_items_are_those_that_the_run_holds(model: str) -> None:
    scene = ec.load_scene("rotation", SMALL | {"numerics.cell": 0.1, "numerics.angle_cells": 12})
    variables = ec.simulate(scene, model, "paper").variables
    kind = kind_named(model)
    held = variables["density" if kind.is_grid else "x"][0].size
    # Even samples fill a square lattice: eight by eight for sixty.
    assert item_count(kind, scene) == (60 if kind.is_sampled_density else held)
    assert 0 <= held - item_count(kind, scene) <= 4


def test_numbers_that_decide_are_those_of_their_formulas() -> None:
    """The reach is sqrt(2) 2 L; the start box of `rotation` is 0.5 x 0.5, its domain 3 x 3."""
    scene = ec.load_scene("rotation", {"numerics.cell": 0.02, "particles.number": 50})
    told, reach = facts(scene, "rho_mono_kinetic"), math.sqrt(2.0) * 0.2
    assert float(told["reach in cells"]) == pytest.approx(reach / 0.02, rel=0.01)
    near = 49 * math.pi * reach**2 / 0.25
    assert neighbours_in_reach(scene) == pytest.approx(min(near, 49.0))
    # Speed at the corner over drag 1 and side 3, up to half a point of 200.
    assert float(told["U/(gamma L)"]) == pytest.approx(math.hypot(1.5, 1.5) / 3.0, rel=0.02)


@pytest.mark.parametrize("factor", [1e99, 1e200, 1e304, math.inf])
def test_of_a_flow_beyond_double_precision_nothing_is_told(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No division by a step of 0, and no U = nan: a saved flow may be as fast as 1e99."""

    def accelerated(*_: object) -> float:
        return factor

    def scaled(*_: object) -> FlowScales:
        return FlowScales(math.nan, math.nan, math.nan)

    # By name, as the package has a function of the module's name.
    module = sys.modules[given_steps.__module__]
    monkeypatch.setattr(module, "fluid_acceleration", accelerated)
    monkeypatch.setattr(module, "flow_scales", scaled)
    settings = SMALL | {"numerics.tolerance": 1e-14, "particles.length": 1e-20}
    told = facts(ec.load_scene("rotation", settings | {"particles.width": 1e-21}), "microscopic")
    assert "U/(gamma L)" not in told
    assert ("steps" in told) == (factor <= 1e200)


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
    words = ["plan", "top_bottom", "--model", "rho_mono_kinetic", "--scheme", "paper"]
    assert status_of(*words) == 0
    out = capsys.readouterr().out
    for name in ("memory", "60 x 60", "reach in cells", "time", "U/(gamma L)"):
        assert name in out
