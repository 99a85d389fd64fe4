"""What the monitors cost: under 2 % of a run, measured call by call."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.models import Setup, build_model, model_terms
from ellipsoid_coupling.monitors import Monitors, Pace
from ellipsoid_coupling.simulation import scene_flow

MOST = 0.02
# The cheapest steps there are, on grids and ensembles from small ones to those of the paper.
FREE: dict[str, Any] = {"interaction": None}
RUNS: dict[str, tuple[str, dict[str, Any]]] = {
    "100 particles": ("microscopic", {"particles.number": 100, "particles.realisations": 1}),
    "128 x 1000 free particles": ("microscopic", FREE),
    "samples": ("mckean_vlasov", {"particles.realisations": 8}),
    "rho, 30 x 30, free": ("rho_mono_kinetic", FREE | {"numerics.cell": 0.1}),
    "rho, 150 x 150, free": ("rho_mono_kinetic", FREE),
    "q, 30 x 30 x 60, free": ("q_mono_kinetic", FREE | {"numerics.cell": 0.1}),
    "q, 30 x 30 x 60": ("q_mono_kinetic", {"numerics.cell": 0.1}),
    "q under pressure": ("q_maxwellian", {"numerics.cell": 0.1}),
    "diffusive, 60 x 60": ("diffusive", {"numerics.cell": 0.05}),
}


def part_of_a_run(name: str, scheme: Any, settings: dict[str, Any], seconds: float) -> float:
    """Median time of a look over median time of the call before it."""
    box = {"times": [1e3], "domain.boundary": "reflecting"}
    scene = ec.load_scene("rotation", settings | box)
    realisations = scene.particles.realisations
    setup = Setup(scene, model_terms(scene, name), scheme, scene_flow(scene), 0, realisations)
    model = build_model(name, setup)
    monitors, pace = Monitors(name, setup, model), Pace(1e3, 1e9)
    calls: list[float] = []
    looks: list[float] = []
    end = np.inf
    while time.perf_counter() < end and len(looks) < 300:
        begun = time.perf_counter()
        model.advance(1e3)
        called = time.perf_counter()
        monitors.look(model)
        pace.look(model, lambda: 0.0)
        looked = time.perf_counter()
        if not np.isfinite(end):  # the first call may have compiled
            end = looked + seconds
            continue
        calls.append(called - begun)
        looks.append(looked - called)
    return float(np.median(looks) / np.median(calls))


@pytest.mark.heavy
@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@pytest.mark.parametrize("run", RUNS)
def test_monitors_cost_less_than_two_per_cent(run: str, scheme: Any) -> None:
    name, settings = RUNS[run]
    part = part_of_a_run(name, scheme, settings, 2.0)
    told = f"{run}, {scheme}: {100.0 * part:.2f} %"
    print(told)
    assert part < MOST, told
