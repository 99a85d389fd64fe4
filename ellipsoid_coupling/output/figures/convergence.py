"""How a quantity falls with the number of particles."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ellipsoid_coupling.output.figures.canvas import (
    add_title,
    new_figure,
    require,
    save_figure,
    styled,
)
from ellipsoid_coupling.output.figures.style import line_style
from ellipsoid_coupling.output.labels import model_name


def fitted_slope(numbers: Sequence[int], values: Sequence[float]) -> float:
    """The exponent p of values ~ numbers^p by least squares of the logarithms."""
    return float(np.polyfit(np.log(numbers), np.log(values), 1)[0])


@styled
def convergence_figure(
    model: str, numbers: Sequence[int], values: Sequence[float], quantity: str, title: str = ""
) -> Figure:
    """The figure of `draw_convergence`."""
    require(numbers, "convergence figure", "number of particles")
    figure = new_figure(5.2, 4.0)
    axes = figure.subplots()
    slope = fitted_slope(numbers, values)
    style = line_style(model)
    axes.plot(numbers, values, "o", color=style.colour, label=model_name(model))
    middle = np.exp(np.mean(np.log(values)) - slope * np.mean(np.log(numbers)))
    line = middle * np.power(np.asarray(numbers, dtype=np.float64), slope)
    axes.plot(numbers, line, "--", color="0.4", label=f"N to the power {slope:.2f}")
    axes.set(xscale="log", yscale="log", xlabel="number of particles N", ylabel=quantity)
    axes.legend()
    add_title(figure, title)
    return figure


def draw_convergence(
    model: str,
    numbers: Sequence[int],
    values: Sequence[float],
    path: Path,
    *,
    quantity: str,
    title: str = "",
) -> Path:
    """Values over numbers of particles, log-log, with the fitted power.

    Parameters
    ----------
    model : the name of the model of particles
    numbers : of particles, rising
    values : positive
    path : the PNG
    quantity : name of the values' axis
    title : str

    Raises
    ------
    InputError
        Without numbers.
    """
    return save_figure(convergence_figure(model, numbers, values, quantity, title), path)
