"""The stability map: cases against models and schemes, outcome and error as colour and number."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from ellipsoid_coupling.output.figures.canvas import new_figure, require, save_figure, styled
from ellipsoid_coupling.output.labels import model_name

# Inch: an entry, the names of the cases beside it, and the titles above and the legend below.
_WIDTH, _HEIGHT = 0.47, 0.185
_NAMES, _HEAD, _LEGEND, _RIM = 2.5, 1.2, 0.75, 0.5
_LETTERS = 6.5

# Errors by decade, light for small; "cividis" stays in order for every kind of colour blindness.
_DECADES = (1e-4, 1e-3, 1e-2, 1e-1)
_SHADES = tuple(to_hex(colormaps["cividis"](part)) for part in (0.98, 0.8, 0.62, 0.42, 0.2))
_DARK_FROM = 3


class MapEntry(Protocol):
    """One run of the map, such as `compare.stability.MapEntry`."""

    @property
    def family(self) -> str:
        """The varied quantity."""
        ...

    @property
    def case(self) -> str:
        """The varied quantity and its value."""
        ...

    @property
    def model(self) -> str:
        """Name of the model."""
        ...

    @property
    def scheme(self) -> str:
        """Name of the scheme."""
        ...

    @property
    def outcome(self) -> str:
        """Completed, broken, stopped, refused or not applicable."""
        ...

    @property
    def error(self) -> float:
        """NaN where it is not known."""
        ...

    @property
    def needed_step(self) -> float:
        """The step that a run which stopped would need; NaN where it is not known."""
        ...


class _Look(NamedTuple):
    """How an entry is drawn."""

    fill: str
    letters: str
    words: str


_ENDED = {
    "stopped": _Look("#D55E00", "white", "stop"),
    "broken": _Look("#CC79A7", "black", "broken"),
    "refused": _Look("#BBBBBB", "black", "bad in."),
    "not applicable": _Look("white", "#888888", "-"),
}
_UNKNOWN = _Look("#FFFFFF", "black", "?")


def look_of(entry: MapEntry) -> _Look:
    """Fill, colour of the letters and words of an entry."""
    if entry.outcome == "stopped" and math.isfinite(entry.needed_step):
        words = f"dt {entry.needed_step:.0e}".replace("e-0", "e-")
        return _ENDED["stopped"]._replace(words=words)
    if entry.outcome in _ENDED:
        return _ENDED[entry.outcome]
    if not math.isfinite(entry.error):
        return _UNKNOWN
    decade = sum(entry.error > bound for bound in _DECADES)
    letters = "white" if decade >= _DARK_FROM else "black"
    return _Look(_SHADES[decade], letters, _short(entry.error))


def _short(error: float) -> str:
    """0, 3e-5, 0.02, 0.3, 1.2: never more than five letters."""
    if error < 1e-12:
        return "0"
    if error >= 0.01:
        return f"{error:.1g}" if error < 0.995 else f"{error:.1f}"
    return f"{error:.0e}".replace("e-0", "e-")


def _legend_patches() -> list[Patch]:
    bounds = ("0", *(f"{bound:g}" for bound in _DECADES), "2")
    words = [f"error {low} to {high}" for low, high in itertools.pairwise(bounds)]
    named = {
        "bad in.": "refused: bad input",
        "-": "means nothing here",
        "stop": "stopped; dt: step it would need",
    }
    patches = [
        Patch(facecolor=shade, edgecolor="#666666", label=word)
        for shade, word in zip(_SHADES, words, strict=True)
    ]
    patches += [
        Patch(facecolor=look.fill, edgecolor="#666666", label=named.get(look.words, look.words))
        for look in _ENDED.values()
    ]
    return [*patches, Patch(facecolor="white", edgecolor="#666666", label="?: no reference")]


@styled
def stability_figure(entries: Sequence[MapEntry], title: str = "") -> Figure:
    """The figure of `draw_stability`."""
    require(entries, "stability map", "run")
    cases = list(dict.fromkeys(entry.case for entry in entries))
    columns = list(dict.fromkeys((entry.model, entry.scheme) for entry in entries))
    width = _NAMES + _WIDTH * len(columns) + _RIM
    height = _HEAD + _LEGEND + _HEIGHT * len(cases)
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    left, low = _NAMES / width, _LEGEND / height
    shape = (_WIDTH * len(columns) / width, _HEIGHT * len(cases) / height)
    axes = figure.add_axes((left, low, *shape))
    axes.set(xlim=(0, len(columns)), ylim=(len(cases), 0))
    for entry in entries:
        corner = columns.index((entry.model, entry.scheme)), cases.index(entry.case)
        _draw_entry(axes, corner, look_of(entry))
    _label(axes, entries, cases, columns)
    if title:
        figure.suptitle(title, y=1.0 - 0.12 / height, va="top")
    figure.legend(
        handles=_legend_patches(), loc="lower center", ncols=5, fontsize=7.5, handlelength=1.2
    )
    return figure


def _draw_entry(axes: Axes, corner: tuple[int, int], look: _Look) -> None:
    axes.add_patch(Rectangle(corner, 1, 1, facecolor=look.fill, edgecolor="white", linewidth=0.5))
    axes.text(
        corner[0] + 0.5,
        corner[1] + 0.53,
        look.words,
        color=look.letters,
        fontsize=_LETTERS,
        ha="center",
        va="center",
    )


def _label(
    axes: Axes, entries: Sequence[MapEntry], cases: list[str], columns: list[tuple[str, str]]
) -> None:
    axes.set_yticks([row + 0.5 for row in range(len(cases))], cases, fontsize=7.5)
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.set_xticks(
        [column + 0.5 for column in range(len(columns))],
        [scheme for _, scheme in columns],
        rotation=45,
        ha="left",
        fontsize=7.5,
    )
    families = {entry.case: entry.family for entry in entries}
    for row, (before, case) in enumerate(itertools.pairwise(cases)):
        if families[before] != families[case]:
            axes.axhline(row + 1, color="black", linewidth=0.5)
    for column, (model, _) in enumerate(columns):
        if column == 0 or columns[column - 1][0] != model:
            axes.axvline(column, color="black", linewidth=0.8)
            count = sum(name == model for name, _ in columns)
            name = model_name(model).replace(", ", ",\n").replace(" ", "\n", 1)
            axes.annotate(
                name.replace("\n\n", "\n"),
                (column + 0.5 * count, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0.0, 44.0),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=8,
            )


def draw_stability(entries: Sequence[MapEntry], path: Path, *, title: str = "") -> Path:
    """Cases as rows, models and schemes as columns; the error's decade as colour, and its number.

    Parameters
    ----------
    entries : such as `compare.stability.MapEntry`
    path : the PNG
    title : str

    Raises
    ------
    InputError
        Without entries.
    """
    return save_figure(stability_figure(entries, title), path)
