"""Angle distributions: modulo pi, or the circle cut where little is; lines, labels and bands are there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.output.figures import draw_angles
from ellipsoid_coupling.output.figures.angles import (
    Circle,
    angle_errors,
    angle_figure,
    cut_position,
    folded,
    opened_circle,
)
from ellipsoid_coupling.physics.angular import Axis, Sine
from ellipsoid_coupling.result import Result


def test_one_panel_a_time_one_line_a_result(
    particle_result: Result, rho_result: Result, q_result: Result, tmp_path: Path
) -> None:
    results = [particle_result, rho_result, replace(rho_result, scheme="paper"), q_result]
    figure = angle_figure(results, bins=24)
    assert [len(axes.lines) for axes in figure.axes] == [4, 4]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "microscopic\naccurate, 30 x 3 particles",
        "rho, mono-kinetic, accurate\nh = 0.125",
        "rho, mono-kinetic, paper\nh = 0.125",
        "q, mono-kinetic\naccurate, h = 0.125, 12 angles",
    ]
    looks = {(line.get_color(), line.get_marker()) for line in figure.axes[0].lines}
    assert len(looks) == 4
    assert draw_angles(results, tmp_path / "angles.png").stat().st_size > 1000


def test_angles_are_counted_modulo_pi(rho_result: Result) -> None:
    """From -pi/2 to pi/2, in rad; both halves of the circle add up, and the integral is 1 to rounding."""
    panel = angle_figure([rho_result], bins=24).axes[0]
    assert panel.get_xlim() == pytest.approx((-0.5 * np.pi, 0.5 * np.pi))
    assert panel.get_xlabel().endswith("in rad")
    angles = np.asarray(panel.lines[0].get_xdata())
    values = np.asarray(panel.lines[0].get_ydata())
    whole = rho_result.angle_distribution(24)[0]
    bins = (np.mod(angles, np.pi) // (np.pi / 12)).astype(int)
    np.testing.assert_allclose(values, (whole[:12] + whole[12:])[bins], rtol=1e-14)
    assert np.isclose(values[1:-1].sum() * np.pi / 12, 1.0, rtol=1e-12)
    assert angles[1] == pytest.approx(-0.5 * np.pi + np.pi / 24)


def test_a_potential_that_tells_heads_from_tails_shows_the_whole_turn(rho_result: Result) -> None:
    for potential, polar in ((Sine(1.0), True), (Axis(1.0), False)):
        scene = rho_result.scene.model_copy(update={"angular_potential": potential})
        panel = angle_figure([replace(rho_result, scene=scene)], bins=24).axes[0]
        assert np.ptp(panel.get_xlim()) == pytest.approx(2.0 * np.pi if polar else np.pi)


def test_bands_are_standard_errors_over_realisations(particle_result: Result) -> None:
    """By hand, to rounding; halves of the circle add up as if independent."""
    errors = angle_errors(particle_result, 12)
    assert errors is not None
    angles = np.mod(particle_result.variables["angle"][1], 2.0 * np.pi)
    counts = [np.histogram(a, 12, (0.0, 2.0 * np.pi))[0] * 12 / (30 * 2.0 * np.pi) for a in angles]
    np.testing.assert_allclose(errors[1], np.std(counts, axis=0, ddof=1) / np.sqrt(3), rtol=1e-12)
    np.testing.assert_array_equal(folded(np.arange(8.0).reshape(2, 4)), [[2.0, 4.0], [10.0, 12.0]])
    figure = angle_figure([particle_result], bins=24)
    assert all(len(axes.collections) == 1 for axes in figure.axes)
    assert "standard error" in figure.get_suptitle()
    assert angle_errors(replace(particle_result, layout="rho"), 12) is None


def test_lines_hold_the_distribution(rho_result: Result) -> None:
    line = angle_figure([rho_result], bins=24, polar=True).axes[0].lines[0]
    angles, values = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    expected = rho_result.angle_distribution(24)[0]
    bins = np.mod(angles, 2 * np.pi) // (2 * np.pi / 24)
    np.testing.assert_array_equal(values, expected[bins.astype(int)])
    # One turn: the points at both ends, half a bin outside, repeat the other end's.
    assert np.isclose(values[1:-1].sum() * 2 * np.pi / 24, 1.0, rtol=1e-12)


@pytest.mark.parametrize(("centre", "cut"), [(0, -np.pi), (12, 0.0)])
def test_circle_is_cut_away_from_the_peak(centre: int, cut: float) -> None:
    peak = np.roll(np.exp(-(np.linspace(-4, 4, 25)[:-1] ** 2)), centre - 12)[None, :]
    assert cut_position([peak]) == cut
    angles, values = opened_circle(peak[0], Circle(cut, 2.0 * np.pi))
    assert angles[0] < cut < angles[1]
    assert angles[-2] < cut + 2 * np.pi < angles[-1]
    assert 3 < int(np.argmax(values)) < 22


def test_results_without_times_are_left_out(rho_result: Result, tmp_path: Path) -> None:
    nothing = {name: values[:0] for name, values in rho_result.variables.items()}
    failed = replace(rho_result, times=np.empty(0), variables=nothing)
    assert len(angle_figure([rho_result, failed]).axes[0].lines) == 1
    with pytest.raises(InputError, match="saved time"):
        draw_angles([failed], tmp_path / "angles.png")


def test_the_legend_names_runs_in_their_order(rho_result: Result) -> None:
    """The first panel may lack the first run: what it has must not come first for that."""
    variables = {name: values[1:] for name, values in rho_result.variables.items()}
    late = replace(rho_result, scheme="paper", times=rho_result.times[1:], variables=variables)
    legend = angle_figure([late, rho_result]).legends[0]
    assert [text.get_text() for text in legend.get_texts()] == [
        "rho, mono-kinetic, paper\nh = 0.125",
        "rho, mono-kinetic, accurate\nh = 0.125",
    ]
