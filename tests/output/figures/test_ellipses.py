"""Ellipses: to scale, of one realisation, thinned evenly and honestly."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.output.colours import axis_colours
from ellipsoid_coupling.output.figures import draw_ellipses
from ellipsoid_coupling.output.figures.ellipses import ellipse_figure, thinned
from ellipsoid_coupling.result import FATE, FROZEN, Result


def test_ellipses_of_the_realisation_at_each_time(
    particle_result: Result, lid_flow: FlowField, tmp_path: Path
) -> None:
    figure = ellipse_figure(particle_result, realisation=2, flow=lid_flow)
    assert len(figure.axes) == 3  # the colour bar of the angle
    assert "rad" in figure.axes[-1].get_ylabel()
    for index, axes in enumerate(figure.axes[:2]):
        ellipses = next(c for c in axes.collections if isinstance(c, PolyCollection))
        centres = np.array([np.asarray(p.vertices)[:-1].mean(axis=0) for p in ellipses.get_paths()])
        x, y = (particle_result.variables[name][index, 2] for name in "xy")
        np.testing.assert_allclose(centres, np.stack([x, y], axis=-1), atol=1e-12)
        assert axes.get_aspect() == 1.0
    path = draw_ellipses(particle_result, tmp_path / "ellipses.png", flow=lid_flow)
    assert path.stat().st_size > 1000


def test_of_frozen_particles_the_outline_stands_where_they_left(particle_result: Result) -> None:
    marks = np.zeros((2, 3, 30))
    marks[1, 0, :4] = 1.0
    result = replace(particle_result, variables=particle_result.variables | {FROZEN: marks})
    axes = ellipse_figure(result).axes[1]
    filled, outlines = (c for c in axes.collections if isinstance(c, PolyCollection))
    assert len(filled.get_paths()) == 26
    assert len(outlines.get_paths()) == 4
    assert not len(outlines.get_facecolor())
    centre = np.asarray(outlines.get_paths()[0].vertices)[:-1].mean(axis=0)
    np.testing.assert_allclose(centre, [result.variables[name][1, 0, 0] for name in "xy"])
    assert "4 have left the flow" in axes.get_title()


def test_colour_is_that_of_the_axis(particle_result: Result) -> None:
    """Turned by pi, an ellipse keeps its colour; to rounding."""
    turned = particle_result.variables | {"angle": particle_result.variables["angle"] + np.pi}
    faces = []
    for result in (particle_result, replace(particle_result, variables=turned)):
        axes = ellipse_figure(result).axes[0]
        ellipses = next(c for c in axes.collections if isinstance(c, PolyCollection))
        faces.append(np.asarray(ellipses.get_facecolor())[:, :3])
    np.testing.assert_allclose(faces[0], faces[1], atol=1e-9)
    angle = particle_result.variables["angle"][0, 0]
    np.testing.assert_allclose(faces[0], axis_colours(angle), atol=1e-9)


def test_wide_domains_stand_below_each_other(particle_result: Result) -> None:
    figure = ellipse_figure(particle_result, extent=(0.0, 1.0, 0.2, 0.6))
    figure.draw_without_rendering()
    first, second = (axes.bbox for axes in figure.axes[:2])
    assert first.y0 > second.y1
    assert first.x0 == pytest.approx(second.x0)
    assert figure.axes[0].get_xlim() == (0.0, 1.0)


def test_title_says_how_many_are_shown(particle_result: Result) -> None:
    assert ellipse_figure(particle_result, most=12, title="Cavity").get_suptitle() == (
        "Cavity\n12 of 30 particles, realisation 0 of 3"
    )
    assert ellipse_figure(particle_result).get_suptitle() == "30 particles, realisation 0 of 3"


def test_particles_that_an_inlet_was_still_to_feed_in_are_not_counted(
    particle_result: Result,
) -> None:
    """20 start in each of three realisations; of ten more, four have come in by the last time."""
    fate: Any = np.zeros((2, 3, 30), np.int32)  # the one variable of whole numbers
    fate[0, :, 20:], fate[1, :, 24:] = -1, -1
    result = replace(
        particle_result,
        variables=particle_result.variables | {FATE: fate},
        attributes=particle_result.attributes | {"particles_at_start": 60.0},
    )
    assert ellipse_figure(result, most=12).get_suptitle() == (
        "12 of 24 particles, 4 of them from inlets, realisation 0 of 3"
    )
    for axes, wanted in zip(ellipse_figure(result).axes[:2], (20, 24), strict=True):
        filled = next(c for c in axes.collections if isinstance(c, PolyCollection))
        assert len(filled.get_paths()) == wanted


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
