"""How to add a flow by its stream function, u = (d psi/dy, -d psi/dx). Three steps:

* a function psi(x, y, ...) of numpy arrays, whose further arguments are the flow's parameters;
* its registration under a name;
* a scene with ``[flow] source = "closed_form"``, that name as `field`, and numbers in [flow.parameters].

All models then have it: particles evaluate a spline of psi, cells tabulate that at their centres.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import register_flow

Floats = NDArray[np.float64]


def vortices(x: Floats, y: Floats, speed: float, number: float = 1.0) -> Floats:
    """Taylor and Green's vortices, `number` a side: psi = speed/k sin(k x) sin(k y), k = pi number."""
    k = math.pi * number
    return speed / k * np.sin(k * x) * np.sin(k * y)


register_flow("vortices", vortices)

SPEED, DRAG = 0.8, 3.0
# Circles, so that Jeffery's term is half the vorticity.
SCENE: dict[str, Any] = {
    "name": "vortices",
    "times": [1.0],
    "domain": {"x": [0.0, 1.0], "y": [0.0, 1.0], "boundary": "reflecting"},
    "particles": {"length": 0.02, "width": 0.02, "inertia": 0.001, "number": 1},
    "start": {"points": [[0.5, 0.5]]},
    "flow": {
        "source": "closed_form",
        "field": "vortices",
        "drag": DRAG,
        "angular_drag": DRAG,
        "parameters": {"speed": SPEED},
    },
    "numerics": {"cell": 0.05, "tolerance": 1e-7},
}


@pytest.mark.parametrize("cells", [20, 40])
def test_a_particle_turns_in_a_vortex_centre(cells: int) -> None:
    """At (1/2, 1/2) it stays, and omega' = gamma_bar (g - omega) with g = k speed.

    theta = g (t - (1 - e^{-gamma_bar t})/gamma_bar), to what the spline's second derivatives miss,
    (k h)^2/12 of g, a quarter with half the cells' size.
    """
    scene = ec.load_scene(SCENE, {"flow.cells": cells})
    result = ec.simulate(scene, model="microscopic")
    turned = math.pi * SPEED * (1.0 - (1.0 - math.exp(-DRAG)) / DRAG)
    assert result.variables["x"][-1, 0, 0] == pytest.approx(0.5, abs=1e-9)
    off = abs(result.variables["angle"][-1, 0, 0] / turned - 1.0)
    assert off == pytest.approx((math.pi / cells) ** 2 / 12.0, rel=0.1)


def test_cells_see_the_same_flow() -> None:
    """The start of a cloud at rest in a vortex: the rho-equation pushes it by gamma u t, to t^2."""
    box = {"x": [0.7, 0.8], "y": [0.45, 0.55]}
    scene = ec.load_scene(SCENE, {"start": box, "particles.number": 100, "times": [0.01]})
    result = ec.simulate(scene, model="rho_mono_kinetic")
    inner = result.variables["density"][-1] > 1.0
    x, y = np.meshgrid(result.coordinates["x"], result.coordinates["y"])
    gain = 1.0 - math.exp(-DRAG * 0.01)
    u_y = -SPEED * np.cos(math.pi * x) * np.sin(math.pi * y)
    found = result.variables["velocity_y"][-1]
    np.testing.assert_allclose(found[inner], (gain * u_y)[inner], atol=0.02 * gain * SPEED)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"flow.parameters": None}, r"expected speed, number, found no speed"),
        ({"flow.parameters.speeed": 1.0}, r"expected speed, number, found speeed, unknown"),
        ({"flow.field": "vortexes"}, r"one of top_bottom, .*vortices"),
        ({"flow.field": "shear"}, r"expected none, found speed, unknown"),
        ({"flow.parameters.speed": 1e200}, r"flow\.parameters\.speed"),
    ],
)
def test_mistakes_in_a_scene_are_refused_in_one_line(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(ec.InputError, match=told):
        ec.simulate(ec.load_scene(SCENE, settings), model="microscopic")


def test_a_name_that_is_taken_is_refused_in_one_line() -> None:
    for name in ("vortices", "shear"):
        with pytest.raises(ValueError, match=f"a flow {name} is registered already"):
            register_flow(name, vortices)
