"""
Closures against the limit
==========================

Every equation on a grid closes the moments of the same limit of infinitely many particles, which
`mckean_vlasov` samples. In the stationary scene, noise drives the cloud to an equilibrium of
velocities with variance 1. The Maxwellian closure has that variance built in, the mono-kinetic one
has none.
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import errors_against
from ellipsoid_coupling.output.figures import density_rows, draw_density

settings = {
    "times": [1.0, 2.5, 5.0],
    "interaction": None,
    "particles.number": 1000,
    "particles.realisations": 20,
    "numerics.cell": 0.4,
    "numerics.tolerance": 1e-2,
}
scene = ec.load_scene("stationary", settings)
limit = ec.simulate(scene, model="mckean_vlasov")
closures = [ec.simulate(scene, model=name) for name in ("q_maxwellian", "q_mono_kinetic")]

# %%
# L1 distances of the densities to that of the samples, at the saved times; 2 is no overlap. The cloud
# starts at rest, so that the mono-kinetic closure is the nearer one at first, and never again.

for closure in closures:
    print(f"{closure.model:15}", errors_against(closure, limit).density.round(2))

# %%
rows = density_rows([limit, *closures], cells=30, histograms=False)
draw_density(rows, Path("density.png"), title="Limit and closures")
