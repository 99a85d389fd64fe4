"""The fluid's velocity as arrows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.inside import in_fluid
from ellipsoid_coupling.output.figures.canvas import (
    ABOVE,
    Extent,
    fitted,
    new_figure,
    save_figure,
    show_domain,
    styled,
    wrapped,
)
from ellipsoid_coupling.output.figures.style import SPEED_COLOURS, SPEED_RANGE, part_of_map
from ellipsoid_coupling.output.figures.walls import add_walls

Floats = NDArray[np.float64]

# Arrows along the longer side: more of them no longer tell their heads apart.
ARROWS = 24
# Length goes with this power of speed, so that slow regions stay visible; colour with speed itself.
POWER = 0.15


def arrow_centres(extent: Extent, count: int) -> tuple[Floats, Floats, float]:
    """Points (rows, columns) x, y at the centres of near-square boxes, and the boxes' width."""
    x_low, x_high, y_low, y_high = extent
    spacing = max(x_high - x_low, y_high - y_low) / count
    columns = max(1, round((x_high - x_low) / spacing))
    rows = max(1, round((y_high - y_low) / spacing))
    x = x_low + (x_high - x_low) * (np.arange(columns) + 0.5) / columns
    y = y_low + (y_high - y_low) * (np.arange(rows) + 0.5) / rows
    grid_x, grid_y = np.meshgrid(x, y)
    return grid_x, grid_y, spacing


def add_arrows(
    axes: Axes, flow: FlowField, extent: Extent, colour: str | None = None, count: int = ARROWS
) -> Quiver:
    """Arrows centred on an even grid, those outside the flow left out.

    The largest is 0.9 spacings long. With `colour` all have it, otherwise that of their speed.
    """
    x, y, spacing = arrow_centres(extent, count)
    sample = flow.evaluate(x, y)
    inside = sample.inside
    if flow.outline is not None:
        inside &= in_fluid(flow.outline.ends, x.ravel(), y.ravel()).reshape(x.shape)
    velocity_x, velocity_y = sample.velocity_x[inside], sample.velocity_y[inside]
    speed = np.hypot(velocity_x, velocity_y)
    largest = float(speed.max(initial=0.0)) or 1.0
    length = 0.9 * spacing * (speed / largest) ** POWER
    factor = np.divide(length, speed, out=np.zeros_like(speed), where=speed > 1e-9 * largest)
    arrows = (x[inside], y[inside], factor * velocity_x, factor * velocity_y)
    # Units of the axes, so that an arrow has the length above at any figure size.
    options: dict[str, Any] = {
        "angles": "xy",
        "scale_units": "xy",
        "scale": 1.0,
        "pivot": "mid",
        "units": "xy",
        "width": 0.07 * spacing,
        "headwidth": 4.0,
        "headlength": 4.5,
        "headaxislength": 4.0,
        "minlength": 0.0,
    }
    if colour is not None:
        return axes.quiver(*arrows, color=colour, zorder=0, **options)
    colours = part_of_map(SPEED_COLOURS, SPEED_RANGE)
    norm = Normalize(0.0, largest)
    return axes.quiver(*arrows, speed, cmap=colours, norm=norm, **options)


@styled
def flow_figure(flow: FlowField, extent: Extent, title: str = "") -> Figure:
    """The figure of `draw_flow`; the field's axes and that of the colour bar."""
    x_low, x_high, y_low, y_high = extent
    height = 4.2 * min(2.0, (y_high - y_low) / (x_high - x_low))
    figure = new_figure(5.4, height + 0.6, layout="compressed")
    axes = figure.add_subplot()
    show_domain(axes, extent)
    arrows = add_arrows(axes, flow, extent)
    add_walls(axes, flow.outline, extent)
    bar = figure.colorbar(arrows, ax=axes)
    told = f"speed, linear; largest arrow {arrows.norm.vmax:.3g}"
    bar.set_label(fitted((told, "the lengths of arrows differ less"), height + ABOVE))
    axes.set(xlabel="x", ylabel="y", title=wrapped(figure, title))
    return figure


def draw_flow(flow: FlowField, extent: Extent, path: Path, *, title: str = "") -> Path:
    """Velocity vectors of a flow, coloured by speed on a linear scale; their length varies little.

    Parameters
    ----------
    flow : FlowField
    extent : (x_low, x_high, y_low, y_high), the part that is shown
    path : the PNG
    title : str
    """
    return save_figure(flow_figure(flow, extent, title), path)
