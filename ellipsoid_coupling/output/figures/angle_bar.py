"""What the colours of axes mean: a bar from -pi/2 to pi/2."""

from __future__ import annotations

from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ellipsoid_coupling.output.figures.beside import in_height
from ellipsoid_coupling.output.figures.canvas import show_multiples_of_pi
from ellipsoid_coupling.output.figures.style import axis_map


def add_angle_bar(
    figure: Figure, beside: list[Axes], location: Literal["right", "bottom"] = "right"
) -> None:
    """The bar on the right of these axes, or below them; its two ends are the same axis."""
    norm = Normalize(-0.5 * np.pi, 0.5 * np.pi)
    upright = location == "right"
    bar = figure.colorbar(
        ScalarMappable(norm, axis_map()),
        ax=beside,
        location=location,
        pad=0.02,
        aspect=30 if upright else 60,
    )
    told = "angle of the axis in rad, modulo $\\pi$"
    bar.set_label(in_height(figure, told) if upright else told)
    show_multiples_of_pi(bar.ax.yaxis if upright else bar.ax.xaxis, 0.25)
