"""Figures as PNG files: one function a kind, all from `Result`s or plain arrays."""

from ellipsoid_coupling.output.figures.advice import AdviceMark, draw_advice
from ellipsoid_coupling.output.figures.all_figures import draw_all
from ellipsoid_coupling.output.figures.angles import draw_angles
from ellipsoid_coupling.output.figures.convergence import draw_convergence, fitted_slope
from ellipsoid_coupling.output.figures.decay import DecayCurve, RateCurve, draw_decay, draw_rates
from ellipsoid_coupling.output.figures.density import (
    DensityRow,
    common_maximum,
    density_rows,
    draw_density,
)
from ellipsoid_coupling.output.figures.ellipses import draw_ellipses
from ellipsoid_coupling.output.figures.error_budget import UNRESOLVED_CLOSURE, PartBars, draw_parts
from ellipsoid_coupling.output.figures.flow import draw_flow
from ellipsoid_coupling.output.figures.frontier import draw_frontier
from ellipsoid_coupling.output.figures.sketch import draw_sketch
from ellipsoid_coupling.output.figures.stability import draw_stability

__all__ = [
    "UNRESOLVED_CLOSURE",
    "AdviceMark",
    "DecayCurve",
    "DensityRow",
    "PartBars",
    "RateCurve",
    "common_maximum",
    "density_rows",
    "draw_advice",
    "draw_all",
    "draw_angles",
    "draw_convergence",
    "draw_decay",
    "draw_density",
    "draw_ellipses",
    "draw_flow",
    "draw_frontier",
    "draw_parts",
    "draw_rates",
    "draw_sketch",
    "draw_stability",
    "fitted_slope",
]
