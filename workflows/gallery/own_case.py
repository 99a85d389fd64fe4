"""
Your own OpenFOAM case
======================

Any solved plane case is a flow: name its folder. Here it is a small L-shaped room of the test data,
which icoFoam has solved; nothing of OpenFOAM is needed to read it.
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import flow_at
from ellipsoid_coupling.output.figures import draw_ellipses, draw_flow

case = Path(ec.__file__).parents[1] / "tests" / "data" / "l_shape"
flow = flow_at(case)
print(flow.origin)
print("x_low, x_high, y_low, y_high:", flow.bounds)

# %%
# The picture shows what the package has made of it: a spline of the stream function.

x_low, x_high, y_low, y_high = flow.bounds
draw_flow(flow, flow.bounds, Path("flow.png"), title="An L-shaped room")

# %%
# A scene is a table, or a TOML file with the same sections. Numbers of the flow's section that name
# a case of foam_cases/ are not used when a flow is given.

scene = ec.load_scene(
    {
        "name": "l_shape",
        "times": [1.0, 4.0],
        "domain": {"x": [x_low, x_high], "y": [y_low, y_high], "boundary": "open"},
        "particles": {"length": 0.06, "width": 0.02, "inertia": 1e-4, "number": 60},
        "start": {"x": [0.2, 0.45], "y": [0.2, 0.8]},
        "flow": {"source": "openfoam", "field": "cavity", "drag": 20.0, "angular_drag": 20.0},
        "numerics": {"cell": 0.02},
    }
)
result = ec.simulate(scene, model="microscopic", flow=flow)
draw_ellipses(result, Path("ellipses.png"), flow=flow, title="Ellipses to scale")
