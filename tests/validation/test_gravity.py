"""Gravity in all models: parabolic fall, terminal velocity, the shifted well."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import model_terms, plan_terms
from tests.validation.test_one_particle import moments

Floats = NDArray[np.float64]

G = np.array([0.4, -1.3])
TABLE: dict[str, Any] = {
    "name": "fall", "times": [0.2, 0.5], "domain": {"x": [-3, 3], "y": [-3, 3], "boundary": "open"},
    "particles": {"length": 0.2, "width": 0.2, "number": 16},
    "start": {"x": [-0.5, 0.5], "y": [-0.5, 0.5]}, "gravity": {"x": float(G[0]), "y": float(G[1])},
    "numerics": {"cell": 0.25, "time_step": 0.01},
}  # fmt: skip
POINTS = {"start.points": [[a, b] for a in (-0.4, -0.1, 0.1, 0.4) for b in (-0.4, -0.1, 0.1, 0.4)]}
STILL = FlowField.from_stream_function(
    np.zeros((5, 5)), np.linspace(-3.0, 3.0, 5), np.linspace(-3.0, 3.0, 5), "at rest"
)
FLUID = {"flow": {"source": "closed_form", "field": "shear", "drag": 3.0, "angular_drag": 0.0}}


def scene(model: str, **changes: Any) -> ec.Scene:
    return ec.load_scene(TABLE, (POINTS if model == "microscopic" else {}) | changes)


@pytest.mark.parametrize(
    ("model", "scheme"),
    [("mckean_vlasov", "accurate"), ("rho_mono_kinetic", "accurate"), ("q_maxwellian", "accurate")],
)
def test_all_fall_on_a_parabola(model: str, scheme: Any) -> None:
    """Velocity g t and place g t^2/2 to rounding; of cells, whose profile is that of cells, 2 % of one."""
    t = 0.5
    found = moments(ec.simulate(scene(model), model, scheme))
    velocity = np.array([found["velocity_x"], found["velocity_y"]])
    # The force of the balanced scheme is that on each cell's profile, which a box is not.
    np.testing.assert_allclose(velocity, t * G, rtol=1e-2 if model == "q_maxwellian" else 1e-9)
    place, exact = np.array([found["x"], found["y"]]), 0.5 * t**2 * G
    allowed = 1e-13 if model == "mckean_vlasov" else 5e-3
    assert np.abs(place - exact).max() <= allowed


@pytest.mark.parametrize(
    ("model", "scheme"), [("microscopic", "paper"), ("rho_mono_kinetic", "accurate")]
)
def test_in_a_fluid_at_rest_they_reach_g_over_gamma(model: str, scheme: Any) -> None:
    """To g/Gamma (1 - e^(-Gamma t)): exact by exact kicks, 2 % by steps of 0.01 of first order."""
    found = moments(ec.simulate(scene(model, **FLUID), model, scheme, flow=STILL))
    exact = G / 3.0 * -np.expm1(-3.0 * 0.5)
    velocity = np.array([found["velocity_x"], found["velocity_y"]])
    order = 1e-9 if scheme == "accurate" else 0.02
    assert np.abs(velocity - exact).max() < order * np.abs(exact).max()


def test_the_limit_of_strong_drag_falls_at_the_terminal_velocity() -> None:
    strong = {"flow": FLUID["flow"] | {"drag": 200.0}}
    for model in ("diffusive", "rho_mono_kinetic"):
        found = moments(ec.simulate(scene(model, **strong), model, flow=STILL))
        velocity = np.array([found["velocity_x"], found["velocity_y"]])
        np.testing.assert_allclose(velocity, G / 200.0, rtol=1e-9)


def test_a_well_is_shifted_by_g_over_its_stiffness() -> None:
    """V1 + V = k |r - g/k|^2/2 + const: the state at rest is a Gaussian there, to 1e-6 of its tails."""
    well = {"outer_potential": {"stiffness": 4.0}, "domain.x": [-3.0, 3.0]}
    found = moments(ec.simulate(scene("stationary_state", **well), "stationary_state"))
    assert [found["x"], found["y"]] == pytest.approx(G / 4.0, abs=1e-6)


def test_the_plan_lists_it_and_without_it_nothing_is_compiled() -> None:
    from ellipsoid_coupling.physics.outer import Gravity, Harmonic, outer_force, scene_outer

    own = scene("rho_mono_kinetic")
    (line,) = [term for term in plan_terms(own, "rho_mono_kinetic") if term.name == "gravity"]
    assert line.runs
    assert line.why == "acceleration (0.4, -1.3)"
    assert model_terms(own, "microscopic").gravity
    assert scene_outer(own) == Gravity(0.4, -1.3)
    without = ec.load_scene(TABLE, {"gravity": None})
    assert scene_outer(without) is None
    assert not model_terms(without, "microscopic").gravity
    both = ec.load_scene(TABLE, {"outer_potential": {"stiffness": 2.0}})
    assert both.outer_potential == Harmonic(2.0)
    assert outer_force(scene_outer(both), 0.1, 0.2) == pytest.approx((0.2, -1.7), rel=1e-15)
