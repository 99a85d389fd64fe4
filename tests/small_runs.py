"""Every model with both schemes on few particles and cells, for tests that compare runs of processes.

python -m tests.small_runs FILE     keeps all variables, called "run variable", in an .npz file
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
# The same with a fluid and walls instead of noise, which the Maxwellian closure needs. A test that needs
# some terms, whichever they are, takes the scene "stationary" with these or as it is: kernels are compiled
# for the terms that a scene has, and the suite has compiled these first (tests/test_same_bits.py).
WALLS: dict[str, Any] = {
    "noise": None,
    "domain.boundary": "reflecting",
    "walls": {},
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


def small_runs(models: Iterable[str]) -> Iterator[tuple[str, ec.Result]]:
    """Each run's name, (model, scheme, with or without walls), and its result."""
    for model in models:
        for scheme in SCHEMES:
            for part, settings in (("trap", {}), ("walls", WALLS)):
                if (model, part) != ("q_maxwellian", "walls"):
                    scene = ec.load_scene("stationary", _SMALL | settings)
                    yield f"{model} {scheme} {part}", ec.simulate(scene, model, scheme, seed=1)


def small_variables() -> dict[str, np.ndarray[Any, np.dtype[Any]]]:
    """All variables of all runs, called "run variable"."""
    return {
        f"{run} {name}": values
        for run, result in small_runs(MODELS)
        for name, values in result.variables.items()
    }


if __name__ == "__main__":
    # Kernels divide by zero where the result is not used.
    with np.errstate(all="ignore"):
        np.savez(sys.argv[1], **small_variables())  # type: ignore[arg-type]
