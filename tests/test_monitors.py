"""What the monitors stop, in words that name the place and the term; what they let pass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.models import Model, Setup, build_model
from ellipsoid_coupling.monitors import Monitors
from ellipsoid_coupling.scenes import terms_of
from ellipsoid_coupling.schemes.grid import interior
from ellipsoid_coupling.simulation import scene_flow

Floats = NDArray[np.float64]

SMALL: dict[str, Any] = {
    "particles.number": 20,
    "numerics.cell": 0.1,
    "numerics.angle_cells": 6,
    "times": [0.2],
}
GRIDS = ["rho_mono_kinetic", "q_mono_kinetic", "q_maxwellian", "diffusive"]
MODELS = ["microscopic", "mckean_vlasov", *GRIDS]


def started(name: str, scheme: Any = "accurate", **changes: Any) -> tuple[Monitors, Model]:
    """A model two calls after its start, and the watch over it."""
    scene = ec.load_scene("rotation", SMALL | changes)
    flow = scene_flow(scene)
    setup = Setup(scene, terms_of(scene, name), scheme, flow, 0, 2)
    model = build_model(name, setup)
    monitors = Monitors(name, setup, model)
    for _ in range(2):
        model.advance(0.2)
        monitors.look(model)
    return monitors, model


def stores(model: Any) -> Any:
    """The conserved fields of a grid model, without the ghost planes of the angle."""
    return model.fields if hasattr(model, "fields") else model.system.fields[:, 2:-2]


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@pytest.mark.parametrize("name", MODELS)
def test_sound_runs_pass_and_know_their_strongest_term(name: str, scheme: Any) -> None:
    _, model = started(name, scheme)
    spot = model.spot()
    assert all(np.isfinite(value) for value in (*spot.place, *spot.terms.values()))
    assert "The strongest term is" in str(spot)
    health = model.health()
    assert health.mass == pytest.approx(model.counts()["mass_end"], rel=1e-12)
    assert health.least_density >= 0.0


@pytest.mark.parametrize("name", GRIDS)
def test_nan_negative_density_and_mass_are_seen(name: str) -> None:
    """Each put into one cell by hand."""
    for value, told in ((np.nan, "no longer finite"), (-1e-3, "a density of"), (1e3, "mass has")):
        monitors, model = started(name)
        cell = interior(stores(model))[0]
        cell[np.unravel_index(int(cell.argmax()), cell.shape)] = value
        with pytest.raises(RunError, match=told) as caught:
            monitors.look(model)
        assert "rotation, " in str(caught.value)


@pytest.mark.parametrize("name", ["microscopic", "mckean_vlasov"])
def test_energy_that_no_force_gave_is_seen(name: str) -> None:
    """Speeds a hundred times what the fluid drives; a third more than it gave pass."""
    monitors, model = started(name)
    velocity: Floats = np.asarray(model.state()["velocity"], np.float64)
    velocity *= 1.3
    monitors.look(model)
    velocity += 100.0
    with pytest.raises(RunError, match=r"beyond what forces of .* The strongest term is .* at"):
        monitors.look(model)


def test_an_unstable_leapfrog_is_stopped_early() -> None:
    """Dt Gamma = 4 doubles the speed in two steps: stopped long before it overflows."""
    scene = ec.load_scene("rotation", SMALL | {"flow.drag": 400.0, "times": [100.0]})
    with pytest.raises(RunError, match=r"t = 0\.\d+: a root mean square speed"):
        ec.simulate(scene, "microscopic", "paper")


def test_strong_noise_is_no_alarm() -> None:
    """Equilibrium speeds have variance 1 whatever A is; ten standard deviations are allowed."""
    noise = {"noise.noise": 30.0, "noise.angular_noise": 30.0, "interaction": None}
    changes = SMALL | noise | {"numerics.time_step": 1e-4}
    ec.simulate(ec.load_scene("rotation", changes), "microscopic", "paper")
    ec.simulate(ec.load_scene("rotation", changes), "microscopic", "accurate")


def test_the_fluids_pull_is_named() -> None:
    """Without interaction nothing but the fluid pulls: gamma |u| at the outermost particle.

    The force is that of the step's prediction, a tolerance (1e-4) beside the place.
    """
    _, model = started("microscopic", interaction=None)
    spot = model.spot()
    assert spot.terms["interaction and walls"] == pytest.approx(0.0, abs=1e-3)
    drag = ec.load_scene("rotation").flow
    assert drag is not None
    assert spot.terms["the fluid"] == pytest.approx(
        drag.drag * np.hypot(spot.place[0], spot.place[1]), rel=1e-3
    )
