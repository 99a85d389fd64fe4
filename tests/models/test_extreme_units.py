"""Nothing depends on the unit of length, and grids may be as small as one cell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.scenes.files import scene_from_table

MODELS = ("microscopic", "mckean_vlasov", "rho_mono_kinetic", "q_mono_kinetic")
SCHEMES = ("paper", "accurate")


def scene(unit: float, cells: int = 8) -> ec.Scene:
    """Ellipses in both potentials and between walls; a length of 1 is `unit` long.

    The terms are those of `small_runs.WALLS`, for which kernels are there.
    """
    box = [-0.5 * unit, 0.5 * unit]
    start = [-0.25 * unit, 0.25 * unit]
    table: dict[str, Any] = {
        "name": "units",
        "times": [0.5],
        "domain": {"x": box, "y": box, "boundary": "reflecting"},
        "particles": {
            "length": 0.1 * unit,
            "width": 0.05 * unit,
            "inertia": 0.01 * unit * unit,
            "number": 16,
        },
        "start": {"x": start, "y": start, "angle": 0.3},
        "interaction": {"strength": unit * unit},
        "walls": {},
        "flow": {"source": "closed_form", "field": "rotation", "drag": 1.0, "angular_drag": 1.0},
        "outer_potential": {"stiffness": 4.0},
        "angular_potential": {"amplitude": 1.0},
        "numerics": {
            "cell": unit / cells,
            "angle_cells": 8,
            "interaction": "direct",
            "tolerance": 1e-3,
        },
    }
    return scene_from_table(table, "test")


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("unit", [2.0**150, 2.0**-150])
def test_the_unit_of_length_does_not_matter(model: str, scheme: Any, unit: float) -> None:
    """In units of 2^150 only exponents differ, densities of 1e-90 included: the same angles.

    To rounding (1e-12), not to the bit: the cells of the neighbour search and powers of sums are not
    exact in every unit.
    """
    one = ec.simulate(scene(1.0), model, scheme)
    other = ec.simulate(scene(unit), model, scheme)
    name = "density" if model == "q_mono_kinetic" else "mean_angle"
    name = "angle" if one.layout == "particles" else name
    scale = unit**2 if name == "density" else 1.0
    apart = np.abs(other.variables[name] * scale - one.variables[name]).max()
    assert apart <= 1e-12 * np.abs(one.variables[name]).max()
    assert other.attributes["steps"] == one.attributes["steps"]


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_mono_kinetic", "q_maxwellian"])
@pytest.mark.parametrize("cells", [1, 2, 3])
def test_a_box_of_a_few_cells_keeps_its_mass(model: str, scheme: Any, cells: int) -> None:
    """Whatever bounces between two walls a cell apart: mass 1 to rounding, no negative density."""
    result = ec.simulate(scene(1.0, cells), model, scheme)
    assert result.attributes["mass_end"] == pytest.approx(1.0, abs=1e-13)
    assert result.variables["density"].min() >= 0.0
