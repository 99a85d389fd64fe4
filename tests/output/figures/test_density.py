"""Density panels: layout, common colours, axis order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.figures import (
    PAPER_COLOURS,
    DensityRow,
    common_maximum,
    density_rows,
    draw_density,
)
from ellipsoid_coupling.output.figures.density import Scale, density_figure
from ellipsoid_coupling.output.figures.style import DOTS_PER_INCH
from ellipsoid_coupling.result import Result


def limits(figure: Figure) -> list[list[tuple[float, float]]]:
    """Colour limits of the panels, by columns."""
    images = [axes.images[0].get_clim() for axes in figure.axes if axes.images]
    return [images[0::2], images[1::2]]


def test_rows_of_particles_and_grids(particle_result: Result, rho_result: Result) -> None:
    rows = density_rows([particle_result, rho_result], cells=20)
    labels = ["microscopic\nhistogram", "microscopic\nsmoothed", "rho, mono-kinetic"]
    assert [row.label for row in rows] == labels
    assert [row.density.shape for row in rows] == [(2, 20, 20), (2, 20, 20), (2, 6, 8)]
    # Smoothing keeps the mass: all of it is inside.
    np.testing.assert_allclose(rows[0].density.sum(), rows[1].density.sum(), rtol=1e-12)
    assert rows[0].noisy
    assert not rows[2].noisy
    few = density_rows([particle_result], cells=2, histograms=True)
    assert not few[0].noisy
    assert len(density_rows([particle_result], histograms=False)) == 1


@pytest.mark.parametrize("scale", ["time", "figure"])
def test_compared_panels_share_their_colours(
    particle_result: Result, rho_result: Result, scale: Scale
) -> None:
    figure = density_figure(density_rows([particle_result, rho_result], cells=20), scale)
    columns = limits(figure)
    assert [len(set(column)) for column in columns] == [1, 1]
    assert (columns[0][0] == columns[1][0]) == (scale == "figure")
    bars = len(figure.axes) - 6
    assert bars == (1 if scale == "figure" else 2)


def test_the_bar_says_unit_and_largest_value_and_print_names_the_run(
    particle_result: Result, rho_result: Result
) -> None:
    figure = density_figure(density_rows([particle_result, rho_result], cells=20))
    largest = max(particle_result.density(20).max(), rho_result.cell_density().max())
    told = figure.axes[-1].get_ylabel()
    assert "per unit of area" in told
    assert f"largest {largest:.3g}" in told
    (print_below,) = [text.get_text() for text in figure.texts if "accurate" in text.get_text()]
    assert print_below.splitlines() == [
        "microscopic: accurate, 30 x 3 particles",
        "rho, mono-kinetic: accurate, h = 0.125",
    ]


def test_colours_are_the_papers_where_asked(rho_result: Result) -> None:
    figure = density_figure(density_rows([rho_result]), colours=PAPER_COLOURS)
    assert figure.axes[0].images[0].get_cmap().name == "jet"


def test_walls_of_each_results_flow_are_drawn(rho_result: Result, lid_flow: FlowField) -> None:
    square = np.array([[0.25, 0.25], [0.25, 0.5], [0.5, 0.5], [0.5, 0.25]])
    outline = polygon_outline([("solid", "wall", square, True)])
    flow = replace(lid_flow, outline=outline)
    rows = density_rows([rho_result, replace(rho_result, scheme="paper")], flow=[flow, None])
    assert rows[0].outline is outline
    assert rows[1].outline is not None
    assert rows[1].outline.names == ("left", "right", "bottom", "top")
    for axes, row in zip(density_figure(rows).axes[:4:2], rows, strict=True):
        lines = [c for c in axes.collections if isinstance(c, LineCollection)]
        drawn = [np.asarray(part) for c in lines for part in c.get_segments()]
        assert row.outline is not None
        (line,) = drawn
        corners = {tuple(corner) for corner in line.tolist()}
        assert corners == {tuple(c) for c in row.outline.ends.reshape(-1, 2).tolist()}


def test_density_appears_where_it_is(rho_result: Result) -> None:
    figure = density_figure(density_rows([rho_result]))
    image = figure.axes[0].images[0]
    shown = np.asarray(image.get_array())
    # Row 1 from the bottom and column 6 hold the 7: y = 0.1875, x = 0.8125.
    assert shown[1, 6] == 7.0
    assert image.origin == "lower"
    assert tuple(image.get_extent()) == (0.0, 1.0, 0.0, 0.75)


def test_labels_titles_and_size(
    rho_result: Result, tmp_path: Path, png_size: Callable[[Path], tuple[int, int]]
) -> None:
    rows = density_rows([rho_result])
    figure = density_figure(rows, title="Cavity")
    assert [axes.get_title() for axes in figure.axes[:2]] == ["t = 0.1", "t = 0.333333"]
    assert figure.axes[0].get_ylabel().startswith("rho, mono-kinetic")
    path = draw_density(rows, tmp_path / "density.png", title="Cavity")
    asked = tuple(round(inch * DOTS_PER_INCH) for inch in figure.get_size_inches())
    # matplotlib rounds down.
    np.testing.assert_allclose(png_size(path), asked, atol=1)


def test_maximum_of_the_caller_wins(rho_result: Result) -> None:
    columns = limits(density_figure(density_rows([rho_result]), maximum=2.5))
    assert columns == [[(0.0, 2.5)], [(0.0, 2.5)]]


def test_a_time_that_was_not_reached_is_said(rho_result: Result) -> None:
    variables = {name: values[:1] for name, values in rho_result.variables.items()}
    short = replace(rho_result, scheme="paper", times=rho_result.times[:1], variables=variables)
    figure = density_figure(density_rows([rho_result, short]))
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert texts == ["not reached"]


def test_a_time_that_was_not_asked_for_is_not_called_unreached(rho_result: Result) -> None:
    variables = {name: values[:1] for name, values in rho_result.variables.items()}
    times = rho_result.times[:1]
    scene = rho_result.scene.model_copy(update={"times": (float(times[0]),)})
    short = replace(rho_result, scheme="paper", scene=scene, times=times, variables=variables)
    figure = density_figure(density_rows([rho_result, short]))
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert texts == ["not saved"]


def test_empty_density_and_single_time() -> None:
    row = DensityRow("nothing", np.array([1.0]), np.zeros((1, 4, 4)), (0.0, 1.0, 0.0, 1.0))
    assert density_figure([row]).axes[0].images[0].get_clim() == (0.0, 1.0)


def test_common_maximum_counts_panels_alike() -> None:
    fine, coarse = np.ones((100, 100)), np.full((2, 2), 5.0)
    assert common_maximum([fine, coarse]) == 5.0
    needle = np.zeros((100, 100))
    needle[0, 0] = 3.0
    assert common_maximum([needle]) == 3.0


def test_nothing_to_draw_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="at least one row"):
        draw_density([], tmp_path / "density.png")
