"""Figures leave no trace in matplotlib's global state."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import rcParams

from ellipsoid_coupling.models import model_kinds
from ellipsoid_coupling.output.figures.canvas import (
    add_details,
    add_title,
    multiple_of_pi,
    new_figure,
    save_figure,
)
from ellipsoid_coupling.output.figures.sketch import sketch_figure
from ellipsoid_coupling.output.figures.style import SETTINGS, curve_options, line_style


def test_settings_apply_inside_only(tmp_path: Path) -> None:
    before = dict(rcParams)
    save_figure(sketch_figure(), tmp_path / "new" / "a.png")
    assert dict(rcParams) == before
    assert SETTINGS["font.size"] != before["font.size"]


@pytest.mark.parametrize(
    ("quarters", "text"),
    [
        (0, "0"),
        (2, r"$\pi/2$"),
        (4, r"$\pi$"),
        (-2, r"$-\pi/2$"),
        (6, r"$3\pi/2$"),
        (8, r"$2\pi$"),
        (1, r"$\pi/4$"),
        (-3, r"$-3\pi/4$"),
    ],
)
def test_multiples_of_pi(quarters: int, text: str) -> None:
    assert multiple_of_pi(quarters * np.pi / 4) == text


def test_small_print_stands_below_panels_that_keep_their_height() -> None:
    """Within a tenth of an inch: the layout rounds to pixels, and its padding goes with the figure."""
    heights = []
    for lines in ([], ["microscopic: accurate, 1000 x 128 particles, tolerance = 0.01"] * 3):
        figure = new_figure(3.0, 2.0)
        axes = figure.add_subplot()
        axes.set_xlabel("x")
        add_details(figure, lines)
        figure.draw_without_rendering()
        heights.append(axes.bbox.height / figure.dpi)
        if lines:
            (text,) = figure.texts
            box, below = text.get_window_extent(), axes.get_tightbbox()
            assert below is not None
            assert box.y1 <= below.y0
            assert box.x1 <= figure.bbox.x1
            assert box.y0 >= 0.0
    assert abs(heights[0] - heights[1]) < 0.1


def test_long_titles_are_wrapped_inside_the_figure() -> None:
    figure = new_figure(3.0, 2.0)
    add_title(figure, "Convergence to the stationary solution of the first scene\n20 particles")
    lines = figure.get_suptitle().splitlines()
    assert lines[-1] == "20 particles"
    assert max(map(len, lines)) <= 30
    box = figure.texts[0].get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= figure.bbox.x1


def test_models_differ_in_colour_and_without_colour() -> None:
    styles = [line_style(kind.name) for kind in model_kinds()]
    assert len({style.colour for style in styles}) == len(styles)
    assert len({str(style.dashes) for style in styles}) == len(styles)
    assert len({style.marker for style in styles}) == len(styles)


def test_repeated_curves_of_a_model_carry_markers() -> None:
    markers = [curve_options("diffusive", repeat, 60)["marker"] for repeat in range(3)]
    assert markers[0] == ""
    assert len(set(markers)) == 3
