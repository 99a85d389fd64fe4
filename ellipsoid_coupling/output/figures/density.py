"""Density panels: one row a model, one column a time, one colour scale for all of them or for each time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.output.figures.beside import in_height, row_labels
from ellipsoid_coupling.output.figures.canvas import (
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
from ellipsoid_coupling.output.figures.style import DENSITY_COLOURS, PANEL
from ellipsoid_coupling.output.figures.walls import add_walls
from ellipsoid_coupling.output.labels import result_labels, run_details
from ellipsoid_coupling.output.outlines import drawn_outline
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

# "time": the panels of one time share their colours; "figure": all panels do.
Scale = Literal["time", "figure"]

# A few cells at a caustic would otherwise take all of the colours.
PERCENTILE = 99.5
HISTOGRAM_CELLS = 60
SMOOTHING = 1.0
# Particles per filled bin below which the peaks of a histogram are chance (30 % and more).
FEW = 10
# Of a panel's width: lower ones are flat.
_FLAT = 0.6


class DensityRow(NamedTuple):
    """One row of panels.

    label : str, beside the row
    times : (T,) float64
    density : (T, ny, nx) float64, axis order (time, y, x), per unit of area
    extent : (x_low, x_high, y_low, y_high)
    noisy : its peaks are chance and must not set the colours, if there are other rows
    asked : the times that the run was to save
    outline : where the fluid ends, drawn over the panels
    details : the run in one line, printed below all panels
    """

    label: str
    times: Floats
    density: Floats
    extent: Extent
    noisy: bool = False
    asked: tuple[float, ...] = ()
    outline: Outline | None = None
    details: str = ""


def density_rows(
    results: Sequence[Result],
    cells: int = HISTOGRAM_CELLS,
    smoothing: float = SMOOTHING,
    histograms: bool = True,
    flow: FlowField | Sequence[FlowField | None] | None = None,
) -> list[DensityRow]:
    """Rows of results: two of particles, histogram and smoothed histogram, one of a grid.

    Parameters
    ----------
    results : Results, those without any saved time are left out
    cells : bins of a particle histogram along x and along y
    smoothing : standard deviation of the Gaussian filter, in bins; mirrored at the edges, so that
        no mass is lost there
    histograms : False leaves the bare histograms out
    flow : that of all results, or one a result, whose walls and solids are drawn; without, the domain's
        sides are
    """
    flows = flow if isinstance(flow, Sequence) else [flow] * len(results)
    pairs = [(r, own) for r, own in zip(results, flows, strict=True) if r.times.size]
    reached = [result for result, _ in pairs]
    told = zip(result_labels(reached), run_details(reached), strict=True)
    rows: list[DensityRow] = []
    for (label, details), (result, own) in zip(told, pairs, strict=True):
        scene = result.scene
        extent = (*scene.domain.x, *scene.domain.y)
        row = DensityRow(
            label,
            result.times,
            np.empty(0),
            extent,
            asked=scene.times,
            outline=drawn_outline(scene, own),
            details=details,
        )
        if result.layout != "particles":
            rows.append(row._replace(density=result.cell_density()))
            continue
        histogram = result.density(cells)
        smooth = gaussian_filter(histogram, (0.0, smoothing, smoothing), mode="reflect")
        if histograms:
            noisy = result.variables["x"][0].size < FEW * np.count_nonzero(histogram, (1, 2)).max()
            bare = row._replace(label=f"{label}\nhistogram", density=histogram, noisy=bool(noisy))
            rows.append(bare)
        rows.append(row._replace(label=f"{label}\nsmoothed", density=smooth))
    return rows


def common_maximum(panels: Sequence[Floats]) -> float:
    """Where the colours of compared panels end: the 99.5th percentile, each panel counting alike.

    Panels have their own numbers of cells; a percentile of all cells would let the finest decide.
    """
    levels = np.linspace(0.0, 1.0, 2001)
    pooled = np.concatenate([np.quantile(panel, levels) for panel in panels])
    # Nearly everywhere empty: the percentile is then no help.
    return float(np.percentile(pooled, PERCENTILE) or pooled.max()) or 1.0


@styled
def density_figure(
    rows: Sequence[DensityRow],
    scale: Scale = "figure",
    maximum: float | None = None,
    power: float = 1.0,
    title: str = "",
    colours: str = DENSITY_COLOURS,
) -> Figure:
    """The figure of `draw_density`; axes in row-major order, then those of the colour bars."""
    require(rows, "density figure", "row")
    times = np.unique(np.concatenate([row.times for row in rows]))
    x_low, x_high, y_low, y_high = rows[0].extent
    height = PANEL * min(2.0, (y_high - y_low) / (x_high - x_low))
    # A flat panel has no room for a long line beside it.
    breaks = ",\n" if height < _FLAT * PANEL else ", "
    labels = [row.label.replace(", ", breaks) for row in rows]
    beside = row_labels(labels, height, [row.label for row in rows])
    figure = new_figure(
        PANEL * len(times) + beside.room + (2.4 if scale == "figure" else 0.7),
        (height + 0.13) * len(rows) + (0.9 if scale == "figure" else 1.6),
        layout="compressed",
    )
    axes = panel_grid(figure, len(rows), len(times), sharex=True, sharey=True)
    columns = [np.arange(len(times))] if scale == "figure" else np.arange(len(times))[:, None]
    for column in columns:
        shown = [(row, times[j], axes[i, j]) for j in column for i, row in enumerate(rows)]
        images = _draw_panels(shown, maximum, power, colours)
        if images:
            beside_bar = axes[:, column].ravel().tolist()
            add_density_bar(figure, images, beside_bar, scale, maximum)
    for i, first in enumerate(axes[:, 0]):
        beside.add(i, first)
    for time, top, bottom in zip(times, axes[0], axes[-1], strict=True):
        top.set_title(time_title(time))
        bottom.set_xlabel("x")
    add_title(figure, title)
    add_details(figure, list(dict.fromkeys(row.details for row in rows if row.details)))
    return figure


def _draw_panels(
    shown: Sequence[tuple[DensityRow, float, Axes]],
    maximum: float | None,
    power: float,
    colours: str,
) -> list[AxesImage]:
    """Panels in one colour scale, with a note where a run did not reach, or save, a time."""
    drawn = []
    for row, time, axes in shown:
        show_domain(axes, row.extent)
        add_walls(axes, row.outline, row.extent)
        index = np.flatnonzero(np.isclose(row.times, time))
        if index.size:
            drawn.append((row, row.density[index[0]], axes))
        else:
            say_in(axes, absence(row, time))
    if not drawn:
        return []
    calm = [density for row, density, _ in drawn if not row.noisy]
    top = maximum or common_maximum(calm or [density for _, density, _ in drawn])
    return [
        axes.imshow(
            density,
            origin="lower",
            extent=row.extent,
            cmap=colours,
            norm=PowerNorm(power, vmin=0.0, vmax=top),
            interpolation="nearest",
        )
        for row, density, axes in drawn
    ]


def absence(row: DensityRow, time: float) -> str:
    """Why a row has no panel at a time, in two words."""
    return "not reached" if np.isclose(row.asked, time).any() else "not saved"


def add_density_bar(
    figure: Figure,
    images: Sequence[AxesImage],
    beside: list[Axes],
    scale: Scale = "figure",
    maximum: float | None = None,
) -> None:
    """The colour bar of density images of one scale: unit, largest value, and where the colours end."""
    top = images[0].get_clim()[1]
    largest = max(float(np.max(np.asarray(image.get_array()))) for image in images)
    parts = ["density per unit of area", f"largest {largest:.3g}"]
    if largest > top and maximum is None:
        parts.append(f"colours to the {PERCENTILE:g}th percentile")
    norm = images[0].norm
    if isinstance(norm, PowerNorm) and norm.gamma != 1.0:
        parts[0] += f", power {norm.gamma:g}"
    bar = figure.colorbar(
        images[0],
        ax=beside,
        extend="max" if largest > top else "neither",
        location="right" if scale == "figure" else "bottom",
        pad=0.02,
        aspect=40 if scale == "figure" else 20,
    )
    text = "\n".join(parts)
    bar.set_label(in_height(figure, text) if scale == "figure" else text)


def draw_density(
    rows: Sequence[DensityRow],
    path: Path,
    *,
    scale: Scale = "figure",
    maximum: float | None = None,
    power: float = 1.0,
    title: str = "",
    colours: str = DENSITY_COLOURS,
) -> Path:
    """Density panels like the paper's, rows for models and columns for times.

    Parameters
    ----------
    rows : from `density_rows`, or built by hand; all of one domain
    path : the PNG
    scale : "figure": one colour scale for all panels; "time": one a column
    maximum : where the colours end, for figures that are to be compared; `common_maximum` otherwise
    power : colours go with this power of the density; 0.5 shows thin and dense parts together
    title : str
    colours : the name of a map of matplotlib, such as `style.PAPER_COLOURS`

    Raises
    ------
    InputError
        Without rows.
    """
    return save_figure(density_figure(rows, scale, maximum, power, title, colours), path)
