"""Advice against full comparisons: the errors that were promised, and what keeping them costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    require,
    save_figure,
    styled,
)
from ellipsoid_coupling.output.labels import literal

# Smaller errors are drawn here: some angles are exact to rounding.
_LEAST = 1e-3
# Rows are 1 apart, the quantities of a row so far.
_APART = 0.3


class AdviceMark(NamedTuple):
    """One promise: the error asked for, expected and found, and seconds over the cheapest run's.

    case : its row in the figure; quantity : "density" or "angle", beside one another in a row
    """

    asked: float
    expected: float
    found: float
    cost_ratio: float
    case: str
    quantity: str


@styled
def advice_figure(marks: Sequence[AdviceMark], title: str = "") -> Figure:
    """The figure of `draw_advice`."""
    require(marks, "figure of advice", "promise")
    cases = list(dict.fromkeys(mark.case for mark in marks))
    figure = new_figure(9.0, 1.6 + 0.32 * len(cases))
    errors, costs = figure.subplots(1, 2, sharey=True)
    _show_cases(errors, cases)
    quantities = list(dict.fromkeys(mark.quantity for mark in marks))
    middle = 0.5 * (len(quantities) - 1)
    apart = {name: _APART * (k - middle) for k, name in enumerate(quantities)}
    for asked, colour in zip(
        sorted({mark.asked for mark in marks}, reverse=True),
        ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#555555"),
        strict=False,
    ):
        some = [mark for mark in marks if mark.asked == asked]
        rows = [cases.index(m.case) + apart[m.quantity] for m in some]
        label = f"asked for {asked:g}"
        errors.plot(
            [max(m.found, _LEAST) for m in some], rows, "o", color=colour, label=f"{label}: found"
        )
        expected = [max(m.expected, _LEAST) for m in some]
        errors.plot(expected, rows, "|", color=colour, markersize=12, label=f"{label}: expected")
        errors.axvline(asked, color=colour, linewidth=0.8, linestyle="--")
        ratios = [max(m.cost_ratio, 1e-3) for m in some]
        costs.plot(ratios, rows, "o", color=colour, label=label)
    errors.set(
        xscale="log", xlabel=f"largest L1 error; in each row, downwards: {', '.join(quantities)}"
    )
    errors.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    errors.xaxis.set_major_formatter("{x:g}")
    errors.xaxis.set_minor_formatter(NullFormatter())
    costs.set(xscale="log", xlabel="seconds over those of the cheapest run that keeps it")
    costs.axvline(2.0, color="0.4", linewidth=0.8, linestyle="--")
    highest = max(2.5, *(m.cost_ratio for m in marks if np.isfinite(m.cost_ratio)))
    costs.set_xlim(0.8, 1.15 * highest)
    costs.set_xticks([1, 2, 3, 5] if highest < 6.0 else [1, 2, 5, 10], minor=False)
    costs.xaxis.set_major_formatter("{x:g}")
    costs.xaxis.set_minor_formatter(NullFormatter())
    errors.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
    costs.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
    add_title(figure, title)
    return figure


def _show_cases(axes: Axes, cases: Sequence[str]) -> None:
    axes.set_yticks(range(len(cases)), [literal(case) for case in cases])
    axes.set_ylim(len(cases) - 0.5, -0.5)


def draw_advice(marks: Sequence[AdviceMark], path: Path, *, title: str = "") -> Path:
    """Errors found and expected against those asked for, and the price, a row for each case.

    Errors below a thousandth are drawn at a thousandth.

    Parameters
    ----------
    marks : the promises
    path : the PNG
    title : str

    Raises
    ------
    InputError
        Without promises.
    """
    return save_figure(advice_figure(marks, title), path)
