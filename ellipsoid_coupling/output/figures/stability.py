"""The stability map: cases against models and schemes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from ellipsoid_coupling.output.figures.canvas import new_figure, require, save_figure, styled
from ellipsoid_coupling.output.labels import model_name

# Readable without colour too: every field carries its word.
VERDICTS = ("stable", "unstable", "failed")
COLOURS = ("#a6dba0", "#fee391", "#f4a582")


class MapCell(Protocol):
    """One run of the map, such as `compare.stability.StabilityCell`."""

    @property
    def case(self) -> str:
        """What was changed."""
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
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        ...

    @property
    def fastest(self) -> float:
        """Largest speed."""
        ...


@styled
def stability_figure(cells: Sequence[MapCell], title: str = "Stability") -> Figure:
    """The figure of `draw_stability`."""
    require(cells, "stability map", "run")
    cases = list(dict.fromkeys(cell.case for cell in cells))
    columns = list(dict.fromkeys((cell.model, cell.scheme) for cell in cells))
    figure = new_figure(3.2 + 1.35 * len(columns), 1.3 + 0.36 * len(cases))
    axes = figure.subplots()
    verdicts = np.full((len(cases), len(columns)), np.nan)
    for cell in cells:
        row, column = cases.index(cell.case), columns.index((cell.model, cell.scheme))
        verdicts[row, column] = VERDICTS.index(cell.verdict)
        words = cell.verdict if cell.verdict == "failed" else f"{cell.verdict}, {cell.fastest:.2g}"
        axes.text(column, row, words, ha="center", va="center")
    axes.imshow(verdicts, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=2.5, aspect="auto")
    axes.set_yticks(range(len(cases)), cases)
    labels = [f"{model_name(model)}\n{scheme}" for model, scheme in columns]
    axes.set_xticks(range(len(columns)), labels)
    axes.set_title(f"{title} (number: largest speed)")
    return figure


def draw_stability(cells: Sequence[MapCell], path: Path, *, title: str = "Stability") -> Path:
    """Cases as rows, models and schemes as columns; the verdict in words and colour.

    Parameters
    ----------
    cells : such as `compare.stability.StabilityCell`
    path : the PNG
    title : str

    Raises
    ------
    InputError
        Without cells.
    """
    return save_figure(stability_figure(cells, title), path)
