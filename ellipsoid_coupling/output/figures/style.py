"""Sizes, fonts, colours and line styles of all figures."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap

from ellipsoid_coupling.models import LineStyle, find_kind
from ellipsoid_coupling.output.colours import axis_colours

# Sizes in inch; a panel's width, the height goes with the axes' aspect.
PANEL = 2.2
DOTS_PER_INCH = 150
# Letters in an inch of a figure's title, with a margin for wide letters.
LETTERS_PER_INCH = 10

# Width in inch of a legend's entry with the longest label.
LEGEND_ENTRY = 2.6

DENSITY_COLOURS = "viridis"
# The paper's own.
PAPER_COLOURS = "jet"
# A density behind lines, and how far the map is gone through: light enough for all of them.
PALE_COLOURS = "Greys"
PALE_RANGE = (0.0, 0.5)
# The range ends before the map's yellow, which is invisible on a white page.
SPEED_COLOURS = "plasma"
SPEED_RANGE = (0.0, 0.85)

# Any: matplotlib's type for it lists every key, and only in some versions.
SETTINGS: Any = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "figure.titlesize": 11.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "lines.markersize": 4.5,
    "text.usetex": False,
}


# Markers of the second, third, ... curve of one model in one panel; the first one has none.
REPEAT_MARKERS = ("", "o", "s", "^", "x")


def line_style(model: str) -> LineStyle:
    """The style that a model declares; grey dots if no model is registered under the name."""
    kind = find_kind(model)
    return LineStyle() if kind is None else kind.style


def curve_options(model: str, repeat: int, points: int) -> dict[str, Any]:
    """`Axes.plot` options of the `repeat`-th curve of a model, `points` long.

    Repetitions (another scheme or resolution) share the colour and carry sparse open markers.
    """
    style = line_style(model)
    spacing = max(1, points // 12)
    return {
        "color": style.colour,
        "linestyle": style.dashes,
        "marker": REPEAT_MARKERS[repeat % len(REPEAT_MARKERS)],
        "markevery": (repeat * spacing // 3, spacing),
        "markerfacecolor": "none",
    }


def axis_map() -> ListedColormap:
    """The colours of axes from -pi/2 to pi/2; both ends are one axis, and have one colour."""
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 256)
    return ListedColormap(axis_colours(angles), name="axis")


def part_of_map(name: str, ends: tuple[float, float]) -> ListedColormap:
    """One of matplotlib's maps from one part of it to another."""
    return ListedColormap(colormaps[name](np.linspace(*ends, 256)), name=f"part of {name}")
