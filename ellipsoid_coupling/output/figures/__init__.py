"""Figures: `draw_...` writes a PNG, `..._figure` returns matplotlib's figure; from `Result`s or arrays."""

from ellipsoid_coupling.files.extras import missing

try:
    from ellipsoid_coupling.output.figures.advice import AdviceMark, draw_advice
    from ellipsoid_coupling.output.figures.all_figures import Look, draw_all
    from ellipsoid_coupling.output.figures.angles import angle_figure, draw_angles
    from ellipsoid_coupling.output.figures.at_a_glance import flow_at_a_glance, result_at_a_glance
    from ellipsoid_coupling.output.figures.convergence import draw_convergence, fitted_slope
    from ellipsoid_coupling.output.figures.decay import (
        DecayCurve,
        RateCurve,
        draw_decay,
        draw_rates,
    )
    from ellipsoid_coupling.output.figures.density import (
        DensityRow,
        common_maximum,
        density_figure,
        density_rows,
        draw_density,
    )
    from ellipsoid_coupling.output.figures.directors import (
        AxisRow,
        axis_rows,
        draw_directors,
    )
    from ellipsoid_coupling.output.figures.ellipses import draw_ellipses, ellipse_figure
    from ellipsoid_coupling.output.figures.error_budget import (
        UNRESOLVED_CLOSURE,
        PartBars,
        draw_parts,
    )
    from ellipsoid_coupling.output.figures.flow import draw_flow, flow_figure
    from ellipsoid_coupling.output.figures.frontier import draw_frontier
    from ellipsoid_coupling.output.figures.order import draw_order
    from ellipsoid_coupling.output.figures.sketch import draw_sketch
    from ellipsoid_coupling.output.figures.stability import draw_stability
    from ellipsoid_coupling.output.figures.style import PAPER_COLOURS
    from ellipsoid_coupling.output.figures.time_series import draw_time_series
except ModuleNotFoundError as error:
    if (error.name or "").partition(".")[0] != "matplotlib":
        raise
    raise missing("matplotlib") from None

__all__ = [
    "PAPER_COLOURS",
    "UNRESOLVED_CLOSURE",
    "AdviceMark",
    "AxisRow",
    "DecayCurve",
    "DensityRow",
    "Look",
    "PartBars",
    "RateCurve",
    "angle_figure",
    "axis_rows",
    "common_maximum",
    "density_figure",
    "density_rows",
    "draw_advice",
    "draw_all",
    "draw_angles",
    "draw_convergence",
    "draw_decay",
    "draw_density",
    "draw_directors",
    "draw_ellipses",
    "draw_flow",
    "draw_frontier",
    "draw_order",
    "draw_parts",
    "draw_rates",
    "draw_sketch",
    "draw_stability",
    "draw_time_series",
    "ellipse_figure",
    "fitted_slope",
    "flow_at_a_glance",
    "flow_figure",
    "result_at_a_glance",
]
