r"""
Noise against order
===================

An outer field turns main axes along x, V2 = -a cos^2(theta); noise of strength B turns them away.
How much order is left tells S = \|<exp(2 i theta)>\|: 1 where all axes are parallel, 0 where none
is preferred.

Without interaction the angles' equilibrium is known. Velocities have variance 1 under the noise's
own damping, so the density of theta is exp(a cos^2(theta))/Z, whatever B is; B decides how fast it
is reached.
"""

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

import ellipsoid_coupling as ec

table = {
    "name": "noise_and_order",
    "times": list(np.arange(0.5, 15.1, 0.5)),
    "domain": {"x": [-6.0, 6.0], "y": [-6.0, 6.0], "boundary": "open"},
    "particles": {"length": 0.2, "width": 0.1, "number": 500, "realisations": 8},
    "start": {"x": [-1.0, 1.0], "y": [-1.0, 1.0], "angle": np.pi / 2},
    "angular_potential": {"kind": "axis", "amplitude": 2.0},
    "noise": {"noise": 1.0, "angular_noise": 1.0},
    "numerics": {"cell": 0.2, "tolerance": 1e-2},
}


def order(result: ec.Result) -> NDArray[np.float64]:
    """S at every saved time."""
    turned = np.exp(2j * result.variables["angle"])
    return np.asarray(np.abs(turned.mean(axis=(1, 2))))


theta = np.linspace(0.0, np.pi, 400, endpoint=False)
weight = np.exp(2.0 * np.cos(theta) ** 2)
expected = float((weight * np.cos(2.0 * theta)).sum() / weight.sum())

# %%
# All start across the field, where it does not turn them: order falls before the field can bring it
# back.

_, axes = plt.subplots(layout="constrained")
for strength in (0.5, 1.0, 2.0):
    scene = ec.load_scene(table, {"noise.angular_noise": strength})
    run = ec.simulate(scene, model="microscopic")
    axes.plot(run.times, order(run), label=f"B = {strength:g}")
axes.axhline(expected, color="0.4", linestyle="--", label="equilibrium")
axes.set(xlabel="time", ylabel="S", ylim=(0.0, 1.0))
axes.legend()
plt.show()
