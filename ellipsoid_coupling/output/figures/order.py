"""The order parameter S over time, one line a result."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ellipsoid_coupling.output.figures.angles import add_legend_below
from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    require,
    save_figure,
    styled,
)
from ellipsoid_coupling.output.figures.style import LEGEND_ENTRY, curve_options, line_style
from ellipsoid_coupling.output.labels import long_labels
from ellipsoid_coupling.output.orientation import order_series
from ellipsoid_coupling.result import Result

# More points than this are joined by a line without a marker on each.
_MOST_MARKERS = 12


@styled
def order_figure(results: Sequence[Result], title: str = "") -> Figure:
    """The figure of `draw_order`; one axes, the legend below."""
    reached = [result for result in results if result.times.size]
    require(reached, "order figure", "result with a saved time")
    labels, width = long_labels(reached), 5.6
    columns = int(width / LEGEND_ENTRY)
    figure = new_figure(width, 3.2 + 0.32 * math.ceil(len(reached) / columns))
    axes = figure.add_subplot()
    repeats: Counter[str] = Counter()
    bands = False
    for label, result in zip(labels, reached, strict=True):
        options = curve_options(result.model, repeats[result.model], result.times.size)
        repeats[result.model] += 1
        if result.times.size <= _MOST_MARKERS:
            options |= {"marker": line_style(result.model).marker, "markevery": 1}
        series = order_series(result)
        axes.plot(result.times, series.order, label=label, **options)
        if np.any(series.error > 0.0):
            bands = True
            low, high = series.order - series.error, series.order + series.error
            axes.fill_between(result.times, low, high, color=options["color"], alpha=0.25, lw=0)
            axes.vlines(result.times, low, high, color=options["color"], lw=0.8)
    name = r"order parameter $S = |\langle e^{2 i \theta} \rangle|$"
    axes.set(xlabel="t", ylabel=name, ylim=(-0.02, 1.02))
    add_legend_below(figure, [axes], labels, columns)
    note = "\nbands: standard error over realisations" if bands else ""
    add_title(figure, f"{title}{note}".strip())
    return figure


def draw_order(results: Sequence[Result], path: Path, *, title: str = "") -> Path:
    """S at the saved times: 1 where all axes are parallel, 0 where none is preferred.

    Parameters
    ----------
    results : any models; those without a saved time are left out
    path : the PNG
    title : str

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return save_figure(order_figure(results, title), path)
