"""
Your own OpenFOAM case
======================

Any solved plane case is a flow: name its folder. Here it is a small one of the test data, a channel
from left to right with a thin plate in its way, which icoFoam has solved. Nothing of OpenFOAM is
needed to read it.
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import flow_at
from ellipsoid_coupling.output.figures import draw_ellipses, draw_flow

case = Path(ec.__file__).parents[1] / "tests" / "data" / "thin_plate"
flow = flow_at(case)
print(flow.origin)
print("x_low, x_high, y_low, y_high:", flow.bounds)

# %%
# The picture shows what the package has made of it: a spline of the stream function.

x_low, x_high, y_low, y_high = flow.bounds
draw_flow(flow, flow.bounds, Path("flow.png"), title="A channel with a thin plate")

# %%
# A scene is a table, or a TOML file with the same sections. The flow that is given replaces the one
# that the scene names. Particles that reach a side leave, as `boundary` says.

scene = ec.load_scene(
    {
        "name": "thin_plate",
        "times": [0.1, 0.3, 0.5],
        "domain": {"x": [x_low, x_high], "y": [y_low, y_high], "boundary": "open"},
        "particles": {"length": 0.06, "width": 0.02, "inertia": 1e-4, "number": 60},
        "start": {"x": [0.05, 0.35], "y": [0.05, 0.95]},
        "flow": {"source": "openfoam", "field": "cavity", "drag": 20.0, "angular_drag": 20.0},
        "numerics": {"cell": 0.02},
    }
)
result = ec.simulate(scene, model="microscopic", flow=flow)
draw_ellipses(result, Path("ellipses.png"), flow=flow, title="Ellipses to scale")
