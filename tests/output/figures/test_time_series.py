"""Numbers over time as a picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.output.figures.time_series import draw_time_series, series_figure
from ellipsoid_coupling.output.series import time_series
from ellipsoid_coupling.result import Result


def test_every_number_has_a_panel_and_every_result_a_line(
    particle_result: Result, rho_result: Result
) -> None:
    figure = series_figure([particle_result, rho_result, replace(rho_result, scheme="paper")])
    named = time_series(rho_result).by_name()
    assert [axes.get_title() for axes in figure.axes] == list(named)
    for axes, values in zip(figure.axes, named.values(), strict=True):
        lines = axes.get_lines()
        assert len(lines) == 3
        np.testing.assert_array_equal(lines[1].get_ydata(), values)
        assert axes.get_ylim()[0] == 0.0
        assert axes.get_ylim()[1] > np.nanmax(values)
        # The two runs of one model differ by their markers.
        assert lines[1].get_markerfacecolor() != lines[2].get_markerfacecolor()
    assert len(figure.legends[0].get_texts()) == 3


def test_the_file_is_as_large_as_the_figure(
    q_result: Result, tmp_path: Path, png_size: Callable[[Path], tuple[int, int]]
) -> None:
    path = draw_time_series([q_result], tmp_path / "t.png")
    width, height = (150.0 * side for side in series_figure([q_result]).get_size_inches())
    assert png_size(path) == (int(width), int(height))


def test_nothing_to_draw_is_refused(rho_result: Result, tmp_path: Path) -> None:
    variables = {name: values[:0] for name, values in rho_result.variables.items()}
    empty = replace(rho_result, times=np.empty(0), variables=variables)
    with pytest.raises(InputError, match="saved time"):
        draw_time_series([empty], tmp_path / "t.png")
