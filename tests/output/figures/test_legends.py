"""Legends below the panels: whole, whatever the labels and however narrow the figure."""

from __future__ import annotations

from dataclasses import replace

import pytest
from matplotlib.figure import Figure

from ellipsoid_coupling.output.figures.angles import angle_figure
from ellipsoid_coupling.output.figures.order import order_figure
from ellipsoid_coupling.output.figures.time_series import series_figure
from ellipsoid_coupling.result import Result


def long_named(result: Result, resolution: str, times: int) -> Result:
    """`result` at its first saved times, with a resolution as of a run with a tolerance."""
    attributes = result.attributes | {"resolution": resolution}
    kept = {name: values[:times] for name, values in result.variables.items()}
    return replace(result, times=result.times[:times], variables=kept, attributes=attributes)


def whole_legend(figure: Figure) -> int:
    """How many columns it has; fails where it leaves the figure or covers a panel."""
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box, (width, height) = legend.get_window_extent(), figure.bbox.size
    assert 0.0 <= box.x0 < box.x1 <= width
    assert 0.0 <= box.y0 < box.y1 <= height
    for axes in figure.axes:
        around = axes.get_tightbbox()
        assert around is not None
        assert box.y1 <= around.y0
    return len({round(text.get_window_extent().x0) for text in legend.get_texts()})


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("build", [angle_figure, order_figure, series_figure])
def test_long_labels_fit(build: object, times: int, particle_result: Result) -> None:
    """Two runs of particles of the same model, whose labels are wider than half the figure."""
    assert callable(build)
    results = [
        long_named(particle_result, f"{count} x 1 particles, tolerance = 0.0001", times)
        for count in (300, 3000)
    ]
    assert whole_legend(build(results)) == 1


def test_short_labels_stand_side_by_side(rho_result: Result) -> None:
    results = [rho_result, replace(rho_result, scheme="paper")]
    assert whole_legend(order_figure(results)) == 2


def test_panels_keep_their_height_above_a_legend_of_more_lines(particle_result: Result) -> None:
    """Within a tenth of an inch: the layout rounds to pixels, and its padding goes with the figure."""
    heights = []
    for count in (1, 5):
        names = [f"{k} x 1 particles, tolerance = 0.0001" for k in range(1, count + 1)]
        figure = order_figure([long_named(particle_result, name, 2) for name in names])
        whole_legend(figure)
        heights.append(figure.axes[0].bbox.height / figure.dpi)
    assert heights[0] == pytest.approx(heights[1], abs=0.1)
