"""
The cavity in five lines
========================

The driven cavity, as the package ships it: particles start in a box in the middle, the lid moves to
the right. The densities of the rho-equation stand in columns, a column a saved time.
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.output.figures import density_rows, draw_density

scene = ec.load_scene("cavity_free", {"numerics.cell": 0.02, "flow.cells": 32})
result = ec.simulate(scene, model="rho_mono_kinetic")
draw_density(density_rows([result]), Path("density.png"), title="Driven cavity")
