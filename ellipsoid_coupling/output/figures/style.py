"""Sizes, fonts, colours and line styles of all figures, in one place."""

from __future__ import annotations

from typing import Any, NamedTuple

# Sizes in inch; a panel's width, the height goes with the axes' aspect.
PANEL = 2.2
DOTS_PER_INCH = 150
# Of a figure's title, wide letters allowed for.
LETTERS_PER_INCH = 10

# Inch that a legend's entry takes, the longest labels included.
LEGEND_ENTRY = 2.6

DENSITY_COLOURS = "viridis"
# Cut off before its yellow, which a white page swallows.
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


class LineStyle(NamedTuple):
    """How one model is drawn everywhere: told apart by colour, and by dashes or marker without."""

    colour: str
    dashes: Any
    marker: str


# Colours that stay apart for colour-blind readers (Okabe and Ito).
_STYLES = {
    "microscopic": LineStyle("#0072B2", "-", "o"),
    "mckean_vlasov": LineStyle("#000000", (0, (1, 1)), "*"),
    "q_maxwellian": LineStyle("#E69F00", (0, (3, 1, 1, 1, 1, 1)), "D"),
    "q_mono_kinetic": LineStyle("#009E73", (0, (5, 1, 1, 1)), "s"),
    "rho_mono_kinetic": LineStyle("#D55E00", (0, (4, 1.5)), "^"),
    "diffusive": LineStyle("#CC79A7", (0, (2, 1)), "v"),
    "stationary_state": LineStyle("#56B4E9", (0, (6, 2)), "P"),
}
_OTHER = LineStyle("#555555", (0, (1, 2)), "X")

# Markers of the second, third, ... curve of one model in one panel; the first one has none.
REPEAT_MARKERS = ("", "o", "s", "^", "x")


def line_style(model: str) -> LineStyle:
    """The style of a model; grey dots for one that the table does not know."""
    return _STYLES.get(model, _OTHER)


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
