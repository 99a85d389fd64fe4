"""Mass, speeds and alignment over time: one panel a number, one line a result."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    panel_grid,
    require,
    save_figure,
    styled,
)
from ellipsoid_coupling.output.figures.style import LEGEND_ENTRY, curve_options, line_style
from ellipsoid_coupling.output.labels import result_labels
from ellipsoid_coupling.output.series import time_series
from ellipsoid_coupling.result import Result

_PANEL = (3.2, 2.1)
_COLUMNS = 2


@styled
def series_figure(results: Sequence[Result], title: str = "") -> Figure:
    """The figure of `draw_time_series`; one axes a number, the legend below."""
    reached = [result for result in results if result.times.size]
    require(reached, "figure over time", "result with a saved time")
    series = [time_series(result) for result in reached]
    names = list(dict.fromkeys(name for one in series for name in one.by_name()))
    rows = math.ceil(len(names) / _COLUMNS)
    width = _PANEL[0] * _COLUMNS + 0.3
    columns = max(1, int(width / LEGEND_ENTRY))
    figure = new_figure(width, _PANEL[1] * rows + 0.3 + 0.18 * math.ceil(len(reached) / columns))
    axes = panel_grid(figure, rows, _COLUMNS).ravel()
    for spare in axes[len(names) :]:
        spare.remove()
    repeats: Counter[str] = Counter()
    for label, result, one in zip(result_labels(reached), reached, series, strict=True):
        # Few times are saved: each one has a marker, filled for the first run of a model.
        options = curve_options(result.model, repeats[result.model], one.times.size)
        options |= {"label": label, "markevery": None, "marker": line_style(result.model).marker}
        if not repeats[result.model]:
            options["markerfacecolor"] = options["color"]
        repeats[result.model] += 1
        for name, values in one.by_name().items():
            axes[names.index(name)].plot(one.times, values, **options)
    for panel, name in zip(axes, names, strict=False):
        panel.set(xlabel="t", title=name)
        # From 0 on, so that a change of a part in a thousand does not look like all of it; none of
        # these numbers is negative.
        panel.set_ylim(0.0, 1.08 * panel.get_ylim()[1])
        panel.set_xlim(left=0.0)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, handlelength=3.5)
    add_title(figure, title)
    return figure


def draw_time_series(results: Sequence[Result], path: Path, *, title: str = "") -> Path:
    """Mass, root mean square speeds and alignment at the saved times, one line a result.

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
    return save_figure(series_figure(results, title), path)
