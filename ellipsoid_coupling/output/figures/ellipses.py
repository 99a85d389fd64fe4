"""The particles of one realisation as ellipses to scale."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    panel_grid,
    save_figure,
    show_domain,
    styled,
    time_title,
)
from ellipsoid_coupling.output.figures.flow import add_arrows
from ellipsoid_coupling.output.figures.style import line_style
from ellipsoid_coupling.output.figures.walls import add_walls
from ellipsoid_coupling.output.outlines import ellipse_outlines
from ellipsoid_coupling.result import Result

PANEL_WIDTH = 3.0
MOST_PARTICLES = 200


def thinned(number: int, most: int) -> NDArray[np.int64]:
    """At most `most` of the indices 0 ... number - 1, evenly spread, first and last among them."""
    return np.unique(np.linspace(0, number - 1, min(number, most)).round().astype(np.int64))


@styled
def ellipse_figure(
    result: Result,
    realisation: int = 0,
    flow: FlowField | None = None,
    most: int = MOST_PARTICLES,
    title: str = "",
) -> Figure:
    """The figure of `draw_ellipses`; one axes a time."""
    _require_particles(result, realisation)
    extent = (*result.scene.domain.x, *result.scene.domain.y)
    height = PANEL_WIDTH * min(2.0, result.scene.domain.height / result.scene.domain.width)
    columns = result.times.size
    figure = new_figure(
        PANEL_WIDTH * columns + 0.5,
        height + (1.1 if result.frozen is None else 1.4),
        layout="compressed",
    )
    axes = panel_grid(figure, 1, columns, sharey=True)[0]
    number = result.variables["x"].shape[2]
    chosen = thinned(number, most)
    for i, (time, panel) in enumerate(zip(result.times, axes, strict=True)):
        show_domain(panel, extent)
        left, unborn = (
            np.zeros(number, np.bool_) if flags is None else flags[i, realisation]
            for flags in (result.frozen, result.unborn)
        )
        left = left & ~unborn
        _add_ellipses(panel, result, (i, realisation), chosen[~(left | unborn)[chosen]])
        _add_ellipses(panel, result, (i, realisation), chosen[left[chosen]], filled=False)
        if flow is not None:
            add_arrows(panel, flow.at(time), extent, colour="0.8", count=16)
            add_walls(panel, flow.outline, extent)
        note = f"\n{left.sum()} have left the flow (outlines)" if left.any() else ""
        panel.set(xlabel="x", title=f"{time_title(time)}{note}")
    axes[0].set_ylabel("y")
    part = f"{chosen.size} of " if chosen.size < number else ""
    shown = f"{part}{number} particles"
    add_title(figure, f"{title}\n{shown}".strip())
    return figure


def _add_ellipses(
    axes: Axes,
    result: Result,
    where: tuple[int, int],
    chosen: NDArray[np.int64],
    filled: bool = True,
) -> None:
    """The chosen particles at `where`, (time, realisation); only their outlines if not `filled`."""
    x, y, angle = (result.variables[name][where][chosen] for name in ("x", "y", "angle"))
    size = (result.scene.particles.length, result.scene.particles.width)
    style = line_style(result.model)
    ellipses = PolyCollection(
        list(ellipse_outlines(x, y, angle, size)),
        facecolors=style.colour if filled else "none",
        edgecolors="black" if filled else "0.4",
        linewidths=0.3 if filled else 0.6,
        alpha=0.6,
    )
    axes.add_collection(ellipses, autolim=False)


def _require_particles(result: Result, realisation: int) -> None:
    if result.layout != "particles" or not result.times.size:
        raise InputError(
            "ellipse figure",
            "a particle result with a saved time",
            f"{result.model} with {result.times.size} times",
            "Draw its density instead.",
        )
    count = result.variables["x"].shape[1]
    if not 0 <= realisation < count:
        raise InputError(
            "ellipse figure", f"a realisation from 0 to {count - 1}", str(realisation), "Change it."
        )


def draw_ellipses(
    result: Result,
    path: Path,
    *,
    realisation: int = 0,
    flow: FlowField | None = None,
    most: int = MOST_PARTICLES,
    title: str = "",
) -> Path:
    """Ellipses of full length L and full width D, one panel a saved time.

    Of particles that have left the flow, through an outlet or at a wall that holds them, the outline stands
    where they did; the panel says how many. With a flow, walls and solids are drawn.

    Parameters
    ----------
    result : layout "particles"
    path : the PNG
    realisation : which of them
    flow : its arrows in light grey behind, as of each time
    most : where there are more particles, this many are shown, evenly picked, and the title says so
    title : str

    Raises
    ------
    InputError
        For a result without particles or saved times, or a realisation that it does not have.
    """
    return save_figure(ellipse_figure(result, realisation, flow, most, title), path)
