"""The parts of each model's error as marks on a logarithmic axis, at the model's finest resolution.

No bars: on such an axis a bar's length depends on where the axis begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    panel_grid,
    require,
    save_figure,
    styled,
)

UNRESOLVED_CLOSURE = "closure, not resolved"


class _Mark(NamedTuple):
    """Marker and colour of a part; not those of the models, and told apart without colour."""

    marker: str
    colour: str
    filled: bool = True


_MARKS = {
    "discretisation": _Mark("s", "#4C6A92"),
    "closure": _Mark("o", "#B5482A"),
    UNRESOLVED_CLOSURE: _Mark("o", "#B5482A", filled=False),
    "finite N": _Mark("^", "#8A7F2D"),
    "sampling": _Mark("D", "#7F8FA3", filled=False),
}
# Smaller parts do not matter for an error of one per cent: they are drawn on the rim, as arrows.
_FLOOR = 1e-3
_RIM = 0.9 * _FLOOR
_GROUP = 0.84


class PartBars(NamedTuple):
    """One model, scheme and resolution.

    density, angle : part -> error, the parts named as in the legend; "total" among them
    """

    label: str
    density: dict[str, float]
    angle: dict[str, float]


@styled
def parts_figure(groups: Sequence[PartBars], title: str = "") -> Figure:
    """The figure of `draw_parts`."""
    require(groups, "parts figure", "run with error parts")
    figure = new_figure(10.0, 1.7 + 0.42 * len(groups))
    left, right = panel_grid(figure, 1, 2, sharey=True)[0]
    _draw_panel(left, [group.density for group in groups], "L1 error of the density")
    _draw_panel(right, [group.angle for group in groups], "L1 error of the angle distribution")
    left.set_yticks(range(len(groups)), [group.label for group in groups])
    left.invert_yaxis()
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    add_title(figure, f"{title}\n(arrows: below {_FLOOR:g})".strip())
    return figure


def _draw_panel(axes: Axes, groups: Sequence[dict[str, float]], name: str) -> None:
    axes.set_xscale("log")
    for part, mark in _MARKS.items():
        having = [(number, group) for number, group in enumerate(groups) if part in group]
        places = np.array([_place_in(number, group, part) for number, group in having])
        values = np.array([group[part] for _, group in having])
        small = values < _FLOOR
        shown = axes.plot(values[~small], places[~small], marker=mark.marker, label=part)
        if small.any():
            rim = np.full(small.sum(), _FLOOR)
            shown += axes.plot(rim, places[small], marker="<", clip_on=False)
        for line in shown:
            line.set(linestyle="none", color=mark.colour, markersize=5.5)
            line.set_markerfacecolor(mark.colour if mark.filled else "white")
    totals = np.array([group["total"] for group in groups])
    rows = np.arange(len(groups))
    axes.vlines(
        totals,
        rows - 0.5 * _GROUP,
        rows + 0.5 * _GROUP,
        color="black",
        linewidth=1.6,
        label="total",
    )
    for row in rows[1:]:
        axes.axhline(row - 0.5, color="0.9", linewidth=0.6, zorder=0)
    axes.grid(visible=True, axis="x", which="major", color="0.92", linewidth=0.6)
    axes.set(xlabel=name, xlim=(_RIM, 3.0), ylim=(-0.5, len(groups) - 0.5))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.tick_params(axis="y", length=0)


def _place_in(number: int, group: dict[str, float], part: str) -> float:
    """Where a part stands in the strip of its group, the parts below each other."""
    present = [known for known in _MARKS if known in group]
    height = _GROUP / len(present)
    return number - 0.5 * _GROUP + height * (present.index(part) + 0.5)


def draw_parts(groups: Sequence[PartBars], path: Path, *, title: str = "") -> Path:
    """The parts of each group's error as marks on a logarithmic axis, the total as a black line.

    An arrow at the left rim stands for a part below 0.001.

    Parameters
    ----------
    groups : from top to bottom
    path : the PNG
    title : str

    Raises
    ------
    InputError
        Without groups.
    """
    return save_figure(parts_figure(groups, title), path)
