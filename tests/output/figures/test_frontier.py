"""Error against run time: lines, labels and what a logarithmic axis cannot show."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.output.figures import PartBars, draw_frontier, draw_parts
from ellipsoid_coupling.output.figures.annotations import place_labels
from ellipsoid_coupling.output.figures.canvas import new_figure
from ellipsoid_coupling.output.figures.error_budget import parts_figure
from ellipsoid_coupling.output.figures.frontier import frontier_figure, frontier_lines


@dataclass(frozen=True)
class Row:
    model: str
    scheme: str
    resolution: str
    density_errors: tuple[float, ...]
    angle_errors: tuple[float, ...]
    wall_seconds: float


ROWS = [
    Row("rho_mono_kinetic", "paper", "h = 0.01", (0.1, 0.5), (0.05, 0.2), 2.0),
    Row("rho_mono_kinetic", "paper", "h = 0.02", (0.2, 0.8), (0.1, 0.3), 0.3),
    Row("rho_mono_kinetic", "accurate", "h = 0.01", (0.05, 0.2), (0.02, 0.1), 2.1),
    Row("microscopic", "accurate", "9 x 9 particles, tolerance = 0.1", (0.1, 0.2), (0.1, 0.1), 2.2),
    Row("microscopic", "accurate", "", (math.nan, math.nan), (math.nan, math.nan), math.nan),
]


def test_lines_join_resolutions_by_run_time() -> None:
    """The largest error over the saved times decides."""
    lines = frontier_lines(ROWS, "density")
    assert lines["rho_mono_kinetic", "paper"] == [(0.3, 0.8, "h 0.02"), (2.0, 0.5, "h 0.01")]
    assert lines["microscopic", "accurate"] == [(2.2, 0.2, "9 x 9, tol 0.1")]
    assert frontier_lines(ROWS, "angle")["rho_mono_kinetic", "accurate"][0][1] == 0.1


def test_figure_has_all_lines_labels_and_the_band(tmp_path: Path) -> None:
    figure = frontier_figure(ROWS, noise=(0.1, 0.05), title="Cavity")
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == [
        "rho, mono-kinetic, paper",
        "rho, mono-kinetic, accurate",
        "microscopic, accurate",
        "no other run is better",
        "Monte-Carlo error of the reference",
    ]
    assert [len(axes.texts) for axes in figure.axes] == [3, 3]  # labels stand on the front only
    for axes in figure.axes:
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
    assert draw_frontier(ROWS, tmp_path / "frontier.png").stat().st_size > 1000


def test_labels_of_near_points_stay_apart() -> None:
    figure = frontier_figure(ROWS)
    for axes in figure.axes:
        boxes = [note.get_window_extent() for note in axes.texts if isinstance(note, Annotation)]
        assert all(Bbox.intersection(a, b) is None for a, b in combinations(boxes, 2))
        assert all(axes.bbox.x0 <= box.x0 and box.x1 <= axes.bbox.x1 for box in boxes)


def test_only_failed_runs_give_empty_axes_and_no_rows_an_error(tmp_path: Path) -> None:
    assert draw_frontier(ROWS[-1:], tmp_path / "frontier.png").is_file()
    with pytest.raises(InputError, match="at least one row"):
        draw_frontier([], tmp_path / "frontier.png")


def test_parts_are_marks_below_each_other(tmp_path: Path) -> None:
    """At their values, one marker a part, a line at the total; no bars on the logarithmic axis."""
    groups = [
        PartBars(
            "rho\npaper", {"total": 0.5, "discretisation": 0.4, "closure": 0.2}, {"total": 0.1}
        ),
        PartBars("micro", {"total": 0.1, "finite N": 0.05, "sampling": 0.0}, {"total": 0.1}),
    ]
    figure = parts_figure(groups, "Cavity")
    density = figure.axes[0]
    assert not density.patches
    marks = {
        (str(line.get_marker()), float(x), float(y))
        for line in density.lines
        for x, y in zip(np.asarray(line.get_xdata()), np.asarray(line.get_ydata()), strict=True)
        if line.get_linestyle() == "None"
    }
    assert {(marker, x) for marker, x, _ in marks} == {
        ("s", 0.4), ("o", 0.2), ("^", 0.05), ("<", 1e-3),
    }  # fmt: skip
    heights = {(marker, round(y, 6)) for marker, _, y in marks}
    assert heights == {("s", -0.21), ("o", 0.21), ("^", 0.79), ("<", 1.21)}
    assert [tick.get_text() for tick in density.get_yticklabels()] == ["rho\npaper", "micro"]
    assert draw_parts(groups, tmp_path / "parts.png").stat().st_size > 1000
    with pytest.raises(InputError, match="error parts"):
        draw_parts([], tmp_path / "parts.png")


@pytest.mark.parametrize("height", np.linspace(1.0, 9.0, 13))
def test_no_line_runs_through_a_label(height: float) -> None:
    """However long and steep, beside a point whose label has room on its other side."""
    axes = new_figure(5.0, 4.0).subplots()
    axes.set(xlim=(0.0, 10.0), ylim=(0.0, 10.0))
    steep = [(5.0, 0.5, ""), (5.1, 9.5, "")]
    place_labels(axes, [[(4.0, height, "1000 x 16, tol 0.018")]], others=[steep])
    box = axes.texts[0].get_window_extent()
    for y in np.linspace(0.5, 9.5, 500):
        place = axes.transData.transform((np.interp(y, (0.5, 9.5), (5.0, 5.1)), y))
        assert not box.contains(*place)
