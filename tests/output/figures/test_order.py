"""The order parameter's series, and mean axes over the domain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.geometry.orientation import mean_axis
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.figures import axis_rows, draw_directors, draw_order
from ellipsoid_coupling.output.figures.directors import director_figure, line_shape
from ellipsoid_coupling.output.figures.order import order_figure
from ellipsoid_coupling.output.orientation import axis_moments, order_series
from ellipsoid_coupling.result import Result


def test_order_has_a_line_a_result_and_a_band_where_there_are_realisations(
    particle_result: Result, rho_result: Result, q_result: Result, tmp_path: Path
) -> None:
    results = [particle_result, rho_result, q_result]
    axes = order_figure(results, "Cavity").axes[0]
    assert len(axes.lines) == 3
    for line, result in zip(axes.lines, results, strict=True):
        np.testing.assert_array_equal(np.asarray(line.get_ydata()), order_series(result).order)
    assert axes.get_ylim()[0] <= 0.0 < 1.0 <= axes.get_ylim()[1]
    # A band and a line of errors for the particles alone.
    assert len(axes.collections) == 2
    assert draw_order(results, tmp_path / "order.png").stat().st_size > 1000
    nothing = {name: values[:0] for name, values in rho_result.variables.items()}
    with pytest.raises(InputError, match="saved time"):
        draw_order([replace(rho_result, times=np.empty(0), variables=nothing)], tmp_path / "a.png")


def test_lines_lie_along_the_mean_axis_and_are_as_long_as_the_order(rho_result: Result) -> None:
    """Bins of the lines against `axis_moments` itself; lengths to rounding, 0.9 of a bin at S = 1."""
    (row,) = axis_rows([rho_result])
    figure = director_figure([row])
    shape = line_shape(row.density.extent)
    assert shape == (20, 26)
    moment = axis_moments(rho_result, shape)[0]
    # Walls are lines as well, and come first.
    lines = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)][-1]
    ends = np.array([np.asarray(path.vertices) for path in lines.get_paths()])
    way, middle = ends[:, 1] - ends[:, 0], ends.mean(axis=1)
    at = (middle[:, 1] / 0.75 * 20).astype(int), (middle[:, 0] * 26).astype(int)
    found = moment[at]
    spacing = min(1.0 / 26, 0.75 / 20)
    np.testing.assert_allclose(np.hypot(*way.T), 0.9 * spacing * np.abs(found), rtol=1e-9)
    turned = np.exp(2j * np.arctan2(way[:, 1], way[:, 0]))
    np.testing.assert_allclose(turned, np.exp(1j * np.angle(found)), atol=1e-9)
    colours = np.asarray(lines.get_colors(), np.float64)
    np.testing.assert_allclose(colours[:, :3], axis_colours(mean_axis(found)), atol=1e-9)
    # No line where there is nothing.
    density = rho_result.cell_density()[0]
    cells = (middle[:, 1] / 0.125).astype(int), (middle[:, 0] / 0.125).astype(int)
    assert np.all(density[cells] > 0.0)


def test_colours_fade_where_there_is_nothing(q_result: Result) -> None:
    figure = director_figure(axis_rows([q_result]), "colours")
    shown = np.asarray(figure.axes[0].images[0].get_array())
    density = q_result.cell_density()[0]
    assert shown.shape == (6, 8, 4)
    assert np.all((shown[..., 3] > 0.0) == (density > 0.0))
    np.testing.assert_allclose(shown[1, 6, :3], axis_colours(np.array(-np.pi / 12)), atol=1e-9)


def test_all_models_stand_below_each_other_with_walls(
    particle_result: Result, rho_result: Result, lid_flow: FlowField, tmp_path: Path
) -> None:
    square = np.array([[0.25, 0.25], [0.25, 0.5], [0.5, 0.5], [0.5, 0.25]])
    flow = replace(lid_flow, outline=polygon_outline([("solid", "wall", square, True)]))
    late = {name: values[1:] for name, values in rho_result.variables.items()}
    short = replace(rho_result, times=rho_result.times[1:], variables=late)
    rows = axis_rows([particle_result, short], flow)
    figure = director_figure(rows, title="Cavity")
    assert [axes.get_title() for axes in figure.axes[:2]] == ["t = 0.1", "t = 0.333333"]
    assert all(len(axes.patches) == 1 for axes in figure.axes[:4])
    assert [text.get_text() for text in figure.axes[2].texts] == ["not reached"]
    for kind in ("lines", "colours"):
        path = draw_directors(rows, tmp_path / f"{kind}.png", kind=kind)
        assert path.stat().st_size > 1000
