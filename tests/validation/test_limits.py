"""Limits that are known: stiff drag, no inertia, circles, hard walls, no noise.

Rates are measured over decades of the parameter, so that a term of another order, or one that the
scheme drops, shows as another rate.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq, fmin

import ellipsoid_coupling as ec
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape
from ellipsoid_coupling.scenes import scene_from_table

Floats = NDArray[np.float64]

SMALL: dict[str, Any] = {
    "times": [1.0],
    "particles.number": 50,
    "particles.realisations": 2,
    "numerics.cell": 0.1,
    "numerics.harmonics_tolerance": 0.1,
    "interaction": None,
}
CIRCLES = {"particles.width": 0.1, "interaction.strength": 1.0}


def drags(value: float) -> dict[str, float]:
    return {"flow.drag": value, "flow.angular_drag": value}


def rates(errors: list[float]) -> Floats:
    """Decades that the error falls a decade of the parameter."""
    return np.asarray(-np.diff(np.log10(errors)), np.float64)


@pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])
def test_particles_under_stiff_drag_follow_the_fluid(model: str) -> None:
    """Drag to infinity: r' = u, a rigid turn by one radian; the rest is t |du/dt|/drag, rate 1.

    The tolerance is far below the smallest error, 1e-4.
    """
    numerics = {"numerics.tolerance": 1e-9}
    errors = []
    for drag in (1e2, 1e3, 1e4):
        scene = ec.load_scene("rotation", SMALL | numerics | drags(drag))
        start = ec.load_scene("rotation", SMALL | numerics | drags(drag) | {"times": [1e-9]})
        end, begin = (ec.simulate(s, model).variables for s in (scene, start))
        c, s = math.cos(1.0), math.sin(1.0)
        x = c * begin["x"] + s * begin["y"]
        y = c * begin["y"] - s * begin["x"]
        errors.append(float(np.hypot(end["x"] - x, end["y"] - y).max()))
        assert np.abs(end["angle"] - (math.pi / 2 - 1.0)).max() < 1.1 / drag
    assert rates(errors) == pytest.approx(1.0, abs=0.05)


def density(model: str, scheme: Any, drag: float, settings: dict[str, Any]) -> Floats:
    scene = ec.load_scene("rotation", SMALL | settings | drags(drag))
    return np.asarray(ec.simulate(scene, model, scheme).density(10)[-1], np.float64)


def distance(one: Floats, other: Floats) -> float:
    """L1 of densities on 10 x 10 bins over [-1.5, 1.5]^2."""
    return float(np.abs(one - other).sum() * 0.09)


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
def test_the_rho_equation_has_a_limit_at_rate_one(scheme: str) -> None:
    """At a fixed grid, with interaction: what is left of the limit goes like 1/drag.

    Drag 1e10 stands for infinity: its own rest is 1e-6 of that at 1e4.
    """
    settings = CIRCLES
    limit = density("rho_mono_kinetic", scheme, 1e10, settings)
    errors = [
        distance(density("rho_mono_kinetic", scheme, drag, settings), limit)
        for drag in (1e3, 1e4, 1e5)
    ]
    assert rates(errors) == pytest.approx(1.0, abs=0.1)


def test_the_limit_of_the_rho_equation_is_the_diffusive_one() -> None:
    """Its distance from `diffusive` is the schemes' own error, which falls with the cell width.

    The kicks about a flight become a step of Euler's rule, so that the order tends to 1: measured
    0.71, 0.79 while the start box's edges are resolved.
    """
    errors = []
    for cell in (0.1, 0.05, 0.025):
        settings = CIRCLES | {"numerics.cell": cell}
        errors.append(
            distance(
                density("rho_mono_kinetic", "accurate", 1e10, settings),
                density("diffusive", "accurate", 1e10, settings),
            )
        )
    orders = rates(errors) / math.log10(2.0)
    assert orders[1] > orders[0] > 0.6
    assert errors[-1] < 0.04


@kernel
def _potential(place: tuple[float, float], axes: Floats, shape: PotentialShape) -> float:
    first, second = 2.0 * axes[0], 2.0 * axes[1]
    c2, s2, c2b, s2b = math.cos(first), math.sin(first), math.cos(second), math.sin(second)
    return pair_potential(place[0], place[1], c2, s2, c2b, s2b, shape)[0]


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
def test_without_inertia_torques_balance(scheme: Any) -> None:
    """Two particles that cannot move settle where their potential is least.

    The fluid turns them by gamma_bar g I_c against a torque, so that the angles are off by a multiple
    of I_c, rate 1. Their oscillation has died by e^-25 (t = 10, gamma_bar = 5).
    """
    shape = potential_shape(0.1, 0.05)
    points = [[0.3, 0.1, 1.3], [0.42, 0.12, 1.1]]

    def energy(angles: Floats) -> float:
        return _potential((0.12, 0.02), angles, shape)

    least = fmin(energy, np.array([1.3, 1.1]), xtol=1e-10, ftol=1e-15, disp=False)
    errors = []
    for inertia in (1e-2, 1e-3, 1e-4):
        settings = {
            "times": [10.0],
            "particles.number": 2,
            "particles.realisations": 1,
            "particles.mass": 1e12,
            "particles.inertia": inertia,
            "start": {"points": points},
            "flow.drag": 0.0,
            "flow.angular_drag": 5.0,
            "numerics.time_step": 5e-4,
        }
        angles = ec.simulate(ec.load_scene("rotation", settings), "microscopic", scheme)
        errors.append(float(np.abs(angles.variables["angle"][-1, 0] - least).max()))
    assert rates(errors) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])
def test_circles_turn_with_the_fluid_alone(model: str) -> None:
    """No torque between them: omega' = drag (-1 - omega), which is integrated exactly."""
    scene = ec.load_scene("rotation", SMALL | CIRCLES | drags(3.0))
    angle = ec.simulate(scene, model).variables["angle"][-1]
    turned = 1.0 - (1.0 - math.exp(-3.0)) / 3.0
    assert np.abs(angle - (math.pi / 2 - turned)).max() < 1e-13


def test_the_mean_angle_of_circles_is_one_everywhere() -> None:
    """The fluid turns all cells alike, and nothing else turns them: equal to rounding."""
    result = ec.simulate(ec.load_scene("rotation", SMALL | CIRCLES), "rho_mono_kinetic").variables
    angle = result["mean_angle"][-1][result["density"][-1] > 0.0]
    assert float(np.ptp(angle)) < 1e-12


# Circles to the last digit but three, so that they are ellipses to compile for, as in `small_runs.WALLS`.
WALL: dict[str, Any] = {
    "name": "wall",
    "times": [2.5],
    "domain": {"x": [-0.2, 1.0], "y": [-0.3, 0.3], "boundary": "reflecting"},
    "particles": {"length": 0.05, "width": 0.05 * (1.0 - 1e-13), "number": 1},
    "start": {"points": [[0.8, 0.0]]},
    "flow": {"source": "closed_form", "field": "rotation", "drag": 0.0, "angular_drag": 0.0},
    "interaction": {"strength": 1.0},
    "outer_potential": {"stiffness": 1.0},
    "angular_potential": {"amplitude": 1e-30},
    "numerics": {"cell": 0.1, "tolerance": 1e-8},
}


def wall_energy(x: float, factor: float) -> float:
    """The potential of the left wall's ghosts, 0.05 apart, at (x, 0)."""
    shape = potential_shape(0.05, 0.05)
    places = 0.05 * (np.arange(12) - 5.5)
    return factor * sum(_potential((-0.2 - x, y), np.zeros(2), shape) for y in places)


def test_strong_walls_are_hard() -> None:
    """A circle that swings into the wall: it turns where its energy is used up, and keeps it.

    A hard wall at the reach of the potential is the limit: the turning point comes nearer to it with
    every decade, slowly, since U = exp(-s/(1-s)) is flat there. Velocity Verlet's energy is of
    order dt^2, and steps change on the way in as on the way out: off by 1.9e-6 at most, 3.1e-8 at a
    tolerance of 1e-10. After the wall the step grows again: the swing takes 2600 steps at most.
    """
    hard = -0.2 + math.sqrt(potential_shape(0.05, 0.05).reach ** 2 - 0.025**2)
    short = []
    for factor in (1.0, 1e3, 1e6):
        table = WALL | {"walls": {"sides": ["left"], "strength_factor": factor}}
        scene = scene_from_table(table, "test")
        result = ec.simulate(scene, "microscopic")
        end = result.variables
        x, v = float(end["x"][-1, 0, 0]), float(end["velocity_x"][-1, 0, 0])
        assert result.attributes["steps"] < 4000
        energy = 0.5 * (x * x + v * v) + wall_energy(x, factor)
        assert energy == pytest.approx(0.32, abs=1e-5)
        turn = brentq(lambda x, f=factor: 0.5 * x * x + wall_energy(x, f) - 0.32, -0.199, hard)
        # From 0.8 to the turning point and back: a hard wall there is the same to the flight's end.
        there = math.acos(hard / 0.8)
        expected = 0.8 * math.cos(2.0 * there - 2.5)
        short.append(hard - turn)
        assert abs(x - expected) < 3.0 * (hard - turn) + 1e-6
    assert short[0] > short[1] > short[2]
    assert short[2] < 0.02


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov", "q_mono_kinetic"])
def test_no_noise_is_the_deterministic_run(model: str, scheme: Any) -> None:
    """[noise] with A = B = 0 gives the bits of a scene without [noise]."""
    settings = SMALL | {"interaction.strength": 1.0, "numerics.angle_cells": 12}
    quiet = settings | {"noise": {"noise": 0.0, "angular_noise": 0.0}}
    one, other = (
        ec.simulate(ec.load_scene("rotation", s), model, scheme) for s in (settings, quiet)
    )
    for name, values in one.variables.items():
        assert np.array_equal(values, other.variables[name]), name


def test_the_leapfrog_has_no_such_limit() -> None:
    """Explicit in the damping, it is stable up to dt drag = 2 only, and says so beyond."""
    settings = SMALL | {"times": [5.0]} | drags(1e4)
    with pytest.raises(RunError):
        ec.simulate(ec.load_scene("rotation", settings), "microscopic", "paper")
    fine = settings | {"numerics.time_step": 1.9e-4, "times": [0.1]}
    assert (
        ec.simulate(ec.load_scene("rotation", fine), "microscopic", "paper").status == "completed"
    )
