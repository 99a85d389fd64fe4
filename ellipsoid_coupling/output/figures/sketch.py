"""The sketch of one particle: position, orientation angle and velocity (fig:ellipse)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Polygon

from ellipsoid_coupling.models import model_kinds
from ellipsoid_coupling.output.figures.canvas import new_figure, save_figure, styled
from ellipsoid_coupling.output.outlines import ellipse_outlines

# The paper's drawing: L = 1, D = 0.5, turned by 45 degrees.
_SIZE = (1.0, 0.5)
_DEGREES = 45.0


@styled
def sketch_figure() -> Figure:
    """The figure of `draw_sketch`; one axes without frame."""
    figure = new_figure(3.4, 2.6)
    axes = figure.add_subplot()
    angle = np.deg2rad(_DEGREES)
    centre = np.zeros(1)
    outline = ellipse_outlines(centre, centre, np.full(1, angle), _SIZE, corners=256)[0]
    colour = model_kinds()[0].style.colour
    axes.add_patch(Polygon(outline, facecolor=colour, edgecolor=colour, alpha=0.45))
    axes.plot([0.0, 0.5], [0.0, 0.5], color="black", linewidth=1.0)
    axes.plot([0.0, 0.75], [0.0, 0.0], color="black", linewidth=1.0, linestyle="--")
    axes.annotate(
        "", (-0.5, 0.5), (0.0, 0.0), arrowprops={"arrowstyle": "->", "shrinkA": 0, "shrinkB": 0}
    )
    axes.add_patch(Arc((0.0, 0.0), 0.8, 0.8, theta1=0.0, theta2=_DEGREES))
    axes.plot(0.0, 0.0, "o", color="black", markersize=3.0)
    names = ((0.27, 0.11, r"$\theta$"), (-0.08, -0.09, "$r$"), (-0.4, 0.28, "$v$"))
    for x, y, text in names:
        axes.text(x, y, text, ha="center", va="center", fontsize=12.0)
    axes.set(xlim=(-0.6, 0.85), ylim=(-0.5, 0.6), aspect="equal")
    axes.set_axis_off()
    return figure


def draw_sketch(path: Path) -> Path:
    """The paper's sketch of a particle with position r, orientation angle theta and velocity v."""
    return save_figure(sketch_figure(), path)
