r"""What the monitors cost, beside the call that they look after:

    pytest tests/benchmarks/test_monitors.py -m heavy --benchmark-enable \
        --benchmark-group-by=param:run,param:scheme

Each group has a call and the look after it; a look took less than 2 % of its call on two quiet cores.
Nothing passes or fails by that: a plain run checks that a look finds nothing wrong and changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.models import Model, Setup, build_model, model_terms
from ellipsoid_coupling.monitors import Monitors, Pace
from ellipsoid_coupling.simulation import scene_flow

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


def state(model: Model) -> dict[str, bytes]:
    """Every bit of it; bytes, as some numbers are NaN."""
    return {name: array.tobytes() for name, array in model.state().items()}


@pytest.mark.heavy
@pytest.mark.parametrize("part", ["call", "look"])
@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@pytest.mark.parametrize("run", RUNS)
def test_a_look_after_a_call(
    run: str, scheme: Any, part: str, benchmark: Callable[..., Any]
) -> None:
    name, settings = RUNS[run]
    box = {"times": [1e3], "domain.boundary": "reflecting"}
    scene = ec.load_scene("rotation", settings | box)
    realisations = scene.particles.realisations
    setup = Setup(scene, model_terms(scene, name), scheme, scene_flow(scene), 0, realisations)
    model = build_model(name, setup)
    monitors, pace = Monitors(name, setup, model), Pace(1e3, 1e9)

    def look() -> None:
        monitors.look(model)
        pace.look(model, lambda: 0.0)

    model.advance(1e3)  # the first call may compile
    look()
    before = state(model)
    if part == "look":
        benchmark(look)
        assert state(model) == before
    else:
        reached = float(np.max(model.time))
        benchmark(model.advance, 1e3)
        assert float(np.max(model.time)) > reached
