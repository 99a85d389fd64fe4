"""
A convergence study
===================

Without interaction each particle moves by itself, and the exact density is known. So the error of a
scheme can be measured: here of the rho-equation, with the paper's scheme (FORCE) and with `accurate`,
against the width h of the cells. The cloud has sharp edges, which no scheme follows better than by a
part of a cell: neither error falls like h^2, but one of them is ahead.
"""

import matplotlib.pyplot as plt
import numpy as np

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import errors_against, exact_reference
from ellipsoid_coupling.flow import analytic_flow

settings = {"interaction": None, "times": [0.75], "start.x": [-0.9, 0.9], "start.y": [-0.45, 0.45]}
scene = ec.load_scene("top_bottom", settings)
exact = exact_reference(scene, analytic_flow("top_bottom"))

# %%
# The distance is L1, of the masses in 20 x 20 bins: 2 where two densities do not overlap.

widths = np.array([0.15, 0.075, 0.0375])
_, axes = plt.subplots(layout="constrained")
for scheme in ("paper", "accurate"):
    errors = []
    for h in widths:
        finer = ec.load_scene("top_bottom", {**settings, "numerics.cell": float(h)})
        result = ec.simulate(finer, model="rho_mono_kinetic", scheme=scheme)
        errors.append(errors_against(result, exact).density[-1])
    axes.loglog(widths, errors, "o-", label=scheme)
    print(scheme, [f"{error:.4f}" for error in errors])
axes.loglog(widths, widths, color="0.6", linestyle=":", label="h")
axes.set(xlabel="h", ylabel="L1 error of the density")
axes.legend()
plt.show()
