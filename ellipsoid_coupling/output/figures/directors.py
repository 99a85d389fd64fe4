"""Mean axes over the domain: as short lines without head over the density, and as colours."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.orientation import Complexes, Shape, mean_axis
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.figures.angle_bar import add_angle_bar
from ellipsoid_coupling.output.figures.canvas import (
    ABOVE,
    Extent,
    add_details,
    add_title,
    new_figure,
    panel_grid,
    require,
    save_figure,
    say_in,
    show_domain,
    styled,
    time_title,
)
from ellipsoid_coupling.output.figures.density import (
    DensityRow,
    absence,
    add_density_bar,
    common_maximum,
    density_rows,
)
from ellipsoid_coupling.output.figures.style import PALE_COLOURS, PALE_RANGE, part_of_map
from ellipsoid_coupling.output.figures.walls import add_walls
from ellipsoid_coupling.output.orientation import axis_moments
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

# "lines": over the density; "colours": of the axes, the fainter the less there is.
Kind = Literal["lines", "colours"]

# Lines along the longer side of the domain.
LINES = 26
# Below this part of the density at which colours end, there is no line.
_THIN = 0.02
# Greys and opacities go with this power of the density: thin parts have axes as well.
_POWER = 0.4
_PANEL = 2.8


class AxisRow(NamedTuple):
    """One row of panels.

    density : the row's densities
    lines : (T, rows, columns) complex, <e^{2 i theta}> in the bins of the lines
    fine : (T, ny, nx) complex, the same in the cells of a grid; of particles, in the bins of the lines
    """

    density: DensityRow
    lines: Complexes
    fine: Complexes


def line_shape(extent: Extent, count: int = LINES) -> Shape:
    """Bins (rows, columns), near squares, `count` along the longer side."""
    width, height = extent[1] - extent[0], extent[3] - extent[2]
    spacing = max(width, height) / count
    return max(1, round(height / spacing)), max(1, round(width / spacing))


def axis_rows(
    results: Sequence[Result], flow: FlowField | Sequence[FlowField | None] | None = None
) -> list[AxisRow]:
    """Rows of results, those without any saved time left out; `flow` as `density_rows` has it."""
    reached = [result for result in results if result.times.size]
    rows = density_rows(results, histograms=False, flow=flow)
    found = []
    for row, result in zip(rows, reached, strict=True):
        lines = axis_moments(result, line_shape(row.extent))
        cells = (row.density.shape[1], row.density.shape[2])
        fine = lines if result.layout == "particles" else axis_moments(result, cells)
        plain = row._replace(label=row.label.removesuffix("\nsmoothed"))
        found.append(AxisRow(plain, lines, fine))
    return found


@styled
def director_figure(rows: Sequence[AxisRow], kind: Kind = "lines", title: str = "") -> Figure:
    """The figure of `draw_directors`; axes in row-major order, then those of the colour bars."""
    require(rows, "director figure", "row")
    times = np.unique(np.concatenate([row.density.times for row in rows]))
    extent = rows[0].density.extent
    height = _PANEL * min(2.0, (extent[3] - extent[2]) / (extent[1] - extent[0]))
    figure = new_figure(
        _PANEL * len(times) + 2.4, (height + 0.13) * len(rows) + 1.6, layout="compressed"
    )
    axes = panel_grid(figure, len(rows), len(times), sharex=True, sharey=True)
    top = common_maximum([panel for row in rows for panel in row.density.density])
    images: list[AxesImage] = []
    for row, panels in zip(rows, axes, strict=True):
        for time, panel in zip(times, panels, strict=True):
            show_domain(panel, row.density.extent)
            add_walls(panel, row.density.outline, row.density.extent)
            found = np.flatnonzero(np.isclose(row.density.times, time))
            if not found.size:
                say_in(panel, absence(row.density, time))
            elif kind == "lines":
                images.append(_add_lines(panel, row, int(found[0]), top))
            else:
                _add_colours(panel, row, int(found[0]), top)
        panels[0].set_ylabel(f"{row.density.label}\n\ny")
    for time, first, last in zip(times, axes[0], axes[-1], strict=True):
        first.set_title(time_title(time))
        last.set_xlabel("x")
    everywhere = axes.ravel().tolist()
    # One bar a side: the layout has no room for a second one.
    add_angle_bar(figure, everywhere, "bottom")
    if images:
        add_density_bar(figure, images, everywhere, room=(height + 0.13) * len(rows) + ABOVE)
    add_title(figure, title)
    add_details(figure, [_explanation(kind), *(row.density.details for row in rows)])
    return figure


def _explanation(kind: Kind) -> str:
    if kind == "lines":
        return "Lines lie along the mean axis of their bin; a line as long as a bin is S = 1, none S = 0."
    return "Colour: the mean axis of a cell; the fainter, the less density or the smaller S."


def _add_lines(axes: Axes, row: AxisRow, t: int, top: float) -> AxesImage:
    """The density of a saved time in grey, and the lines of its bins."""
    density, extent = row.density.density[t], row.density.extent
    image = axes.imshow(
        density,
        origin="lower",
        extent=extent,
        cmap=part_of_map(PALE_COLOURS, PALE_RANGE),
        norm=PowerNorm(_POWER, 0.0, top),
        interpolation="nearest",
    )
    moment = row.lines[t]
    x, y = _centres(moment, extent)
    shown = (np.abs(moment) > 0.0) & (_at(density, extent, x, y) > _THIN * top)
    angle = mean_axis(moment[shown])
    rows, columns = moment.shape
    spacing = min((extent[1] - extent[0]) / columns, (extent[3] - extent[2]) / rows)
    half = 0.45 * spacing * np.abs(moment[shown])
    ends = np.stack([half * np.cos(angle), half * np.sin(angle)], axis=-1)
    middle = np.stack([x[shown], y[shown]], axis=-1)
    segments = np.stack([middle - ends, middle + ends], axis=1)
    lines = LineCollection(list(segments), colors=axis_colours(angle), linewidths=1.3, zorder=1.0)
    axes.add_collection(lines, autolim=False)
    return image


def _centres(bins: Complexes, extent: Extent) -> tuple[Floats, Floats]:
    """The centres of bins over an extent, x and y of shape (rows, columns)."""
    rows, columns = bins.shape
    x = extent[0] + (extent[1] - extent[0]) * (np.arange(columns) + 0.5) / columns
    y = extent[2] + (extent[3] - extent[2]) * (np.arange(rows) + 0.5) / rows
    grid_x, grid_y = np.meshgrid(x, y)
    return grid_x, grid_y


def _at(density: Floats, extent: Extent, x: Floats, y: Floats) -> Floats:
    """The density of the cells that hold the points."""
    ny, nx = density.shape
    column = ((x - extent[0]) / (extent[1] - extent[0]) * nx).astype(np.int64)
    row = ((y - extent[2]) / (extent[3] - extent[2]) * ny).astype(np.int64)
    return np.asarray(density[np.clip(row, 0, ny - 1), np.clip(column, 0, nx - 1)])


def _add_colours(axes: Axes, row: AxisRow, t: int, top: float) -> None:
    """The mean axis of each cell; its opacity is S times a power of the density's part of `top`."""
    moment = row.fine[t]
    density = _at(row.density.density[t], row.density.extent, *_centres(moment, row.density.extent))
    opacity = np.abs(moment) * np.clip(density / top, 0.0, 1.0) ** _POWER
    colours = np.concatenate([axis_colours(mean_axis(moment)), opacity[..., None]], axis=-1)
    axes.imshow(
        np.clip(colours, 0.0, 1.0),
        origin="lower",
        extent=row.density.extent,
        interpolation="nearest",
    )


def draw_directors(
    rows: Sequence[AxisRow], path: Path, *, kind: Kind = "lines", title: str = ""
) -> Path:
    """The mean axes of results, rows for models and columns for times.

    Parameters
    ----------
    rows : from `axis_rows`; all of one domain
    path : the PNG
    kind : "lines": headless, their length S, over the density; "colours": of the axes in each cell
    title : str

    Raises
    ------
    InputError
        Without rows.
    """
    return save_figure(director_figure(rows, kind, title), path)
