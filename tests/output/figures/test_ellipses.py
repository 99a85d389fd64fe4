"""Ellipses: to scale, of one realisation, thinned evenly and honestly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.figures import draw_ellipses
from ellipsoid_coupling.output.figures.ellipses import ellipse_figure, thinned
from ellipsoid_coupling.result import Result


def test_ellipses_of_the_realisation_at_each_time(
    particle_result: Result, lid_flow: FlowField, tmp_path: Path
) -> None:
    figure = ellipse_figure(particle_result, realisation=2, flow=lid_flow)
    assert len(figure.axes) == 2
    for index, axes in enumerate(figure.axes):
        ellipses = next(c for c in axes.collections if isinstance(c, PolyCollection))
        centres = np.array([np.asarray(p.vertices)[:-1].mean(axis=0) for p in ellipses.get_paths()])
        x, y = (particle_result.variables[name][index, 2] for name in "xy")
        np.testing.assert_allclose(centres, np.stack([x, y], axis=-1), atol=1e-12)
        assert axes.get_aspect() == 1.0
    path = draw_ellipses(particle_result, tmp_path / "ellipses.png", flow=lid_flow)
    assert path.stat().st_size > 1000


def test_title_says_how_many_are_shown(particle_result: Result) -> None:
    assert ellipse_figure(particle_result, most=12, title="Cavity").get_suptitle() == (
        "Cavity\n12 of 30 particles"
    )
    assert ellipse_figure(particle_result).get_suptitle() == "30 particles"


@pytest.mark.parametrize(("number", "most"), [(1000, 200), (7, 200), (1, 5), (10, 9)])
def test_thinning_is_even(number: int, most: int) -> None:
    chosen = thinned(number, most)
    assert chosen.size == min(number, most)
    assert chosen[0] == 0
    assert chosen[-1] == number - 1
    assert np.ptp(np.diff(chosen)) <= 1 if chosen.size > 1 else True


def test_wrong_realisation_or_layout(
    particle_result: Result, rho_result: Result, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="from 0 to 2"):
        draw_ellipses(particle_result, tmp_path / "a.png", realisation=3)
    with pytest.raises(InputError, match="particle result"):
        draw_ellipses(rho_result, tmp_path / "a.png")
