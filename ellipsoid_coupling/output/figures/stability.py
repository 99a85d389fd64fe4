"""The stability map: cases, or groups of them, against models and schemes.

Outcome and error as colour and number.
"""

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
_WIDTH, _HEIGHT = 0.4, 0.185
_NAMES, _HEAD, _TITLE, _LEGEND, _RIM = 1.95, 0.95, 0.25, 0.75, 0.4
# Of the legend's height, what the definition of the error below it takes.
_DEFINITION = 0.3
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


def look_of_group(entries: Sequence[MapEntry]) -> _Look:
    """Of all cases of a group: how many did not hold, or the largest error of all."""
    there = [entry for entry in entries if entry.outcome != "not applicable"]
    if not there:
        return _ENDED["not applicable"]
    failed = [entry for entry in there if entry.outcome in ("stopped", "broken")]
    if failed:
        worst = "broken" if any(e.outcome == "broken" for e in failed) else "stopped"
        return _ENDED[worst]._replace(words=f"{len(failed)} of {len(there)}")
    known = [e for e in there if e.outcome not in _ENDED and math.isfinite(e.error)]
    if known:
        return look_of(max(known, key=lambda entry: entry.error))
    return look_of(there[0])


def _short(error: float) -> str:
    """0, 3e-5, 0.02, 0.3, 1.2: never more than five letters."""
    if error < 1e-12:
        return "0"
    if error >= 0.01:
        return f"{error:.1g}" if error < 0.995 else f"{error:.1f}"
    return f"{error:.0e}".replace("e-0", "e-")


def _legend_patches(grouped: bool) -> list[Patch]:
    bounds = ("0", *(f"{bound:g}" for bound in _DECADES), "2")
    words = [f"error {low} to {high}" for low, high in itertools.pairwise(bounds)]
    named = {
        "bad in.": "refused: bad input",
        "-": "means nothing here",
        "stop": "stopped: so many" if grouped else "stopped; dt: step it would need",
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


class _Row(NamedTuple):
    """A line of the map: its name, the varied quantity, and the cases that it stands for."""

    name: str
    family: str
    cases: tuple[str, ...]


def _rows(entries: Sequence[MapEntry], grouped: bool) -> list[_Row]:
    """A row a case, or one for all cases of a quantity, as many as there are in brackets."""
    families = {entry.case: entry.family for entry in entries}
    if not grouped:
        return [_Row(case, family, (case,)) for case, family in families.items()]
    members: dict[str, list[str]] = {}
    for case, family in families.items():
        members.setdefault(family, []).append(case)
    return [
        _Row(
            cases[0] if len(cases) == 1 else f"{family.removesuffix(' =')} ({len(cases)})",
            family,
            tuple(cases),
        )
        for family, cases in members.items()
    ]


@styled
def stability_figure(
    entries: Sequence[MapEntry], title: str = "", *, grouped: bool = False
) -> Figure:
    """The figure of `draw_stability`."""
    require(entries, "stability map", "run")
    rows = _rows(entries, grouped)
    columns = list(dict.fromkeys((entry.model, entry.scheme) for entry in entries))
    head = _HEAD + (_TITLE if title else 0.0)
    width = _NAMES + _WIDTH * len(columns) + _RIM
    height = head + _LEGEND + _HEIGHT * len(rows)
    figure = new_figure(width, height)
    figure.set_layout_engine("none")
    left, low = _NAMES / width, _LEGEND / height
    shape = (_WIDTH * len(columns) / width, _HEIGHT * len(rows) / height)
    axes = figure.add_axes((left, low, *shape))
    axes.set(xlim=(0, len(columns)), ylim=(len(rows), 0))
    for y, row in enumerate(rows):
        for x, column in enumerate(columns):
            chosen = [e for e in entries if (e.model, e.scheme) == column and e.case in row.cases]
            if chosen:
                look = look_of_group(chosen) if grouped else look_of(chosen[0])
                _draw_entry(axes, (x, y), look)
    _label(axes, rows, columns, ruled=not grouped)
    if title:
        figure.suptitle(title, y=1.0 - 0.12 / height, va="top")
    figure.legend(
        handles=_legend_patches(grouped),
        loc="lower center",
        bbox_to_anchor=(0.5, _DEFINITION / height),
        ncols=5,
        fontsize=6.5,
        handlelength=1.0,
        columnspacing=1.0,
    )
    what = "the largest of a group's, or how many of its cases did not hold" if grouped else ""
    _define(figure, what)
    return figure


def _define(figure: Figure, what: str) -> None:
    """What an error is, below the legend."""
    lines = (
        f"Error{f' ({what})' if what else ''}: the larger of the mean distance by which mass lies off "
        "along x or y, in widths of the domain,",
        r"and the difference of $\langle e^{2 i \theta} \rangle$ (0 to 2), against the model's own scheme "
        "accurate, much refined.",
    )
    figure.text(0.5, 0.06 / figure.get_figheight(), "\n".join(lines), fontsize=6.5, ha="center")


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
    axes: Axes, rows: Sequence[_Row], columns: list[tuple[str, str]], *, ruled: bool
) -> None:
    axes.set_yticks([row + 0.5 for row in range(len(rows))], [r.name for r in rows], fontsize=7.5)
    axes.tick_params(length=0, top=True, labeltop=True, bottom=False, labelbottom=False)
    axes.set_xticks(
        [column + 0.5 for column in range(len(columns))],
        [scheme for _, scheme in columns],
        rotation=45,
        ha="left",
        fontsize=7.0,
    )
    for y, (before, row) in enumerate(itertools.pairwise(rows)):
        if ruled and before.family != row.family:
            axes.axhline(y + 1, color="black", linewidth=0.5)
    for column, (model, _) in enumerate(columns):
        if column == 0 or columns[column - 1][0] != model:
            axes.axvline(column, color="black", linewidth=0.8)
            count = sum(name == model for name, _ in columns)
            name = model_name(model).replace(", ", ",\n").replace(" ", "\n", 1)
            axes.annotate(
                name.replace("\n\n", "\n"),
                (column + 0.5 * count, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0.0, 36.0),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=7.0,
            )


def draw_stability(
    entries: Sequence[MapEntry], path: Path, *, title: str = "", grouped: bool = False
) -> Path:
    """Cases as rows, models and schemes as columns; the error's decade as colour, and its number.

    Parameters
    ----------
    entries : such as `compare.stability.MapEntry`
    path : the PNG
    title : str
    grouped : one row for all cases that vary one quantity, with their largest error, or how many of them
        did not hold; narrow enough to be read on a page

    Raises
    ------
    InputError
        Without entries.
    """
    return save_figure(stability_figure(entries, title, grouped=grouped), path)
