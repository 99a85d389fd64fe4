"""
Stiff drag
==========

The larger the drag, the more closely particles follow the fluid. An explicit step must then be
shorter than 2/drag. The scheme `accurate` integrates drag exactly: its number of steps follows the
way of the particles, and stops growing once that is the fluid's.
"""

import matplotlib.pyplot as plt
import numpy as np

import ellipsoid_coupling as ec

settings = {
    "interaction": None,
    "particles.number": 100,
    "particles.realisations": 1,
    "times": [1.0],
}
drags = 10.0 ** np.arange(0, 7)
steps = []
for drag in drags:
    stiff = {"flow.drag": float(drag), "flow.angular_drag": float(drag)}
    result = ec.simulate(ec.load_scene("rotation", settings | stiff), model="microscopic")
    steps.append(result.attributes["steps"])

# %%
# Steps of `accurate`, and what an explicit scheme would need at least to stay bounded:

_, axes = plt.subplots(layout="constrained")
axes.loglog(drags, steps, "o-", label="accurate")
axes.loglog(drags, drags / 2.0, color="0.5", linestyle="--", label="explicit: drag x time / 2")
axes.set(xlabel="drag", ylabel="steps to t = 1")
axes.legend()
plt.show()

# %%
# The paper's leapfrog at its step of 0.01 says so, in one message:

stiff = {"flow.drag": 1e4, "flow.angular_drag": 1e4}
try:
    ec.simulate(ec.load_scene("rotation", settings | stiff), model="microscopic", scheme="paper")
except ec.RunError as error:
    print(error)
