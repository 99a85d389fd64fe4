"""
Walls with ghosts
=================

A wall that reflects lets particles lie against it. Ghost particles on the wall push them off: they
have the pair potential of a particle, some times stronger. Here a cloud spreads over the floor by its
own repulsion, and a shear flow carries it against the right wall.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import ellipsoid_coupling as ec
from ellipsoid_coupling.output.figures import draw_ellipses

cloud = {
    "name": "walls",
    "times": [0.5, 3.0],
    "domain": {"x": [0.0, 1.0], "y": [0.0, 1.0], "boundary": "reflecting"},
    "particles": {"length": 0.06, "width": 0.03, "inertia": 0.001, "number": 200},
    "start": {"x": [0.3, 0.7], "y": [0.05, 0.3]},
    "flow": {"source": "closed_form", "field": "shear", "drag": 2.0, "angular_drag": 2.0},
    "interaction": {"strength": 1.0},
    "numerics": {"cell": 0.02, "tolerance": 1e-3},
}
bare = ec.simulate(ec.load_scene(cloud), model="microscopic")
scene = ec.load_scene(cloud, {"walls": {"sides": ["bottom", "right"], "strength_factor": 10.0}})
guarded = ec.simulate(scene, model="microscopic")

# %%
# With ghosts on the floor and on the right:

draw_ellipses(guarded, Path("ellipses.png"), title="Ghosts below and on the right")

# %%
# How many particles are how near to the floor at the end:

edges = np.linspace(0.0, 0.2, 21)
_, axes = plt.subplots(layout="constrained")
for result, label in ((bare, "reflection alone"), (guarded, "with ghosts")):
    axes.stairs(np.histogram(result.variables["y"][-1], edges)[0], edges, label=label)
axes.set(xlabel="distance to the floor", ylabel="particles")
axes.legend()
plt.show()
