r"""
The order of axes
=================

Ellipses have neither head nor tail: theta and theta + pi are one axis. How parallel axes are tells
S = \|<exp(2 i theta)>\|, 1 where all are and 0 where none is preferred; half the argument of that mean
is the mean axis. Both are there for every model, over the domain and over time.

In the rotating flow 200 ellipses push each other as they come near, and their order is lost. The
rho-equation has infinitely many of them, and one angle a cell: it keeps most of the order.
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.output.figures import (
    axis_rows,
    draw_angles,
    draw_directors,
    draw_order,
)

settings = {
    "times": [0.5, 1.0, 2.0],
    "particles.number": 200,
    "particles.realisations": 8,
    "numerics.cell": 0.1,
    "numerics.tolerance": 1e-2,
}
scene = ec.load_scene("rotation", settings)
results = [ec.simulate(scene, model=name) for name in ("microscopic", "rho_mono_kinetic")]
draw_order(results, Path("order.png"), title="Rotation with interaction")

# %%
# Where it is lost: lines along the mean axis of their bin, as long as S, over the density.

draw_directors(axis_rows(results), Path("directors.png"))

# %%
# And as colours of the mean axis, the fainter the less there is:

draw_directors(axis_rows(results), Path("axes.png"), kind="colours")

# %%
# The distributions of the angle stand on half a turn for the same reason. An angular potential that
# tells heads from tails, such as V2 = a sin(theta), would give the whole turn.

draw_angles(results, Path("angles.png"))
