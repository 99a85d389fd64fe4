"""Angle distributions: one panel a time, one line a result.

Axes have neither head nor tail: angles are counted modulo pi, from -pi/2 to pi/2. Where the scene's
angular potential tells heads from tails, they go around the whole turn.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ellipsoid_coupling.geometry import histograms
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
from ellipsoid_coupling.output.labels import long_labels
from ellipsoid_coupling.physics.angular import is_polar
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

# Height of a line of the legend, in inch.
_LEGEND_LINE = 0.16


class Circle(NamedTuple):
    """Where the angles of a figure begin, and after which angle they repeat."""

    cut: float
    turn: float


def angle_errors(result: Result, bins: int) -> Floats | None:
    """Standard errors of the angle distribution over realisations, (T, bins); None where there is one."""
    if result.layout != "particles" or result.variables["angle"].shape[1] < 2:
        return None
    frozen = result.frozen
    count = result.variables["angle"].shape[1]
    errors = np.zeros((result.times.size, bins))
    for t, angles in enumerate(result.variables["angle"]):
        each = [
            histograms.particle_angles(angles[r], bins, None if frozen is None else frozen[t, r])
            for r in range(count)
        ]
        errors[t] = np.std(each, axis=0, ddof=1) / math.sqrt(count)
    return errors


def folded(distribution: Floats) -> Floats:
    """A distribution (T, bins) over the whole turn as one over half of it, (T, bins/2); bins are even."""
    half = distribution.shape[1] // 2
    return np.asarray(distribution[:, :half] + distribution[:, half:])


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


def opened_circle(distribution: Floats, circle: Circle) -> tuple[Floats, Floats]:
    """Angles and values (bins + 2,) from one bin's centre before the cut to one a turn later."""
    bins = distribution.size
    width = circle.turn / bins
    first = math.floor(circle.cut / width + 1e-9) - 1
    index = np.arange(first, first + bins + 2)
    return np.asarray((index + 0.5) * width), distribution[np.mod(index, bins)]


@styled
def angle_figure(
    results: Sequence[Result], bins: int = 60, title: str = "", polar: bool | None = None
) -> Figure:
    """The figure of `draw_angles`; one axes a time, the legend below."""
    reached = [result for result in results if result.times.size]
    require(reached, "angle figure", "result with a saved time")
    if polar is None:
        polar = any(is_polar(result.scene.angular_potential) for result in reached)
    times = np.unique(np.concatenate([result.times for result in reached]))
    distributions = [result.angle_distribution(bins) for result in reached]
    errors = [angle_errors(result, bins) for result in reached]
    circle = Circle(cut_position(distributions), 2.0 * np.pi)
    if not polar:
        distributions = [folded(values) for values in distributions]
        # Both halves of one realisation hang together little: as if they did not.
        errors = [None if e is None else np.sqrt(folded(e**2)) for e in errors]
        circle = Circle(-0.5 * np.pi, np.pi)
    labels = long_labels(reached)
    width = 2.7 * len(times) + 0.6
    columns = max(1, int(width / LEGEND_ENTRY))
    lines = 1 + max(label.count("\n") for label in labels)
    below = _LEGEND_LINE * lines * math.ceil(len(reached) / columns)
    figure = new_figure(width, 2.9 + below)
    axes = panel_grid(figure, 1, len(times))[0]
    repeats: Counter[str] = Counter()
    for label, result, values, error in zip(labels, reached, distributions, errors, strict=True):
        options = curve_options(result.model, repeats[result.model], bins) | {"label": label}
        repeats[result.model] += 1
        for t, time in enumerate(result.times):
            panel = axes[int(np.argmin(np.abs(times - time)))]
            angles, density = opened_circle(values[t], circle)
            panel.plot(angles, density, **options)
            if error is not None:
                spread = opened_circle(error[t], circle)[1]
                low, high = np.maximum(density - spread, 0.0), density + spread
                panel.fill_between(angles, low, high, color=options["color"], alpha=0.25, lw=0)
    for time, panel in zip(times, axes, strict=True):
        _finish(panel, time, circle)
    axes[0].set_ylabel("probability density per rad")
    add_legend_below(figure, list(axes), labels, columns)
    bands = any(error is not None for error in errors)
    add_title(
        figure, f"{title}\nbands: standard error over realisations".strip() if bands else title
    )
    return figure


def add_legend_below(figure: Figure, panels: list[Axes], labels: list[str], columns: int) -> None:
    """One legend of all panels, of which any may lack a run; in the order of the labels."""
    handles = {
        label: handle
        for panel in panels
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    shown = [label for label in labels if label in handles]
    figure.legend(
        [handles[label] for label in shown],
        shown,
        loc="outside lower center",
        ncols=columns,
        handlelength=3.5,
    )


def _finish(panel: Axes, time: float, circle: Circle) -> None:
    limits = (circle.cut, circle.cut + circle.turn)
    name = "angle in rad" if circle.turn > np.pi else "angle of the axis in rad"
    panel.set(xlim=limits, xlabel=name, title=time_title(time))
    panel.set_ylim(bottom=0.0)
    show_multiples_of_pi(panel.xaxis, 0.25 * circle.turn / np.pi)


def draw_angles(
    results: Sequence[Result],
    path: Path,
    *,
    bins: int = 60,
    title: str = "",
    polar: bool | None = None,
) -> Path:
    """Angle distributions (probability density per radian) at the saved times.

    Parameters
    ----------
    results : any models; those without a saved time are left out
    path : the PNG
    bins : of the full turn, an even number
    title : str
    polar : the full turn, as heads and tails differ; or angles modulo pi, from -pi/2 to pi/2. None: as
        the angular potentials of the scenes tell

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    return save_figure(angle_figure(results, bins, title, polar), path)
