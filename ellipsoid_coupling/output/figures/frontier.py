"""Error against run time: what each model and scheme gives for its cost."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

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


class ErrorRow(Protocol):
    """One run: what it was, how long it took, its errors at the saved times."""

    @property
    def model(self) -> str:
        """Name of the model."""

    @property
    def scheme(self) -> str:
        """Name of the scheme."""

    @property
    def resolution(self) -> str:
        """In words, such as "h = 0.01"."""

    @property
    def density_errors(self) -> tuple[float, ...]:
        """One a saved time, NaN for a failed run."""

    @property
    def angle_errors(self) -> tuple[float, ...]:
        """One a saved time, NaN for a failed run."""

    @property
    def wall_seconds(self) -> float:
        """Without compiling."""


Point = tuple[float, float, str]
Lines = dict[tuple[str, str], list[Point]]


def frontier_lines(rows: Sequence[ErrorRow], kind: str, time: int) -> Lines:
    """(model, scheme) -> points (seconds, error, label) by rising run time.

    kind : "density" or "angle"; time : index of the saved time. What a logarithmic axis cannot show
    (failed runs, zeros) is left out.
    """
    lines: Lines = {}
    for row in rows:
        error = (row.density_errors if kind == "density" else row.angle_errors)[time]
        if np.isfinite([error, row.wall_seconds]).all() and min(error, row.wall_seconds) > 0.0:
            point = (row.wall_seconds, error, row.resolution.split(", ")[-1])
            lines.setdefault((row.model, row.scheme), []).append(point)
    return {key: sorted(points) for key, points in lines.items()}


@styled
def frontier_figure(
    rows: Sequence[ErrorRow],
    noise: tuple[float, float] | None = None,
    time: int = -1,
    title: str = "",
) -> Figure:
    """The figure of `draw_frontier`; the density's axes and the angle's."""
    require(rows, "frontier figure", "row")
    figure = new_figure(9.0, 4.6)
    density, angle = panel_grid(figure, 1, 2)[0]
    parts = ((density, "density", 0), (angle, "angle", 1))
    drawn = [frontier_lines(rows, kind, time) for _, kind, _ in parts]
    for (axes, kind, index), lines in zip(parts, drawn, strict=True):
        for (model, scheme), points in lines.items():
            _add_line(axes, model, scheme, points)
        axes.set(xlabel="run time in s, without compiling")
        axes.set_ylabel(f"L1 error of the {kind}{' distribution' if kind == 'angle' else ''}")
        axes.margins(0.14, 0.12)
        if lines:  # a logarithmic axis without a positive number has no limits
            axes.set(xscale="log", yscale="log")
            _name_ticks(axes)
        axes.grid(visible=True, which="major", color="0.92", linewidth=0.6)
        if noise is not None and lines and noise[index] > 0.0:
            _add_noise(axes, noise[index])
    handles, labels = density.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=3, handlelength=4.0)
    add_title(figure, title)
    for (axes, _, _), lines in zip(parts, drawn, strict=True):
        place_labels(axes, list(lines.values()))
    return figure


def _add_line(axes: Axes, model: str, scheme: str, points: Sequence[Point]) -> None:
    """The scheme `paper` is drawn thin with open markers, others bold with filled ones."""
    style = line_style(model)
    baseline = scheme == "paper"
    axes.plot(
        [point[0] for point in points],
        [point[1] for point in points],
        color=style.colour,
        linestyle=style.dashes,
        linewidth=0.9 if baseline else 1.8,
        marker=style.marker,
        markerfacecolor="white" if baseline else style.colour,
        label=f"{model_name(model)}, {scheme}",
    )


def _name_ticks(axes: Axes) -> None:
    """Plain numbers at 1, 2 and 5 times a power of ten: readable within one decade and over four."""
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


def _add_noise(axes: Axes, error: float) -> None:
    """A band from the reference's own Monte-Carlo error down: below, an error says nothing."""
    low, high = axes.get_ylim()
    bottom = min(low, 0.5 * error)
    axes.axhspan(bottom, error, color="0.85", zorder=0, label="Monte-Carlo error of an ensemble")
    axes.set_ylim(bottom, max(high, 1.2 * error))


def draw_frontier(
    rows: Sequence[ErrorRow],
    path: Path,
    *,
    noise: tuple[float, float] | None = None,
    time: int = -1,
    title: str = "",
) -> Path:
    """Error against run time, log-log, a line joining the resolutions of one model and scheme.

    Parameters
    ----------
    rows : such as `compare.FrontierRow`
    path : the PNG
    noise : the reference's own Monte-Carlo error of density and angle, drawn as a band
    time : index of the saved time, the last by default
    title : str

    Raises
    ------
    InputError
        Without rows.
    """
    return save_figure(frontier_figure(rows, noise, time, title), path)
