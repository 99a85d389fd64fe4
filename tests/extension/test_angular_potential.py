"""How to add an angular potential V2(theta), in one file. Three steps:

* a NamedTuple with its parameters, which are the keys of ``[angular_potential]`` in a scene file;
* its value V2, its torque -dV2/dtheta, and the torque's slope, which the paper's implicit Euler step for
  cells needs for Newton's iteration;
* their registration under a kind.

All models then have it: particles and cells turn by the torque, `stationary_state` takes the value.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.special import ellipk

import ellipsoid_coupling as ec
from ellipsoid_coupling.physics import angular
from ellipsoid_coupling.scenes.values import Positive


class Facets(NamedTuple):
    """V2(theta) = -amplitude cos(folds theta): so many directions attract alike."""

    amplitude: Positive
    folds: int = 3


def energy(potential: Facets, angle: float) -> float:
    """V2."""
    return -potential.amplitude * math.cos(potential.folds * angle)


def torque(potential: Facets, angle: float) -> float:
    """-dV2/dtheta."""
    return -potential.folds * potential.amplitude * math.sin(potential.folds * angle)


def slope(potential: Facets, angle: float) -> float:
    """The torque's derivative."""
    return -(potential.folds**2) * potential.amplitude * math.cos(potential.folds * angle)


angular.register(
    "facets",
    Facets,
    energy=energy,
    torque=torque,
    slope=slope,
    text="V2 = -{amplitude:g} cos({folds} theta)",
)

START = 0.6
SCENE: dict[str, Any] = {
    "name": "facets",
    "times": [1.0],
    "domain": {"x": [0.0, 1.0], "y": [0.0, 1.0], "boundary": "open"},
    "particles": {"length": 0.1, "width": 0.05, "number": 4},
    "start": {"x": [0.3, 0.7], "y": [0.3, 0.7], "angle": START},
    "angular_potential": {"kind": "facets", "amplitude": 2.0},
    "numerics": {"cell": 0.1, "angle_cells": 24, "tolerance": 1e-8},
}


def half_period(amplitude: float, folds: int) -> float:
    """Of a pendulum, (folds theta)'' = -folds^2 amplitude sin(folds theta), from rest at START."""
    return 2.0 * float(ellipk(math.sin(0.5 * folds * START) ** 2)) / (folds * math.sqrt(amplitude))


def test_a_particle_swings_like_a_pendulum() -> None:
    """To the other side and back; 1e-5, from steps of second order at a tolerance of 1e-8."""
    half = half_period(2.0, 3)
    scene = ec.load_scene(SCENE, {"times": [half, 2.0 * half]})
    angle = ec.simulate(scene, model="mckean_vlasov").variables["angle"]
    np.testing.assert_allclose(angle[0], -START, atol=1e-5)
    np.testing.assert_allclose(angle[1], START, atol=1e-5)


def test_cells_swing_alike() -> None:
    """At the bottom of its swing a pendulum turns fastest: the rho-equation.

    Within 3 %, as steps turn by a part of an angle cell (measured 2.7 %).
    """
    scene = ec.load_scene(SCENE, {"times": [0.5 * half_period(2.0, 3)]})
    result = ec.simulate(scene, model="rho_mono_kinetic")
    fastest = -2.0 * math.sqrt(2.0) * math.sin(0.5 * 3 * START)
    spin = result.variables["angular_velocity"][-1][result.variables["density"][-1] > 0.0]
    np.testing.assert_allclose(spin, fastest, rtol=0.03)


@pytest.mark.parametrize("angle", [0.2, 1.0, 4.0])
def test_torque_and_slope_are_derivatives(angle: float) -> None:
    """Central differences, error 1e-8: what `register` cannot check for you."""
    potential, step = Facets(2.0), 1e-5
    fall = energy(potential, angle - step) - energy(potential, angle + step)
    rise = torque(potential, angle + step) - torque(potential, angle - step)
    assert torque(potential, angle) == pytest.approx(fall / (2.0 * step), abs=1e-8)
    assert slope(potential, angle) == pytest.approx(rise / (2.0 * step), abs=1e-7)


def test_its_equilibrium_is_its_boltzmann_factor() -> None:
    """The angles of exp(-V1 - V2)/Z, to rounding."""
    settings = {
        "outer_potential": {"stiffness": 4.0},
        "domain": {"x": [-2.0, 2.0], "y": [-2.0, 2.0], "boundary": "open"},
        "noise": {"noise": 1.0, "angular_noise": 1.0},
        "numerics.cell": 0.5,
    }
    scene = ec.load_scene(SCENE, settings)
    result = ec.simulate(scene, model="stationary_state")
    angle = result.coordinates["angle"]
    found = result.variables["density"][-1].sum(axis=(1, 2))
    expected = np.exp(2.0 * np.cos(3.0 * angle))
    np.testing.assert_allclose(found / found.sum(), expected / expected.sum(), rtol=1e-12)


@pytest.mark.parametrize("angle", [0.0, START])
def test_the_implicit_step_of_cells_takes_it(angle: float) -> None:
    """Scheme `paper`, whose implicit Euler step damps the swing: it ends on the way from START to 0.

    At the bottom nothing swings, exactly.
    """
    settings = {"start.angle": angle, "numerics.time_step": 0.01, "times": [0.2]}
    result = ec.simulate(ec.load_scene(SCENE, settings), "rho_mono_kinetic", scheme="paper")
    found = result.variables["mean_angle"][-1][result.variables["density"][-1] > 0.0]
    assert np.all(found <= angle)
    assert np.all(found >= 0.0)
    assert np.all(found < angle) or angle == 0.0


class Mistyped(NamedTuple):
    """A record whose registration goes wrong."""

    amplitude: Positive


def test_mistakes_are_told_in_one_line() -> None:
    formulas: dict[str, Any] = {"energy": energy, "torque": torque, "slope": slope, "text": "V2"}
    told = r"expected the arguments \(potential, angle\), found \(x, y, angle\)"
    with pytest.raises(TypeError, match=told):
        angular.register("mistyped", Mistyped, **formulas | {"energy": lambda x, y, angle: 0.0})
    with pytest.raises(ValueError, match=r"\[angular_potential\] has a kind facets"):
        angular.register("facets", Mistyped, **formulas)
    for changes, told in (
        ({"amplitude": None}, r"angular_potential\.amplitude: expected a value, found none"),
        ({"fold": 3}, r"angular_potential\.fold: expected one of kind, amplitude, folds"),
        ({"kind": "mistyped"}, r"angular_potential\.kind: expected .*facets'?, found 'mistyped'"),
    ):
        settings = {f"angular_potential.{key}": value for key, value in changes.items()}
        with pytest.raises(ec.InputError, match=told):
            ec.load_scene(SCENE, settings)
