"""Decay to the stationary solution: distance over time, and fitted rate over the noise A = B."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    panel_grid,
    require,
    save_figure,
    styled,
)
from ellipsoid_coupling.output.figures.style import DENSITY_COLOURS, line_style
from ellipsoid_coupling.output.labels import model_name

Floats = NDArray[np.float64]

_DASHES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))


class DecayCurve(NamedTuple):
    """The distance to the stationary solution of one run.

    amplitude : A = B
    times, distance : (T,) float64; distances of zero are not drawn
    """

    amplitude: float
    times: Floats
    distance: Floats


class RateCurve(NamedTuple):
    """Decay rates over the noise; both arrays (n,) float64, the rates per unit of time."""

    amplitudes: Floats
    rates: Floats


@styled
def decay_figure(panels: Mapping[str, Sequence[DecayCurve]], title: str = "") -> Figure:
    """The figure of `draw_decay`; one axes a model, the legend on the right."""
    require(list(panels), "decay figure", "panel")
    amplitudes = sorted({curve.amplitude for curves in panels.values() for curve in curves})
    figure = new_figure(3.1 * len(panels) + 1.2, 3.0)
    axes = panel_grid(figure, 1, len(panels), sharey=True)[0]
    for panel, (model, curves) in zip(axes, panels.items(), strict=True):
        for curve in curves:
            _add_decay(panel, curve, amplitudes)
        panel.set(xlabel="t", title=model_name(model), yscale="log")
    axes[0].set_ylabel(r"$L^2$ distance to the stationary state")
    handles = {
        label: handle
        for panel in axes
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    order = [_amplitude_label(amplitude) for amplitude in amplitudes]
    figure.legend([handles[label] for label in order], order, loc="outside right center")
    add_title(figure, title)
    return figure


def _amplitude_label(amplitude: float) -> str:
    return f"A = B = {amplitude:g}"


def _add_decay(axes: Axes, curve: DecayCurve, amplitudes: Sequence[float]) -> None:
    """Colours run through a map in the order of the amplitudes, dashes tell neighbours apart."""
    index = amplitudes.index(curve.amplitude)
    positive = curve.distance > 0.0
    axes.plot(
        curve.times[positive],
        curve.distance[positive],
        color=colormaps[DENSITY_COLOURS](0.9 * index / max(1, len(amplitudes) - 1)),
        linestyle=_DASHES[index % len(_DASHES)],
        label=_amplitude_label(curve.amplitude),
    )


@styled
def rate_figure(
    rates: Mapping[str, RateCurve], exact: RateCurve | None = None, title: str = ""
) -> Figure:
    """The figure of `draw_rates`; one axes."""
    require(list(rates), "decay rate figure", "model")
    figure = new_figure(4.6, 3.2)
    axes = figure.add_subplot()
    if exact is not None:
        axes.plot(*exact, color="0.6", linewidth=1.0, label="without interaction, exact")
    for model, curve in rates.items():
        style = line_style(model)
        axes.plot(
            *curve,
            color=style.colour,
            linestyle=style.dashes,
            marker=style.marker,
            markerfacecolor="none",
            label=model_name(model),
        )
    axes.set(xlabel="A = B", ylabel="decay rate", title=title)
    axes.set_ylim(bottom=0.0)
    figure.legend(loc="outside lower center", ncols=2, handlelength=3.5)
    return figure


def draw_decay(panels: Mapping[str, Sequence[DecayCurve]], path: Path, *, title: str = "") -> Path:
    """L2 distance to the stationary state over time, log scale; a panel a model, a line an A = B.

    Raises
    ------
    InputError
        Without panels.
    """
    return save_figure(decay_figure(panels, title), path)


def draw_rates(
    rates: Mapping[str, RateCurve],
    path: Path,
    *,
    exact: RateCurve | None = None,
    title: str = "",
) -> Path:
    """Decay rate over A = B, one line a model; `exact` is drawn in grey behind.

    Raises
    ------
    InputError
        Without models.
    """
    return save_figure(rate_figure(rates, exact, title), path)
