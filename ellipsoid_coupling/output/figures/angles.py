"""Angle distributions: one panel a time, one line a result."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    panel_grid,
    require,
    save_figure,
    show_multiples_of_pi,
    styled,
    time_title,
)
from ellipsoid_coupling.output.figures.style import LEGEND_ENTRY, curve_options
from ellipsoid_coupling.output.labels import result_labels
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]


def cut_position(distributions: Sequence[Floats]) -> float:
    """Where the circle is cut open, 0 or -pi: where less of the distributions lies.

    distributions : arrays (T, bins) on [0, 2 pi)
    """
    at_zero = at_pi = 0.0
    for distribution in distributions:
        bins = distribution.shape[1]
        reach = max(1, bins // 8)
        turned = np.roll(distribution, reach, axis=1)
        at_zero += float(turned[:, : 2 * reach].sum()) / bins
        at_pi += float(np.roll(turned, -(bins // 2), axis=1)[:, : 2 * reach].sum()) / bins
    return -np.pi if at_zero > at_pi else 0.0


def opened_circle(distribution: Floats, cut: float) -> tuple[Floats, Floats]:
    """Angles and values (bins + 2,) from one bin's centre before the cut to one a turn later."""
    bins = distribution.size
    width = 2.0 * np.pi / bins
    first = round(cut / width) - 1
    index = np.arange(first, first + bins + 2)
    return np.asarray((index + 0.5) * width), distribution[np.mod(index, bins)]


@styled
def angle_figure(results: Sequence[Result], bins: int = 60, title: str = "") -> Figure:
    """The figure of `draw_angles`; one axes a time, the legend below."""
    reached = [result for result in results if result.times.size]
    require(reached, "angle figure", "result with a saved time")
    times = np.unique(np.concatenate([result.times for result in reached]))
    distributions = [result.angle_distribution(bins) for result in reached]
    cut = cut_position(distributions)
    width = 2.7 * len(times) + 0.6
    columns = max(1, int(width / LEGEND_ENTRY))
    figure = new_figure(width, 2.9 + 0.18 * math.ceil(len(reached) / columns))
    axes = panel_grid(figure, 1, len(times))[0]
    repeats: Counter[str] = Counter()
    for label, result, values in zip(result_labels(reached), reached, distributions, strict=True):
        options = curve_options(result.model, repeats[result.model], bins) | {"label": label}
        repeats[result.model] += 1
        for time, distribution in zip(result.times, values, strict=True):
            panel = axes[int(np.argmin(np.abs(times - time)))]
            panel.plot(*opened_circle(distribution, cut), **options)
    for time, panel in zip(times, axes, strict=True):
        _finish(panel, time, cut)
    axes[0].set_ylabel("probability density")
    # A panel may lack runs that did not save its time: the handles come from all, in the runs' order.
    handles = {
        label: handle
        for panel in axes
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    labels = [label for label in result_labels(reached) if label in handles]
    figure.legend(
        [handles[label] for label in labels],
        labels,
        loc="outside lower center",
        ncols=columns,
        handlelength=3.5,
    )
    add_title(figure, title)
    return figure


def _finish(panel: Axes, time: float, cut: float) -> None:
    panel.set(xlim=(cut, cut + 2.0 * np.pi), xlabel="angle", title=time_title(time))
    panel.set_ylim(bottom=0.0)
    show_multiples_of_pi(panel)


def draw_angles(results: Sequence[Result], path: Path, *, bins: int = 60, title: str = "") -> Path:
    """Angle distributions (probability density per radian) at the saved times.

    Parameters
    ----------
    results : any models; those without a saved time are left out
    path : the PNG
    bins : of the full turn
    title : str

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return save_figure(angle_figure(results, bins, title), path)
