"""`ellipsoid plan` says of the interaction what a run does with it."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.cell_forces import MeanAngleForces
from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.rho_grid import HarmonicInteraction
from ellipsoid_coupling.models import Setup, build_model, model_names, model_terms, plan_terms
from ellipsoid_coupling.scenes import Scene, builtin_scenes, load_scene

Settings = dict[str, object]
COARSE: Settings = {"numerics.harmonics_tolerance": 1e-1}
FINE: Settings = {"numerics.harmonics_tolerance": 1e-5}
DIRECT: Settings = {"numerics.interaction": "direct"}
HARMONICS: Settings = {"numerics.interaction": "harmonics"}
COARSE_CELLS: Settings = {"numerics.cell": 0.1, "numerics.angle_cells": 8}


def reason(scene: Scene, model: str, name: str = "interaction") -> str:
    return next(term.why for term in plan_terms(scene, model) if term.name == name)


@pytest.mark.parametrize(
    ("model", "settings", "words"),
    [
        ("microscopic", {}, "pair by pair, to rounding"),
        ("rho_mono_kinetic", {}, "pair by pair of cells"),
        ("rho_mono_kinetic", HARMONICS, "within 0.02 of its largest value"),
        ("rho_mono_kinetic", HARMONICS, "single precision"),
        ("q_mono_kinetic", {}, "within 0.02 of its largest value, single precision"),
        ("q_mono_kinetic", FINE, "double precision"),
        ("q_mono_kinetic", DIRECT, "to rounding"),
        ("q_maxwellian", {}, "to rounding"),
        ("mckean_vlasov", {}, "force and torque within 0.02 of the largest"),
        ("mckean_vlasov", {}, "single precision"),
        ("mckean_vlasov", FINE, "pair by pair of samples"),
        ("mckean_vlasov", DIRECT, "to rounding"),
    ],
)
def test_plan_says_how_the_interaction_is_summed(
    model: str, settings: Settings, words: str
) -> None:
    """With "auto" on a coarse grid and for a fine tolerance, pairs are less work than harmonics."""
    assert words in reason(load_scene("top_bottom", settings), model)


@pytest.mark.parametrize("settings", [COARSE, FINE, DIRECT], ids=["coarse", "fine", "direct"])
@pytest.mark.parametrize("name", ["top_bottom", "rotation"])
def test_plan_and_run_make_the_same_choice(name: str, settings: Settings) -> None:
    """The words against the objects that the built models hold."""
    scene = load_scene(name, settings | {"particles.realisations": 2})
    flow = analytic_flow(name)

    def built(model: str, holder: str) -> object:
        """What the attribute `holder` of the built model holds."""
        setup = Setup(scene, model_terms(scene, model), "accurate", flow, 0, 2)
        return vars(build_model(model, setup))[holder]

    forces, plan = built("rho_mono_kinetic", "_forces"), reason(scene, "rho_mono_kinetic")
    assert isinstance(forces, MeanAngleForces)
    rho = forces.interaction
    assert ("harmonics" in plan) == isinstance(rho, HarmonicInteraction)
    if isinstance(rho, HarmonicInteraction):
        assert f"{rho.series.harmonics} harmonics" in plan
        assert ("single" in plan) == (rho.precision is np.float32)
    samples, plan = built("mckean_vlasov", "_interaction"), reason(scene, "mckean_vlasov")
    assert ("pair by pair" in plan) == isinstance(samples, SamplePairs)


def test_every_model_has_a_plan_of_every_scene() -> None:
    for name in builtin_scenes():
        scene = load_scene(name, COARSE_CELLS)
        for model in model_names():
            assert all(term.why for term in plan_terms(scene, model))


def test_noise_only_damps_in_closures() -> None:
    scene = load_scene("stationary")
    assert "damping A^2/2 only" in reason(scene, "rho_mono_kinetic", "noise")
    assert model_terms(scene, "microscopic").noise
    assert not model_terms(scene, "q_maxwellian").noise


def test_plan_refuses_what_a_run_would_refuse() -> None:
    """Harmonics that no memory holds: the run's own message, before anything is computed."""
    scene = load_scene("top_bottom", FINE | HARMONICS)
    with pytest.raises(InputError, match="harmonics"):
        plan_terms(scene, "mckean_vlasov")
