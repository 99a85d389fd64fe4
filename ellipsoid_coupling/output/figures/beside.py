"""Text that stands upright beside panels, in lines that fit where the panels are flat."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Inch of a letter of labels, on the mean; and the part of a figure's height that a label may take.
_LETTER, _PART = 0.066, 0.7
# Inch between the lines of labels.
_LINE = 0.15
# Shorter lines would leave single words.
_SHORTEST = 12


def in_height(figure: Figure, text: str) -> str:
    """A text that will stand upright beside a bar, in lines that fit the figure's height."""
    width = max(_SHORTEST, int(_PART * figure.get_figheight() / _LETTER))
    return "\n".join(part for line in text.splitlines() for part in textwrap.wrap(line, width))


class RowLabels(NamedTuple):
    """The labels of rows of panels, one below the other.

    Attributes
    ----------
    texts : tuple of str
    upright : bool
        Whether they stand upright; lying, where one is longer than its row is high.
    room : float
        The width that they take, in inch.
    """

    texts: tuple[str, ...]
    upright: bool
    room: float

    def add(self, row: int, axes: Axes) -> None:
        """Put the label of a row beside its first panel, with the name of the axis."""
        if self.upright:
            axes.set_ylabel(f"{self.texts[row]}\n\ny")
        else:
            axes.set_ylabel(f"{self.texts[row]}\ny", rotation=0.0, ha="right", va="center")


def row_labels(labels: Sequence[str], height: float, lying: Sequence[str] = ()) -> RowLabels:
    """Labels for rows whose panels have this height, in inch.

    lying : the same for labels that lie, if these have other lines
    """
    if _LETTER * _longest(labels) <= height:
        lines = max(label.count("\n") for label in labels) + 1
        return RowLabels(tuple(labels), True, _LINE * lines)
    texts = tuple(lying or labels)
    if height < _LINE * (max(text.count("\n") for text in texts) + 2):
        texts = tuple(text.replace("\n", ", ") for text in texts)
    return RowLabels(texts, False, _LETTER * _longest(texts))


def _longest(labels: Sequence[str]) -> int:
    return max(len(line) for label in labels for line in label.splitlines() or [""])
