"""Figures of a flat domain: no text of a figure lies on another one, or beyond the figure's rim."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures.canvas import settings
from ellipsoid_coupling.output.figures.density import density_figure, density_rows
from ellipsoid_coupling.output.figures.directors import axis_rows, director_figure
from ellipsoid_coupling.output.figures.ellipses import ellipse_figure, enlargement
from ellipsoid_coupling.output.figures.flow import flow_figure
from ellipsoid_coupling.result import Result

# Of a pixel: what texts may overlap by, and how far they may reach beyond the rim.
TOUCH = 1.0


def flat(results: Sequence[Result]) -> list[Result]:
    """The same results, as if their domain were five or ten times as wide as high."""
    found = []
    for result in results:
        domain = result.scene.domain.model_copy(update={"x": (0.0, 10.0)})
        scene = result.scene.model_copy(update={"domain": domain})
        variables = dict(result.variables)
        if result.layout == "particles":
            variables["x"] = 10.0 * variables["x"]
        found.append(replace(result, scene=scene, variables=variables))
    return found


def texts(figure: Figure) -> list[tuple[str, Bbox]]:
    """All that is written, and where, in pixels."""
    with settings():
        figure.draw_without_rendering()
        shown = [text for text in figure.findobj(Text) if isinstance(text, Text)]
        shown = [text for text in shown if text.get_visible() and text.get_text().strip()]
        return [(text.get_text(), text.get_window_extent()) for text in shown]


def require_apart(figure: Figure) -> None:
    """Labels of rows and bars, titles and small print; not the numbers at ticks."""
    width, height = figure.get_size_inches() * figure.dpi
    # Numbers at ticks have their own places, also beyond the ends of an axis.
    placed = [(t, box) for t, box in texts(figure) if any(map(str.isalpha, t)) and t[0] != "$"]
    assert placed
    for text, box in placed:
        assert box.x0 >= -TOUCH, text
        assert box.y0 >= -TOUCH, text
        assert box.x1 <= width + TOUCH, text
        assert box.y1 <= height + TOUCH, text
    for (one, a), (other, b) in itertools.combinations(placed, 2):
        wide = min(a.x1, b.x1) - max(a.x0, b.x0)
        high = min(a.y1, b.y1) - max(a.y0, b.y0)
        assert min(wide, high) <= TOUCH, (one, other)


@pytest.fixture
def results(particle_result: Result, rho_result: Result, q_result: Result) -> list[Result]:
    return flat([particle_result, rho_result, q_result])


@pytest.mark.parametrize("count", [1, 3])
def test_densities_and_mean_axes(results: list[Result], count: int) -> None:
    require_apart(density_figure(density_rows(results[:count]), title="a flat domain"))
    require_apart(director_figure(axis_rows(results[:count]), title="a flat domain"))
    require_apart(density_figure(density_rows(results[-count:]), scale="time"))


def test_a_flow(lid_flow: FlowField) -> None:
    require_apart(flow_figure(lid_flow, (0.0, 5.0, 0.0, 0.75), title="a flat domain"))


def test_ellipses_that_would_be_dots_are_drawn_larger(results: list[Result]) -> None:
    """Those of length 0.02 on 10, 0.9 points, to more than 4, which the title says; others to scale."""
    particles, _, _ = results
    require_apart(ellipse_figure(particles, title="a flat domain"))
    smaller = particles.scene.particles.model_copy(update={"length": 0.02, "width": 0.01})
    scene = particles.scene.model_copy(update={"particles": smaller})
    figure = ellipse_figure(replace(particles, scene=scene), title="a flat domain")
    require_apart(figure)
    assert any(
        "30 particles, realisation 0 of 3, drawn 5 times as large" in t for t, _ in texts(figure)
    )
    assert enlargement(0.05, (0.0, 4.0, 0.0, 4.0), 3.0) == 1
    for length in (0.001, 0.01, 0.03):
        times = enlargement(length, (0.0, 10.0, 0.0, 1.0), 6.5)
        drawn = np.array([times - 1, times]) * length / 10.0 * 6.5 * 72.0
        assert drawn[0] < 4.0 <= drawn[1]
