"""
Ellipses in a vortex street
===========================

A flow may change in time. Behind a cylinder at Re = 100 vortices leave on either side in turn; the
case has some times of one period, which goes on and on. Here it is a coarse one of the test data; the
scene's own, `foam_cases/vortex_street`, takes OpenFOAM half a minute (``ellipsoid flow
vortex_street``).
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import Wanted
from ellipsoid_coupling.output.figures import draw_ellipses
from ellipsoid_coupling.simulation import scene_flow

settings = {
    "particles.length": 0.3,
    "particles.width": 0.1,
    "particles.number": 200,
    "particles.realisations": 1,
    "start.y": [-1.5, 1.5],
    "times": [4.0, 8.0],
}
scene = ec.load_scene("vortex_street", settings)
case = Path(ec.__file__).parents[1] / "tests" / "data" / "vortex_street_8"
flow = scene_flow(scene, Wanted(case, allow_misfit=True))

# %%
# The colour is that of the axis: ellipses have neither head nor tail, so it repeats after half a turn.

result = ec.simulate(scene, model="microscopic", flow=flow)
extent = (-3.0, 11.0, -2.5, 2.5)
draw_ellipses(result, Path("ellipses.png"), flow=flow, title="Vortex street", extent=extent)
