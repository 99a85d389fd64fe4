"""Arrows point along the flow, inside it only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import Normalize
from matplotlib.quiver import Quiver

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.analytic import analytic_flow
from ellipsoid_coupling.output.figures import draw_flow
from ellipsoid_coupling.output.figures.canvas import new_figure
from ellipsoid_coupling.output.figures.flow import add_arrows, arrow_centres, flow_figure

BOX = (-1.5, 1.5, -0.75, 0.75)


def test_arrows_have_the_direction_and_the_colour_of_the_velocity() -> None:
    figure = flow_figure(analytic_flow("rotation"), BOX)
    quiver = next(c for c in figure.axes[0].collections if isinstance(c, Quiver))
    x, y, spacing = arrow_centres(BOX, 24)
    assert x.shape == (12, 24)
    direction = np.arctan2(np.asarray(quiver.V), np.asarray(quiver.U))
    np.testing.assert_allclose(direction, np.arctan2(-x, y).ravel(), atol=1e-12)
    np.testing.assert_allclose(np.asarray(quiver.get_array()), np.hypot(x, y).ravel(), rtol=1e-12)
    # No arrow reaches its neighbour's.
    assert np.hypot(np.asarray(quiver.U), np.asarray(quiver.V)).max() <= spacing
    assert len(figure.axes) == 2
    # Linear in the speed, and said so.
    assert type(quiver.norm) is Normalize
    assert quiver.norm.vmin == 0.0
    assert "linear" in figure.axes[1].get_ylabel()


def test_no_arrows_outside_the_flow(lid_flow: FlowField) -> None:
    axes = new_figure(2.0, 2.0).add_subplot()
    quiver = add_arrows(axes, lid_flow, (0.0, 2.0, 0.0, 0.75), colour="0.8", count=16)
    assert np.asarray(quiver.X).max() < 1.0
    assert np.asarray(quiver.X).size == 8 * 6


@pytest.mark.parametrize("extent", [BOX, (2.0, 3.0, 2.0, 3.0)])
def test_file_even_where_there_is_no_flow(
    lid_flow: FlowField, extent: tuple[float, float, float, float], tmp_path: Path
) -> None:
    assert draw_flow(lid_flow, extent, tmp_path / "flow.png").stat().st_size > 1000


@pytest.mark.parametrize("height", [0.3, 1.5])
def test_the_label_of_the_speed_is_within_the_picture(height: float) -> None:
    """Also beside a flat panel; in pixels."""
    figure = flow_figure(analytic_flow("rotation"), (0.0, 3.0, 0.0, height), "a title")
    figure.draw_without_rendering()
    box = figure.axes[1].yaxis.label.get_window_extent()
    assert figure.bbox.y0 <= box.y0
    assert box.y1 <= figure.bbox.y1
