"""What noise, potential and interaction settle to: Gaussian velocities, and the stationary state."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec

# Noise, and next to nothing else: a fluid and a potential, so that all runs here need the same kernels.
ALONE: dict[str, Any] = {
    "interaction": None,
    "angular_potential": None,
    "outer_potential": {"stiffness": 1e-30},
    "flow": {"source": "closed_form", "field": "rotation", "drag": 0.0, "angular_drag": 0.0},
}
PARTICLE_MODELS = pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])


def variances(scene: ec.Scene, model: str, scheme: Any) -> tuple[float, int]:
    """Variance of the velocities, in a fluid that drags of the angular ones alone, and their number.

    A fluid's velocity depends on the place, which spreads: only the spin is the same everywhere.
    """
    assert scene.flow is not None
    result = ec.simulate(scene, model, scheme)
    names = ["angular_velocity"] + (["velocity_x", "velocity_y"] if scene.flow.drag == 0.0 else [])
    numbers = np.concatenate([result.variables[name][-1].ravel() for name in names])
    return float(numbers.var()), numbers.size


@PARTICLE_MODELS
@pytest.mark.parametrize("drag", [0.0, 1.0])
@pytest.mark.parametrize("part", [0.05, 0.5, 1.0])
def test_paper_scheme_has_the_variance_of_euler_maruyama(
    model: str, drag: float, part: float
) -> None:
    """A^2/(2 Gamma)/(1 - Gamma dt/2), Gamma = gamma + A^2/2, for steps up to 1/Gamma.

    1 without fluid as dt -> 0. 24 000 numbers or more: 0.9 %; four standard deviations are allowed.
    """
    gamma = drag + 2.0
    settings: dict[str, Any] = {"numerics.time_step": part / gamma, "times": [8.0 / gamma]}
    found, count = variances(noisy_scene(drag, settings), model, "paper")
    law = 4.0 / (2.0 * gamma) / (1.0 - 0.5 * part)
    assert found == pytest.approx(law, rel=4.0 * np.sqrt(2.0 / count))


@PARTICLE_MODELS
@pytest.mark.parametrize("drag", [0.0, 10.0, 1e4])
@pytest.mark.parametrize("tolerance", [1e3, 1.0, 1e-2])
def test_accurate_scheme_has_the_exact_variance(model: str, drag: float, tolerance: float) -> None:
    """A^2/(2 Gamma) whatever the step; statistical error as above."""
    gamma = drag + 2.0
    settings: dict[str, Any] = {"numerics.tolerance": tolerance, "times": [8.0 / gamma]}
    found, count = variances(noisy_scene(drag, settings), model, "accurate")
    assert found == pytest.approx(4.0 / (2.0 * gamma), rel=4.0 * np.sqrt(2.0 / count))


def noisy_scene(drag: float, settings: dict[str, Any]) -> ec.Scene:
    """A = B = 2 alone, or with the drag of a rigid rotation, whose spin is the same everywhere."""
    parts: dict[str, Any] = {
        "noise": {"noise": 2.0, "angular_noise": 2.0},
        "flow.drag": drag,
        "flow.angular_drag": drag,
        "particles.number": 1000,
        "particles.realisations": 24,
    }
    return ec.load_scene("stationary", ALONE | parts | settings)


@PARTICLE_MODELS
@pytest.mark.parametrize("amplitude", [0.5, 2.0, 10.0])
@pytest.mark.parametrize("tolerance", [1e-1, 1e-2])
def test_harmonic_potential_has_unit_gaussians(
    model: str, amplitude: float, tolerance: float
) -> None:
    """Place and velocity in V1 = r^2/2: variance 1 each, within four standard deviations of 16 000.

    The step is not small: at a tolerance of 0.1 the place may be off by 0.1 L a step; the bias that
    this leaves is of second order in it.
    """
    noise = {"noise": amplitude, "angular_noise": amplitude}
    settings: dict[str, Any] = ALONE | {"outer_potential.stiffness": 1.0, "noise": noise}
    settings |= {"particles.number": 1000, "particles.realisations": 8}
    settings |= {"numerics.tolerance": tolerance, "times": [300.0 if amplitude > 5.0 else 60.0]}
    result = ec.simulate(ec.load_scene("stationary", settings), model)
    for names in (("x", "y"), ("velocity_x", "velocity_y")):
        numbers = np.concatenate([result.variables[name][-1].ravel() for name in names])
        assert numbers.var() == pytest.approx(1.0, rel=4.0 * np.sqrt(2.0 / numbers.size))


def stationary_scene(**settings: Any) -> ec.Scene:
    """The stationary scene with A = B = 2, whose relaxation is the fastest."""
    return ec.load_scene("stationary", {"noise": {"noise": 2.0, "angular_noise": 2.0}} | settings)


def test_the_maxwellian_closure_settles_to_the_stationary_state() -> None:
    """On the same cells: after t = 16 the slowest mode is at some e^-12, relative 1e-4 in L2."""
    settings: dict[str, Any] = {"numerics.cell": 0.4, "times": [16.0]}
    scene = stationary_scene(**settings)
    rest = ec.simulate(scene, "stationary_state").variables["density"][-1]
    found = ec.simulate(scene, "q_maxwellian").variables["density"][-1]
    assert np.linalg.norm(found - rest) < 1e-4 * np.linalg.norm(rest)


@PARTICLE_MODELS
def test_particles_settle_to_the_stationary_state(model: str) -> None:
    """12 800 particles on 10 x 10 bins: the L2 distance is that of independent samples.

    Its expectation is sqrt(sum p (1 - p)/n); 1.5 times that is five standard deviations (100 bins).
    At N = 200 the finite number moves the density by less, at most a two hundredth of it.
    """
    settings: dict[str, Any] = {"particles.realisations": 64, "times": [8.0]}
    scene = stationary_scene(**settings)
    rest = ec.simulate(scene, "stationary_state").density(10)[-1]
    found = ec.simulate(scene, model).density(10)[-1]
    area = 1.2**2
    expected = np.sqrt((rest * area * (1.0 - rest * area)).sum() / 12_800) / area
    assert np.linalg.norm(found - rest) < 1.5 * expected


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@pytest.mark.parametrize("model", ["q_maxwellian", "q_mono_kinetic", "rho_mono_kinetic"])
def test_open_edges_let_nothing_into_a_trap(model: str, scheme: Any) -> None:
    """V1 pulls inwards everywhere at the edge, and so coarse a grid spreads mass up to there.

    A continued (Neumann) edge multiplied the mass by 117 in this case.
    """
    settings = {"numerics.cell": 0.6, "numerics.angle_cells": 12, "times": [2.0, 5.0, 20.0]}
    result = ec.simulate(ec.load_scene("stationary", settings), model, scheme)
    mass = result.cell_density().sum(axis=(1, 2)) * 0.6**2
    assert np.all(mass <= 1.0 + 1e-13)
    assert mass[-1] > 0.999
