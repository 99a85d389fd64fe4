"""
A sweep
=======

Many runs of one scene over lists of values come back as one data set, which xarray cuts and averages.
On the command line it is ``ellipsoid sweep SCENE --set key=a,b,c --seeds 0:4``.

Here: how fast particles are in the fluid of a rigid rotation, against their drag. At a weak drag they
have not come up to its speed yet; at a moderate one inertia has thrown them outwards, where it is
faster.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import ellipsoid_coupling as ec

settings = {
    "interaction": None,
    "times": [1.0, 2.0],
    "particles.number": 50,
    "particles.realisations": 1,
}
drags = [1.0, 3.0, 10.0, 30.0]
data = ec.sweep(
    ec.load_scene("rotation", settings),
    {"flow.drag": drags},
    models=["microscopic"],
    seeds=range(3),
    workers=1,
    out=Path(tempfile.mkdtemp()) / "sweep",
)
print(data)

# %%
# One line: the mean over seeds, and how they spread.

speed = data["rms_speed"].isel(time=-1).squeeze("model")
_, axes = plt.subplots(layout="constrained")
axes.errorbar(drags, speed.mean("seed"), yerr=speed.std("seed"), fmt="o-", capsize=3.0)
axes.set(xscale="log", xlabel="drag", ylabel="rms speed at t = 2")
plt.show()
