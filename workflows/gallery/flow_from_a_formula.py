"""
A flow from a formula
=====================

A stream function psi(x, y) makes a plane flow without divergence, u = (d psi/dy, -d psi/dx).
Registered under a name, it is one that scenes may ask for, with parameters of its own.
"""

from pathlib import Path

import numpy as np

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import register_flow
from ellipsoid_coupling.output.figures import draw_ellipses, draw_flow
from ellipsoid_coupling.simulation import scene_flow


def vortices(x: np.ndarray, y: np.ndarray, speed: float, number: float = 2.0) -> np.ndarray:
    """Taylor and Green's vortices, `number` along each side."""
    k = np.pi * number
    return speed / k * np.sin(k * x) * np.sin(k * y)


register_flow("gallery_vortices", vortices)

# %%
# The flow alone:

scene = ec.load_scene(
    {
        "name": "vortices",
        "times": [0.0625, 1.0, 3.0],
        "domain": {"x": [0.0, 1.0], "y": [0.0, 1.0], "boundary": "reflecting"},
        "particles": {"length": 0.04, "width": 0.01, "inertia": 1e-4, "number": 200},
        "start": {"x": [0.0, 1.0], "y": [0.0, 1.0]},
        "flow": {
            "source": "closed_form",
            "field": "gallery_vortices",
            "parameters": {"speed": 0.5},
            "drag": 5.0,
            "angular_drag": 20.0,
        },
        "numerics": {"cell": 0.05},
    }
)
flow = scene_flow(scene)
assert flow is not None  # the scene has a [flow]
draw_flow(flow, flow.bounds, Path("flow.png"), title=flow.origin)

# %%
# Inertia throws particles out of the vortices; they gather along the lines between them.

result = ec.simulate(scene, model="microscopic")
draw_ellipses(result, Path("ellipses.png"), flow=flow)
