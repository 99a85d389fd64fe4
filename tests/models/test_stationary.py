"""The stationary state: its equation, its constant in closed form, and the scenes without one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import i0

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.interaction.q_grid import AngleGridInteraction
from ellipsoid_coupling.models import Setup, build_model, model_terms
from ellipsoid_coupling.models.stationary import StationaryState
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential, potential_shape
from ellipsoid_coupling.scenes import Scene, load_scene
from ellipsoid_coupling.simulation import simulate

Floats = NDArray[np.float64]


def scene_with(**parts: Any) -> Scene:
    """The stationary scene with parts replaced; None leaves one out."""
    table = load_scene("stationary").model_dump(exclude_none=True)
    for name, part in parts.items():
        table[name] = part
    return Scene.model_validate({k: v for k, v in table.items() if v is not None})


def model_of(scene: Scene) -> StationaryState:
    terms = model_terms(scene, "stationary_state")
    model = build_model("stationary_state", Setup(scene, terms, "accurate", None, 0, 1))
    assert isinstance(model, StationaryState)
    return model


def run(model: StationaryState, until: float) -> None:
    while model.time < until:
        model.advance(until)


def converged(scene: Scene) -> StationaryState:
    model = model_of(scene)
    run(model, 1.0)
    return model


def density_of(model: StationaryState) -> Floats:
    return np.asarray(model.snapshot()["density"], np.float64)


def direct_potential(density: Floats, h: float, shape: PotentialShape, strength: float) -> Floats:
    """U * q as the sum over every pair of cells."""
    angles = density.shape[0]
    theta = 2.0 * np.pi / angles * np.arange(angles)
    potential = np.zeros(density.shape)
    for a, j, i in np.ndindex(density.shape):
        for b, jj, ii in np.ndindex(density.shape):
            axes = (
                np.cos(2 * theta[a]),
                np.sin(2 * theta[a]),
                np.cos(2 * theta[b]),
                np.sin(2 * theta[b]),
            )
            value = pair_potential((ii - i) * h, (jj - j) * h, *axes, shape)[0]
            potential[a, j, i] += value * density[b, jj, ii]
    return np.asarray(strength * h * h * 2.0 * np.pi / angles * potential)


@pytest.mark.parametrize("angles", [1, 3, 4])
@pytest.mark.parametrize("width", [0.5, 1.0])
def test_potential_is_the_direct_sum(angles: int, width: float) -> None:
    # Transforms of exact samples: rounding. An odd number of angles cannot be folded.
    shape = potential_shape(1.0, width)
    density = np.random.default_rng(3).random((angles, 5, 7))
    interaction = AngleGridInteraction((angles, 5, 7), 0.9, shape, 2.0, "potential")
    found = interaction.potential(density)
    exact = direct_potential(density, 0.9, shape, 2.0)[: len(found)]
    assert np.abs(found - exact).max() < 1e-13 * np.abs(exact).max()


def test_residual_and_symmetry() -> None:
    # The scene as it stands: an exact symmetry of the equation is one of its solution; the FFT
    # keeps it to rounding, 1e-15 of a density of at most 0.1.
    model = converged(load_scene("stationary"))
    assert model.counts()["residual"] < 1e-12
    assert model.counts()["steps"] < 50
    density = density_of(model)
    assert np.abs(density - density[:, ::-1, ::-1]).max() < 1e-14
    # theta -> pi - theta keeps V2; together with x -> -x it is the mirror image.
    mirrored = density[(4 - np.arange(8)) % 8, :, ::-1]
    assert np.abs(density - mirrored).max() < 1e-14
    assert model.counts()["mass_end"] == pytest.approx(1.0, abs=1e-13)


def test_solution_satisfies_the_equation_written_out() -> None:
    # Independent of the model's own arithmetic, on a grid small enough for the direct sum.
    scene = scene_with(
        domain={"x": (-3.0, 3.0), "y": (-3.0, 3.0), "boundary": "open"},
        start={"x": (1.0, 2.0), "y": (1.0, 2.0)},
        numerics={"cell": 1.0, "angle_cells": 4},
        interaction={"strength": 5.0},
    )
    density = density_of(converged(scene))
    potential = direct_potential(density, 1.0, potential_shape(1.0, 0.5), 5.0)
    place = np.arange(6) - 2.5
    outer = 0.5 * (place[:, None] ** 2 + place**2) + np.array([0.0, 1.0, 0.0, -1.0])[:, None, None]
    weight = np.exp(-outer - potential)
    assert np.abs(density - weight / (weight.sum() * 0.5 * np.pi)).max() < 1e-12


def test_constant_in_closed_form_without_interaction() -> None:
    # Z = (2 pi erf(6/sqrt 2)^2) (2 pi I0(1)). The midpoint rule converges exponentially: on the
    # angle's 16 cells to rounding, in space to the Gaussian's value at the domain's edge, 1e-8.
    model = converged(scene_with(interaction=None, numerics={"cell": 0.2, "angle_cells": 16}))
    exact = 2.0 * np.pi * math.erf(6.0 / math.sqrt(2.0)) ** 2 * 2.0 * np.pi * i0(1.0)
    assert model.counts()["normalising_constant"] == pytest.approx(exact, rel=1e-8)
    assert model.counts()["steps"] <= 2


def test_repulsion_widens_and_strong_interaction_converges() -> None:
    widths = []
    for strength in (0.01, 1.0, 100.0):
        model = converged(scene_with(interaction={"strength": strength}))
        assert model.counts()["residual"] < 1e-12
        density = density_of(model).sum(axis=0)
        widths.append((density * model.grid.x**2).sum() / density.sum())
    assert widths[0] == pytest.approx(1.0, rel=1e-2)
    assert widths[0] < widths[1] < widths[2]


def test_however_strong_the_interaction_is() -> None:
    """A patterned minimum among many: the equation holds to what 4e4 U rounds to (1e-15 of it)."""
    model = model_of(
        scene_with(interaction={"strength": 1e6}, numerics={"cell": 1.0, "angle_cells": 4})
    )
    run(model, 1.0)
    assert model.counts()["residual"] < 1e-10
    assert model.counts()["mass_end"] == pytest.approx(1.0, abs=1e-12)


def test_failure_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ellipsoid_coupling.models.stationary._MOST_STEPS", 10)
    model = model_of(
        scene_with(interaction={"strength": 1e6}, numerics={"cell": 1.0, "angle_cells": 4})
    )
    with pytest.raises(RunError, match="Weaken the interaction"):
        run(model, 1.0)


def test_circles_have_one_angle() -> None:
    # Nothing turns a circle: the angle is not resolved, and q is rho/(2 pi).
    particles = load_scene("stationary").particles.model_dump() | {"width": 1.0}
    noise = {"noise": 1.0, "angular_noise": 0.0}
    model = converged(scene_with(particles=particles, angular_potential=None, noise=noise))
    assert density_of(model).shape == (1, 60, 60)
    assert model.counts()["mass_end"] == pytest.approx(1.0, abs=1e-13)


def test_result_is_the_same_at_every_time_and_restart_is_exact() -> None:
    scene = scene_with(times=(1.0, 3.0), numerics={"cell": 0.5, "angle_cells": 8})
    result = simulate(scene, "stationary_state")
    density = result.variables["density"]
    assert density.shape == (2, 8, 24, 24)
    assert np.array_equal(density[0], density[1])
    assert result.attributes["residual"] < 1e-12
    first, second = converged(scene), model_of(scene)
    second.restore(first.state())
    second.advance(3.0)
    assert np.array_equal(density_of(second), density_of(first))


@pytest.mark.parametrize(
    ("scene", "found"),
    [
        (load_scene("top_bottom"), "a fluid"),
        (scene_with(outer_potential=None), "no \\[outer_potential\\]"),
        (scene_with(particles={"length": 1.0, "width": 0.5, "number": 9, "mass": 2.0}), "differ"),
    ],
)
def test_scenes_without_one_are_refused(scene: Scene, found: str) -> None:
    with pytest.raises(InputError, match=found):
        model_of(scene)
