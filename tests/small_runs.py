"""Every model with both schemes on few particles and cells, for tests that compare runs of processes.

python -m tests.small_runs FILE [whole]   keeps all variables, called "run variable", in an .npz file
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

import ellipsoid_coupling as ec
from ellipsoid_coupling.models import SCHEMES

MODELS = (
    "microscopic",
    "mckean_vlasov",
    "q_maxwellian",
    "q_mono_kinetic",
    "rho_mono_kinetic",
    "diffusive",
)
# A trap with noise and interaction.
_SMALL: dict[str, Any] = {
    "particles.number": 30,
    "particles.realisations": 3,
    "numerics.cell": 1.0,
    "numerics.angle_cells": 6,
    "times": [0.2],
}
# A fluid instead of noise and potentials, in which all still interact.
_FLUID: dict[str, Any] = {
    "noise": None,
    "outer_potential": None,
    "angular_potential": None,
    "flow": {"source": "closed_form", "field": "rotation", "drag": 1.0, "angular_drag": 1.0},
}
# A fluid and walls instead of noise, which the Maxwellian closure needs. A test that needs some terms,
# whichever they are, takes the scene "stationary" with these or as it is: kernels are compiled for the
# terms that a scene has, and the suite has compiled these first (tests/test_same_bits.py).
WALLS: dict[str, Any] = {
    "domain.boundary": "reflecting",
    "walls": {},
    "noise": None,
    "flow": {"source": "closed_form", "field": "rotation", "drag": 1.0, "angular_drag": 1.0},
}
# All these terms without effect: no drag, next to no potential, walls out of reach.
IDLE: dict[str, Any] = WALLS | {
    "flow.drag": 0.0,
    "flow.angular_drag": 0.0,
    "outer_potential.stiffness": 1e-30,
    "angular_potential.amplitude": 1e-30,
    "domain.x": [-30.0, 30.0],
    "domain.y": [-30.0, 30.0],
}
_PARTS: dict[str, dict[str, Any]] = {"trap": {}, "fluid": _FLUID, "walls": WALLS}
# What is run unless the whole is asked for: each model and scheme in a part whose kernels other tests
# need as well, because compiling takes nearly all the time.
_FEW: dict[tuple[str, str], tuple[str, ...]] = {
    ("microscopic", "paper"): ("walls",),
    ("microscopic", "accurate"): ("trap", "walls"),
    ("mckean_vlasov", "paper"): ("fluid",),
    ("mckean_vlasov", "accurate"): ("walls",),
    ("q_maxwellian", "paper"): ("trap",),
    ("q_maxwellian", "accurate"): ("trap",),
    ("q_mono_kinetic", "paper"): ("trap",),
    ("q_mono_kinetic", "accurate"): ("walls",),
    ("rho_mono_kinetic", "paper"): ("walls",),
    ("rho_mono_kinetic", "accurate"): ("walls",),
    ("diffusive", "paper"): ("fluid",),
    ("diffusive", "accurate"): ("walls",),
}


def small_runs(models: Iterable[str], *, whole: bool = False) -> Iterator[tuple[str, ec.Result]]:
    """Each run's name, (model, scheme, part), and its result; `whole` : all parts of each."""
    for model in models:
        for scheme in SCHEMES:
            for part in _PARTS if whole else _FEW[model, scheme]:
                if part == "trap" or model != "q_maxwellian":
                    scene = ec.load_scene("stationary", _SMALL | _PARTS[part])
                    yield f"{model} {scheme} {part}", ec.simulate(scene, model, scheme, seed=1)


def small_variables(*, whole: bool = False) -> dict[str, np.ndarray[Any, np.dtype[Any]]]:
    """All variables of all runs, called "run variable"."""
    return {
        f"{run} {name}": values
        for run, result in small_runs(MODELS, whole=whole)
        for name, values in result.variables.items()
    }


if __name__ == "__main__":
    # Kernels divide by zero where the result is not used.
    with np.errstate(all="ignore"):
        np.savez(sys.argv[1], **small_variables(whole="whole" in sys.argv[2:]))  # type: ignore[arg-type]
