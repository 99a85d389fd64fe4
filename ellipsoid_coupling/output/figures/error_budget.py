"""The parts of each model's error as bars, at the model's finest resolution."""

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

# Told apart in grey print too; not those of the models.
UNRESOLVED_CLOSURE = "closure, not resolved"
_COLOURS = {
    "discretisation": "#4C6A92",
    "closure": "#B5482A",
    UNRESOLVED_CLOSURE: "#EBCFC5",
    "finite N": "#8A7F2D",
    "sampling": "#A9B4C2",
}
# Bars start here: smaller parts do not matter for an error of one per cent.
_FLOOR = 1e-3
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
    figure = new_figure(10.0, 1.5 + 0.42 * len(groups))
    left, right = panel_grid(figure, 1, 2, sharey=True)[0]
    _draw_panel(left, [group.density for group in groups], "L1 error of the density")
    _draw_panel(right, [group.angle for group in groups], "L1 error of the angle distribution")
    left.set_yticks(range(len(groups)), [group.label for group in groups])
    left.invert_yaxis()
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    add_title(figure, title)
    return figure


def _draw_panel(axes: Axes, groups: Sequence[dict[str, float]], name: str) -> None:
    axes.set_xscale("log")
    for part, colour in _COLOURS.items():
        for number, group in enumerate(groups):
            present = [known for known in _COLOURS if known in group]
            if part in present:
                height = _GROUP / len(present)
                top = number - 0.5 * _GROUP + height * (present.index(part) + 0.5)
                value = group[part]
                axes.barh(top, max(value, _FLOOR) - _FLOOR, height, left=_FLOOR, color=colour)
        # An empty bar names the part in the legend, whichever groups have it.
        axes.barh(0.0, 0.0, left=_FLOOR, color=colour, label=part)
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
    axes.set(xlabel=name, xlim=(_FLOOR, 3.0))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.tick_params(axis="y", length=0)


def draw_parts(groups: Sequence[PartBars], path: Path, *, title: str = "") -> Path:
    """The parts of each group's error side by side on a logarithmic axis, the total as a black line.

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
