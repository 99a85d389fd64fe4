"""Known truths that models share: oscillators, Gaussians, flows from a formula and from OpenFOAM."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import openfoam_available

Floats = NDArray[np.float64]
NEEDS_OPENFOAM = pytest.mark.skipif(not openfoam_available(), reason="OpenFOAM is not installed")


def oscillator(amplitude: float, times: list[float], scheme: Any) -> tuple[Floats, Floats]:
    """Mean x and velocity_x of 40 000 independent particles of the stationary scene, (T,) each."""
    settings = {
        "interaction": None,
        "angular_potential": None,
        "noise": {"noise": amplitude, "angular_noise": 0.0},
        "particles.number": 1000,
        "times": times,
        "numerics.time_step": 0.002,
        "numerics.tolerance": 1e-5,
    }
    scene = ec.load_scene("stationary", settings)
    result = ec.simulate(scene, "microscopic", scheme, realisations=40)
    means = [result.variables[name].mean(axis=(1, 2)) for name in ("x", "velocity_x")]
    return means[0], means[1]


@pytest.mark.parametrize("amplitude", [0.2, 1.0, 2.0, 3.0])
def test_means_follow_the_damped_oscillator(amplitude: float) -> None:
    """X'' + (A^2/2) x' + x = 0 from 2.5: to five standard errors (1/200) of the unit Gaussian."""
    times = [0.5, 1.0, 2.0, 4.0]
    x, v = oscillator(amplitude, times, "accurate")
    system = np.array([[0.0, 1.0], [-1.0, -(amplitude**2) / 2.0]])
    from scipy.linalg import expm

    expected = np.array([expm(system * t) @ [2.5, 0.0] for t in times])
    assert np.abs(np.array([x, v]).T - expected).max() < 5.0 / 200.0


@pytest.mark.parametrize("amplitude", [0.5, 1.0, 3.0])
def test_decay_rates_are_the_known_ones(amplitude: float) -> None:
    """A^2/4 below A = 2, A^2/4 - sqrt(A^4/16 - 1) above, within 2 %.

    Below, v + (A^2/4) x and w x are the two parts of an amplitude that decays without oscillation;
    above, the slow part is left after the fast one (rate 4.3 at A = 3) has gone.
    """
    half = amplitude**2 / 4.0
    if amplitude < 2.0:
        times, rate = [0.5, 3.0], half
        x, v = oscillator(amplitude, times, "accurate")
        size = np.hypot(v + half * x, math.sqrt(1.0 - half**2) * x)
    else:
        times, rate = [1.5, 5.0], half - math.sqrt(half**2 - 1.0)
        size, _ = oscillator(amplitude, times, "accurate")
    measured = math.log(size[0] / size[1]) / (times[1] - times[0])
    assert measured == pytest.approx(rate, rel=0.02)


@pytest.mark.parametrize("amplitude", [0.5, 1.0, 2.0, 3.0, 5.0])
def test_the_maxwellian_closure_decays_at_the_known_rates(amplitude: float) -> None:
    """The same rates from the density's mean, within 2 % at h = 0.1 (h = 0.2: 3 % at A = 2).

    At A = 2 both rates are 1, and x + v decays without the factor t.
    """
    half = amplitude**2 / 4.0
    rate = half if amplitude <= 2.0 else half - math.sqrt(half**2 - 1.0)
    times = [0.5, 3.0] if amplitude <= 2.0 else [1.5, 5.0]
    settings = {
        "interaction": None,
        "angular_potential": None,
        "particles.width": 1.0,
        "noise": {"noise": amplitude, "angular_noise": 0.0},
        "times": times,
        "numerics.cell": 0.1,
    }
    result = ec.simulate(ec.load_scene("stationary", settings), "q_maxwellian")
    density = result.variables["density"]
    total = density.sum(axis=(1, 2, 3))
    x = (density * result.coordinates["x"]).sum(axis=(1, 2, 3)) / total
    v = (density * result.variables["velocity_x"]).sum(axis=(1, 2, 3)) / total
    size = x
    if amplitude < 2.0:
        size = np.hypot(v + half * x, math.sqrt(1.0 - half**2) * x)
    elif amplitude == 2.0:
        size = x + v
    assert math.log(size[0] / size[1]) / (times[1] - times[0]) == pytest.approx(rate, rel=0.02)


@NEEDS_OPENFOAM
@pytest.mark.openfoam
@pytest.mark.parametrize("name", ["top_bottom", "rotation"])
def test_openfoam_and_formula_give_the_same_run(name: str) -> None:
    """Positions to 1e-6: the field from icoFoam on 20 x 20 cells is single precision's 1e-7 off."""
    settings = {"times": [0.75], "particles.number": 50, "interaction": None}
    exact = ec.simulate(ec.load_scene(name, settings), "microscopic", realisations=2)
    solved = settings | {"flow.source": "openfoam", "flow.cells": 20}
    run = ec.simulate(ec.load_scene(name, solved), "microscopic", realisations=2)
    for variable in ("x", "y", "velocity_x", "velocity_y"):
        assert np.abs(run.variables[variable] - exact.variables[variable]).max() < 1e-6
    assert "OpenFOAM case" in str(run.attributes["flow"])
