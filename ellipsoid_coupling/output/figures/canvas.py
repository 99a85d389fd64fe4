"""Figures without global state: made, styled and written here, never shown."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from functools import wraps
from io import BytesIO
from pathlib import Path
from typing import Literal, ParamSpec
from warnings import catch_warnings, filterwarnings

import numpy as np
from matplotlib import rc_context, rcdefaults, rcParams
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.writing import whole_file
from ellipsoid_coupling.output.figures.style import DOTS_PER_INCH, LETTERS_PER_INCH, SETTINGS
from ellipsoid_coupling.output.labels import literal

P = ParamSpec("P")
# More would leave no room for the panels.
_MOST_TITLE_LINES = 5
# Small print: its size in points, the height of a line and of the rim in inch, letters in an inch.
_SMALL_LETTERS, _SMALL_LINE, _STRIP_RIM, _SMALL_LETTERS_PER_INCH = 6.5, 0.115, 0.1, 18
Extent = tuple[float, float, float, float]
Layout = Literal["constrained", "compressed"]


@contextmanager
def settings() -> Iterator[None]:
    """The package's settings over matplotlib's own, whatever a user's matplotlibrc says.

    Letters that the font does not have, such as an emoji in a title, are drawn as boxes, in silence.
    """
    with rc_context(), catch_warnings():
        rcdefaults()
        rcParams.update(SETTINGS)
        filterwarnings("ignore", message=r"Glyph \d+ ", category=UserWarning)
        yield


def styled(build: Callable[P, Figure]) -> Callable[P, Figure]:
    """Build a figure under `settings`."""

    @wraps(build)
    def under_settings(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with settings():
            return build(*args, **kwargs)

    return under_settings


class ShownFigure(Figure):
    """A figure that a notebook shows by itself, without matplotlib.pyplot."""

    def _repr_png_(self) -> bytes:
        memory = BytesIO()
        with settings():
            self.savefig(memory, format="png", dpi=DOTS_PER_INCH / 2)
        return memory.getvalue()


def new_figure(width: float, height: float, layout: Layout = "constrained") -> Figure:
    """An empty figure of that size in inch, on a canvas that needs no display."""
    figure = ShownFigure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def panel_grid(
    figure: Figure, rows: int, columns: int, *, sharex: bool = False, sharey: bool = False
) -> NDArray[np.object_]:
    """Axes (rows, columns), always two-dimensional."""
    return np.asarray(figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey))


def add_title(figure: Figure, title: str) -> None:
    """A title above all panels, wrapped to the figure's width; none for an empty text."""
    if title:
        figure.suptitle(wrapped(figure, title))


def wrapped(figure: Figure, title: str) -> str:
    """A title as it stands, in lines that fit the figure's width."""
    width = int(LETTERS_PER_INCH * figure.get_figwidth())
    lines = [part for line in title.splitlines() for part in textwrap.wrap(line, width)]
    if len(lines) > _MOST_TITLE_LINES:
        lines = [*lines[: _MOST_TITLE_LINES - 1], "..."]
    return literal("\n".join(lines))


def add_details(figure: Figure, lines: Sequence[str]) -> None:
    """Small print in a strip below all panels, for which the figure grows; nothing without lines.

    Not for figures with a legend below, which would stand in the same place. Lines are drawn as they
    stand: text of users goes through `labels.literal`.
    """
    engine = figure.get_layout_engine()
    if not lines or not isinstance(engine, ConstrainedLayoutEngine):
        return
    width = int(_SMALL_LETTERS_PER_INCH * figure.get_figwidth())
    parts = [part for line in lines for part in textwrap.wrap(line, width, subsequent_indent="  ")]
    strip = _SMALL_LINE * len(parts) + _STRIP_RIM
    height = figure.get_figheight() + strip
    figure.set_figheight(height)
    engine.set(rect=(0.0, strip / height, 1.0, 1.0 - strip / height))
    figure.text(
        _STRIP_RIM / figure.get_figwidth(),
        0.5 * _STRIP_RIM / height,
        "\n".join(parts),
        fontsize=_SMALL_LETTERS,
        color="0.35",
        va="bottom",
        linespacing=1.2,
    )


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a PNG of the figure's own size; the file is whole or not there."""
    with settings(), whole_file(Path(path)) as beside:
        figure.savefig(beside, format="png", dpi=DOTS_PER_INCH)
    return Path(path)


def require(items: Sequence[object], figure: str, what: str) -> None:
    """Raise InputError where there is nothing to draw."""
    if not items:
        raise InputError(figure, f"at least one {what}", "none", f"Give a {what} to draw.")


def show_domain(axes: Axes, extent: Extent) -> None:
    """Limits (x_low, x_high, y_low, y_high), equal scales and few ticks."""
    axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal")
    axes.xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))


def show_multiples_of_pi(axis: Axis, step: float = 0.5) -> None:
    """Ticks at multiples of `step` times pi, written as such."""
    axis.set_major_locator(MultipleLocator(step * np.pi))
    axis.set_major_formatter(FuncFormatter(lambda value, _: multiple_of_pi(value)))


def multiple_of_pi(value: float) -> str:
    """A multiple of pi/4 in mathtext, "0" or such as "3 pi / 2"."""
    part = Fraction(round(value / (0.25 * np.pi)), 4)
    if part == 0:
        return "0"
    below = "" if part.denominator == 1 else f"/{part.denominator}"
    factor = {1: "", -1: "-"}.get(part.numerator, str(part.numerator))
    return f"${factor}\\pi{below}$"


def say_in(axes: Axes, text: str) -> None:
    """A note in the middle of a panel that shows nothing."""
    axes.text(0.5, 0.5, text, ha="center", va="center", transform=axes.transAxes)


def time_title(time: float) -> str:
    """The title of a panel at one time."""
    return f"t = {time:g}"
