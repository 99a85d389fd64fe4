"""One figure of a result or of a flow, for a first look: `Result.plot` and `FlowField.plot`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    save_figure,
    show_domain,
    show_multiples_of_pi,
    styled,
    time_title,
)
from ellipsoid_coupling.output.figures.density import HISTOGRAM_CELLS, common_maximum
from ellipsoid_coupling.output.figures.flow import flow_figure
from ellipsoid_coupling.output.figures.style import DENSITY_COLOURS, line_style
from ellipsoid_coupling.output.labels import model_name
from ellipsoid_coupling.result import Result

Rectangle = tuple[tuple[float, float], tuple[float, float]]
# Of a flow without end.
_SQUARE: Rectangle = ((-1.0, 1.0), (-1.0, 1.0))
_ANGLE_BINS = 60


def result_at_a_glance(result: Result, time: int = -1, path: str | Path | None = None) -> Figure:
    """See `Result.plot`; InputError for a time that was not saved."""
    count = result.times.size
    if not -count <= time < count:
        raise InputError(
            "time", f"one of the {count} saved times, from {-count} to {count - 1}", str(time),
            "Give its number, not the time itself.",
        )  # fmt: skip
    figure = _result_figure(result, time)
    if path is not None:
        save_figure(figure, Path(path))
    return figure


@styled
def _result_figure(result: Result, time: int) -> Figure:
    domain = result.scene.domain
    figure = new_figure(8.4, 3.6)
    figure.set_layout_engine("constrained", wspace=0.06)
    left, right = figure.subplots(1, 2)
    if result.layout == "particles":
        density = result.density(HISTOGRAM_CELLS)[time]
    else:
        density = result.cell_density()[time]
    extent = (*domain.x, *domain.y)
    show_domain(left, extent)
    top = common_maximum([density])
    image = left.imshow(
        density,
        origin="lower",
        extent=extent,
        cmap=DENSITY_COLOURS,
        vmin=0.0,
        vmax=top,
        interpolation="nearest",
    )
    figure.colorbar(
        image, ax=left, label="density", extend="max" if density.max() > top else "neither"
    )
    left.set(xlabel="x", ylabel="y")
    edges = np.linspace(0.0, 2.0 * np.pi, _ANGLE_BINS + 1)
    angles = result.angle_distribution(_ANGLE_BINS)[time]
    right.stairs(angles, edges, color=line_style(result.model).colour, linewidth=1.5)
    right.set(xlim=(0.0, 2.0 * np.pi), xlabel="angle", ylabel="probability density")
    right.set_ylim(bottom=0.0)
    show_multiples_of_pi(right.xaxis)
    name = result.scene.title or result.scene.name
    add_title(
        figure, f"{name}\n{model_name(result.model)}, {time_title(float(result.times[time]))}"
    )
    return figure


def flow_at_a_glance(
    flow: FlowField,
    domain: Rectangle | None = None,
    time: float = 0.0,
    path: str | Path | None = None,
) -> Figure:
    """See `FlowField.plot`."""
    if domain is None:
        x_low, x_high, y_low, y_high = flow.bounds
        domain = _SQUARE if np.isinf(x_low) else ((x_low, x_high), (y_low, y_high))
    now = flow.at(time)
    title = flow.origin if now is flow else f"{flow.origin}\n{time_title(time)}"
    figure = flow_figure(now, (*domain[0], *domain[1]), title)
    if path is not None:
        save_figure(figure, Path(path))
    return figure
