"""
An elbow with an inlet
======================

Patches of a case say where particles come in, where they leave and where they bounce. In this channel,
which turns left, the fluid carries particles in from the left at a density of 0.25, and they are gone
behind the outlet above.
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import Wanted
from ellipsoid_coupling.output.figures import axis_rows, draw_directors, draw_ellipses
from ellipsoid_coupling.simulation import scene_flow

settings = {
    "particles.length": 0.12,
    "particles.width": 0.04,
    "particles.number": 150,
    "particles.realisations": 1,
    "numerics.cell": 0.1,
    "times": [1.0, 4.0],
}
scene = ec.load_scene("elbow", settings)
case = Path(ec.__file__).parents[1] / "tests" / "data" / "elbow"
flow = scene_flow(scene, Wanted(case, allow_misfit=True))
result = ec.simulate(scene, model="microscopic", flow=flow)
draw_ellipses(result, Path("ellipses.png"), flow=flow, title="Elbow with an inlet")

# %%
# What has become of them, patch by patch:

print(result.attributes["fates"])

# %%
# The rho-equation in the same channel: mean axes over the density. Walls turn them along the fluid.

equation = ec.simulate(scene, model="rho_mono_kinetic", flow=flow)
draw_directors(axis_rows([equation], flow), Path("directors.png"), title="Elbow, mean axes")
