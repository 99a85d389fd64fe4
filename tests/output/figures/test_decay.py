"""Decay curves and rates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.output.figures import DecayCurve, RateCurve, draw_decay, draw_rates
from ellipsoid_coupling.output.figures.decay import decay_figure, rate_figure

TIMES = np.linspace(0.0, 4.0, 9)


def curves() -> list[DecayCurve]:
    return [DecayCurve(a, TIMES, np.exp(-a * TIMES)) for a in (2.0, 0.2)]


def test_decay_has_a_panel_a_model_and_one_legend(tmp_path: Path) -> None:
    panels = {"microscopic": curves(), "q_maxwellian": curves()[:1]}
    figure = decay_figure(panels)
    assert [len(axes.lines) for axes in figure.axes] == [2, 1]
    assert [axes.get_title() for axes in figure.axes] == ["microscopic", "q, Maxwellian"]
    assert figure.axes[0].get_yscale() == "log"
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["A = B = 0.2", "A = B = 2"]
    # The same amplitude looks the same in both panels.
    assert figure.axes[0].lines[0].get_color() == figure.axes[1].lines[0].get_color()
    assert draw_decay(panels, tmp_path / "decay.png").stat().st_size > 1000


def test_distances_of_zero_are_left_out() -> None:
    curve = DecayCurve(1.0, TIMES, np.where(TIMES < 2.0, 1.0, 0.0))
    line = decay_figure({"microscopic": [curve]}).axes[0].lines[0]
    assert np.asarray(line.get_xdata()).max() < 2.0


def test_rates_and_the_exact_curve(tmp_path: Path) -> None:
    rates = RateCurve(np.array([1.0, 2.0]), np.array([0.25, 1.0]))
    figure = rate_figure({"microscopic": rates}, exact=rates)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["without interaction, exact", "microscopic"]
    path = draw_rates({"microscopic": rates}, tmp_path / "rates.png", title="Rates")
    assert path.stat().st_size > 1000


def test_nothing_to_draw(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="panel"):
        draw_decay({}, tmp_path / "a.png")
    with pytest.raises(InputError, match="model"):
        draw_rates({}, tmp_path / "a.png")
