"""The particles of one realisation as ellipses in the colours of their axes, to scale but for mere dots."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.orientation import as_axis
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.figures.angle_bar import add_angle_bar
from ellipsoid_coupling.output.figures.canvas import (
    Extent,
    add_details,
    add_title,
    new_figure,
    panel_grid,
    save_figure,
    show_domain,
    styled,
    time_title,
)
from ellipsoid_coupling.output.figures.flow import add_arrows
from ellipsoid_coupling.output.figures.walls import add_walls
from ellipsoid_coupling.output.labels import run_details
from ellipsoid_coupling.output.outlines import drawn_outline, ellipse_outlines
from ellipsoid_coupling.result import Result

# Width of a panel in inch where they stand side by side, and where they stand below each other: those of
# domains that are wider than high by this factor.
PANEL_WIDTH, WIDE_PANEL, WIDE = 3.0, 6.5, 1.6
MOST_PARTICLES = 200
# Of the flow behind, along the longer side, and in a wide panel.
ARROWS, WIDE_ARROWS = 16, 30
# In points: ellipses shorter than a dot show no axis, and are drawn so long that they do.
_DOT, _SEEN = 2.0, 4.0


def thinned(number: int, most: int) -> NDArray[np.int64]:
    """At most `most` of the indices 0 ... number - 1, evenly spread, first and last among them."""
    return np.unique(np.linspace(0, number - 1, min(number, most)).round().astype(np.int64))


def come_by_the_end(result: Result, realisation: int) -> NDArray[np.int64]:
    """The particles of a realisation that are in the flow, or have been, by the last saved time.

    The others of a result's particles are those that an inlet was still to feed in.
    """
    if result.unborn is None:
        return np.arange(result.variables["x"].shape[2])
    return np.flatnonzero(~result.unborn[-1, realisation])


@styled
def ellipse_figure(
    result: Result,
    realisation: int = 0,
    flow: FlowField | None = None,
    most: int = MOST_PARTICLES,
    title: str = "",
    extent: Extent | None = None,
) -> Figure:
    """The figure of `draw_ellipses`; one axes a time."""
    _require_particles(result, realisation)
    extent = (*result.scene.domain.x, *result.scene.domain.y) if extent is None else extent
    figure, axes = _panels(extent, result.times.size)
    number = result.variables["x"].shape[2]
    come = come_by_the_end(result, realisation)
    chosen = come[thinned(come.size, most)]
    arrows = WIDE_ARROWS if _is_wide(extent) else ARROWS
    particles, width = result.scene.particles, WIDE_PANEL if _is_wide(extent) else PANEL_WIDTH
    times = enlargement(particles.length, extent, width)
    size = times * particles.length, times * particles.width
    for i, (time, panel) in enumerate(zip(result.times, axes, strict=True)):
        show_domain(panel, extent)
        left, unborn = (
            np.zeros(number, np.bool_) if flags is None else flags[i, realisation]
            for flags in (result.frozen, result.unborn)
        )
        left = left & ~unborn
        there = chosen[~(left | unborn)[chosen]]
        _add_ellipses(panel, result, (i, realisation), there, size)
        _add_ellipses(panel, result, (i, realisation), chosen[left[chosen]], size, filled=False)
        if flow is not None:
            add_arrows(panel, flow.at(time), extent, colour="0.8", count=arrows)
        add_walls(panel, drawn_outline(result.scene, flow), extent)
        note = f"\n{left.sum()} have left the flow (outlines)" if left.any() else ""
        panel.set(title=f"{time_title(time)}{note}")
    add_angle_bar(figure, list(axes))
    part = f"{chosen.size} of " if chosen.size < come.size else ""
    count = result.variables["x"].shape[1]
    whose = f", realisation {realisation} of {count}" if count > 1 else ""
    started = result.attributes.get("particles_at_start")
    # Those of all realisations, alike in each.
    came_in = 0 if started is None else come.size - int(started) // count
    inlet = f", {came_in} of them from inlets" if came_in > 0 else ""
    told = f"{part}{come.size} particles{inlet}{whose}{enlarged(times)}"
    add_title(figure, f"{title}\n{told}".strip())
    add_details(figure, run_details([result]))
    return figure


def _is_wide(extent: Extent) -> bool:
    """Whether panels of this extent stand below each other."""
    return (extent[3] - extent[2]) * WIDE <= extent[1] - extent[0]


def enlargement(length: float, extent: Extent, width: float) -> int:
    """How many times as large ellipses are drawn in a panel of this width (inch): 1, but for mere dots."""
    points = 72.0 * width * length / (extent[1] - extent[0])
    return 1 if points >= _DOT else math.ceil(_SEEN / points)


def enlarged(times: int) -> str:
    """What a title says of that; nothing of ellipses to scale."""
    return f", drawn {times} times as large" if times > 1 else ""


def _panels(extent: Extent, times: int) -> tuple[Figure, NDArray[np.object_]]:
    """A panel a time, (times,): side by side, or those of wide domains below each other."""
    rows, columns = (times, 1) if _is_wide(extent) else (1, times)
    width = WIDE_PANEL if _is_wide(extent) else PANEL_WIDTH
    height = width * min(2.0, (extent[3] - extent[2]) / (extent[1] - extent[0]))
    size = (width * columns + 1.7, (height + 0.45) * rows + 0.7)
    figure = new_figure(*size, layout="compressed")
    axes = panel_grid(figure, rows, columns, sharex=True, sharey=True)
    for panel in axes[-1]:
        panel.set_xlabel("x")
    for panel in axes[:, 0]:
        panel.set_ylabel("y")
    return figure, axes.ravel()


def _add_ellipses(
    axes: Axes,
    result: Result,
    where: tuple[int, int],
    chosen: NDArray[np.int64],
    size: tuple[float, float],
    filled: bool = True,
) -> None:
    """The chosen particles at `where`, (time, realisation); only their outlines if not `filled`.

    size : length and width as drawn
    """
    x, y, angle = (result.variables[name][where][chosen] for name in ("x", "y", "angle"))
    ellipses = PolyCollection(
        list(ellipse_outlines(x, y, angle, size)),
        facecolors=axis_colours(as_axis(angle)) if filled else "none",
        edgecolors="black" if filled else "0.4",
        linewidths=0.3 if filled else 0.6,
        alpha=0.8,
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
    extent: Extent | None = None,
) -> Path:
    """Ellipses of full length L and full width D in the colours of their axes, one panel a saved time.

    Of particles that have left the flow, through an outlet or at a wall that holds them, the outline stands
    where they did; the panel says how many. With a flow, walls and solids are drawn. Ellipses that would be
    dots are drawn larger, which the title says.

    Parameters
    ----------
    result : layout "particles"
    path : the PNG
    realisation : which of them
    flow : its arrows in light grey behind, as of each time
    most : where there are more particles, this many are shown, evenly picked, and the title says so
    title : str
    extent : (x_low, x_high, y_low, y_high), the part that is shown; the scene's domain without

    Raises
    ------
    InputError
        For a result without particles or saved times, or a realisation that it does not have.
    """
    return save_figure(ellipse_figure(result, realisation, flow, most, title, extent), path)
