"""
Which model, at which resolution?
=================================

What an error costs: `run_frontier` runs the models of a scene from coarse to fine and holds each
result against the exact solution, or against the refined limit of many particles where there is
none. On the command line it is ``ellipsoid compare SCENE``, which also tells what the errors are
made of.
"""

from pathlib import Path

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import run_frontier
from ellipsoid_coupling.output.figures import draw_frontier
from ellipsoid_coupling.simulation import scene_flow

settings = {
    "times": [1.0, 2.0],
    "flow.cells": 32,
    "particles.number": 200,
    "particles.realisations": 16,
    "numerics.cell": 0.05,
}
scene = ec.load_scene("cavity_free", settings)
flow = scene_flow(scene)

# %%
# No run here may take more than a fifth of a second: longer ones would reach smaller errors.

models = ["microscopic", "mckean_vlasov", "rho_mono_kinetic"]
frontier = run_frontier(scene, flow, models=models, longest=0.2)
rows = [row for row in frontier.rows if row.status == "completed"]
draw_frontier(rows, Path("frontier.png"), title="Cavity without interaction")
