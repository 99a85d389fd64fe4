"""Error against run time, for every model and scheme."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ellipsoid_coupling.compare.cheapest import (
    KINDS,
    TARGETS,
    ErrorRow,
    Kind,
    largest_error,
    pareto_front,
)
from ellipsoid_coupling.models import BASELINE_SCHEME
from ellipsoid_coupling.output.figures.annotations import place_labels
from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    panel_grid,
    require,
    save_figure,
    styled,
)
from ellipsoid_coupling.output.figures.style import line_style
from ellipsoid_coupling.output.labels import model_name

# Of an error, from label to label on the front.
_GAIN = 0.8

Point = tuple[float, float, str]
Lines = dict[tuple[str, str], list[Point]]


def frontier_lines(rows: Sequence[ErrorRow], kind: Kind) -> Lines:
    """(model, scheme) -> points (seconds, largest error over the saved times, label) by rising time.

    Failed runs and zeros are left out, because a logarithmic axis cannot show them.
    """
    lines: Lines = {}
    for row in rows:
        error = largest_error(row, kind)
        if np.isfinite([error, row.wall_seconds]).all() and min(error, row.wall_seconds) > 0.0:
            point = (row.wall_seconds, error, short_resolution(row.resolution))
            lines.setdefault((row.model, row.scheme), []).append(point)
    return {key: sorted(points) for key, points in lines.items()}


def short_resolution(text: str) -> str:
    """A resolution for a label: "128 x 1000, tol 0.01" of "128 x 1000 particles, tolerance = 0.01"."""
    for long, short in (
        (" particles", ""),
        ("tolerance = ", "tol "),
        ("dt = ", "dt "),
        ("h = ", "h "),
        (" angles", ""),
    ):
        text = text.replace(long, short)
    return re.sub(r"\d+\.\d+", lambda number: f"{float(number[0]):.3g}", text)


@styled
def frontier_figure(
    rows: Sequence[ErrorRow], noise: tuple[float, float] | None = None, title: str = ""
) -> Figure:
    """The figure of `draw_frontier`; the density's axes and the angle's."""
    require(rows, "frontier figure", "row")
    figure = new_figure(11.0, 6.2)
    panels = panel_grid(figure, 1, 2)[0]
    drawn = [frontier_lines(rows, kind) for kind in KINDS]
    for index, (axes, kind, lines) in enumerate(zip(panels, KINDS, drawn, strict=True)):
        for (model, scheme), points in lines.items():
            _add_line(axes, model, scheme, points)
        axes.set(xlabel="run time in s, without compiling")
        axes.set_ylabel(f"L1 error of the {kind}{' distribution' if kind == 'angle' else ''}")
        axes.margins(0.08, 0.08)
        if lines:  # a logarithmic axis without a positive number has no limits
            axes.set(xscale="log", yscale="log")
            _name_ticks(axes)
            _add_front(axes, rows, kind)
        axes.grid(visible=True, which="major", color="0.92", linewidth=0.6)
        if noise is not None and lines and noise[index] > 0.0:
            _add_noise(axes, noise[index])
    handles, labels = panels[0].get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=4.0)
    add_title(figure, title)
    for axes, kind, lines in zip(panels, KINDS, drawn, strict=True):
        _label_front(axes, rows, kind, lines)
    return figure


def _front_points(rows: Sequence[ErrorRow], kind: Kind) -> list[Point]:
    front = [(row.wall_seconds, largest_error(row, kind), row) for row in pareto_front(rows, kind)]
    return [(s, e, short_resolution(row.resolution)) for s, e, row in front if min(s, e) > 0.0]


def _add_front(axes: Axes, rows: Sequence[ErrorRow], kind: Kind) -> None:
    """The Pareto front as a step line to the right rim, and lines at the target errors."""
    points = _front_points(rows, kind)
    right = axes.get_xlim()[1]
    seconds = [point[0] for point in points] + [right]
    errors = [point[1] for point in points] + [points[-1][1]]
    axes.step(
        seconds,
        errors,
        where="post",
        color="0.6",
        linewidth=4.0,
        alpha=0.5,
        zorder=1,
        label="no other run is better",
    )
    low, high = axes.get_ylim()
    for target in TARGETS:
        if low < target < high:
            axes.axhline(target, color="0.4", linewidth=0.7, linestyle=(0, (1, 3)), zorder=0)
    axes.set(ylim=(low, high), xlim=(axes.get_xlim()[0], right))


def _label_front(axes: Axes, rows: Sequence[ErrorRow], kind: Kind, lines: Lines) -> None:
    """The resolutions on the front, clear of every line; those that gain little are not labelled."""
    points = _front_points(rows, kind)
    labelled = points[:1]
    for point in points[1:]:
        if point[1] < _GAIN * labelled[-1][1]:
            labelled.append(point)
    place_labels(axes, [labelled], others=list(lines.values()))


def _add_line(axes: Axes, model: str, scheme: str, points: Sequence[Point]) -> None:
    """The baseline scheme is drawn thin with open markers, others bold with filled ones."""
    style = line_style(model)
    baseline = scheme == BASELINE_SCHEME
    axes.plot(
        [point[0] for point in points],
        [point[1] for point in points],
        color=style.colour,
        linestyle="-",
        linewidth=0.8 if baseline else 1.8,
        marker=style.marker,
        markerfacecolor="white" if baseline else style.colour,
        label=f"{model_name(model)}, {scheme}",
    )


def _name_ticks(axes: Axes) -> None:
    """Plain numbers at 1, 2 and 5 times a power of ten within two decades, at 1 beyond."""
    for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        many = limits[1] / limits[0] > 100.0
        axis.set_major_locator(LogLocator(subs=(1.0,) if many else (1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


def _add_noise(axes: Axes, error: float) -> None:
    """A band below the reference's own Monte-Carlo error, where errors have no meaning."""
    low, high = axes.get_ylim()
    bottom = min(low, 0.5 * error)
    axes.axhspan(bottom, error, color="0.85", zorder=0, label="Monte-Carlo error of the reference")
    axes.set_ylim(bottom, max(high, 1.2 * error))


def draw_frontier(
    rows: Sequence[ErrorRow],
    path: Path,
    *,
    noise: tuple[float, float] | None = None,
    title: str = "",
) -> Path:
    """Error (the largest over the saved times) against run time, log-log.

    A line joins the resolutions of one model and scheme. The grey step line is the front: the runs that
    no other run beats in both time and error, with their resolutions.

    Parameters
    ----------
    rows : such as `compare.FrontierRow`
    path : the PNG
    noise : the reference's own Monte-Carlo error of density and angle, drawn as a band
    title : str

    Raises
    ------
    InputError
        Without rows.
    """
    return save_figure(frontier_figure(rows, noise, title), path)
