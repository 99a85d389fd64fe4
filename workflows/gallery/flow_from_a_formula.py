"""
A flow from a formula
=====================

A function of (x, y) that returns (u_x, u_y), or a stream function psi with u = (d psi/dy, -d psi/dx),
makes a plane flow. `FlowField.from_function` samples it; a velocity with divergence is refused.
"""

from pathlib import Path

import numpy as np

import ellipsoid_coupling as ec
from ellipsoid_coupling.output.figures import draw_ellipses

SQUARE = ((0.0, 1.0), (0.0, 1.0))


def vortices(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Taylor and Green's vortices, two along each side."""
    k = 2.0 * np.pi
    return 0.5 * np.sin(k * x) * np.cos(k * y), -0.5 * np.cos(k * x) * np.sin(k * y)


flow = ec.FlowField.from_function(vortices, domain=SQUARE, cells=100, origin="vortices")
flow.plot(path="flow.png")
print(flow)

# %%
# The scene says that its flow is given, and how strongly the fluid drags.

scene = ec.load_scene(
    {
        "name": "vortices",
        "times": [0.0625, 1.0, 3.0],
        "domain": {"x": SQUARE[0], "y": SQUARE[1], "boundary": "reflecting"},
        "particles": {"length": 0.04, "width": 0.01, "inertia": 1e-4, "number": 200},
        "start": {"x": [0.0, 1.0], "y": [0.0, 1.0]},
        "flow": {"source": "given", "drag": 5.0, "angular_drag": 20.0},
        "numerics": {"cell": 0.05},
    }
)

# %%
# Inertia throws particles out of the vortices; they gather along the lines between them.

result = ec.simulate(scene, model="microscopic", flow=flow)
draw_ellipses(result, Path("ellipses.png"), flow=flow)
print(result.order_parameter())

# %%
# Velocities on a grid, of a measurement or of another program, go the same way; the axis order is (y, x).

x, y = np.linspace(0.0, 1.0, 65), np.linspace(0.0, 1.0, 65)
measured = ec.FlowField.from_velocity(*vortices(*np.meshgrid(x, y)), x, y, origin="65 x 65 nodes")
print(measured)
