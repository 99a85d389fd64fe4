"""What a completed run tells: crossing, starts that a grid cannot hold, angles that a model has not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.finite_volume.grid import scene_grid, start_angle, start_density
from ellipsoid_coupling.models import run_warnings
from ellipsoid_coupling.scenes import Scene

FREE = {"interaction": None, "numerics.cell": 0.1}


def scene(**start: Any) -> Scene:
    number = {"particles.number": len(start.get("points", ())) or 1}
    return ec.load_scene("rotation", FREE | number | {f"start.{k}": v for k, v in start.items()})


def test_a_crossing_is_told_and_the_run_is_completed() -> None:
    """In u = (-x, y) all cross x = 0 at t = 2.418; nothing is told of a run that ends before."""
    for end, crossed in ((1.0, False), (3.0, True)):
        settings = FREE | {"times": [end], "numerics.angle_cells": 8}
        result = ec.simulate(ec.load_scene("top_bottom", settings), "rho_mono_kinetic")
        assert result.status == "completed"
        assert any("Characteristics crossed" in line for line in result.warnings) == crossed


def test_strong_drag_with_pressure_is_told() -> None:
    """Gamma u h differs by 0.6 and 600 between the ends of a box that turns; without pressure never."""
    box = {"numerics.angle_cells": 8, "times": [0.01]}
    for model in ("q_maxwellian", "q_mono_kinetic"):
        for drag in (2.0, 2000.0):
            settings = FREE | box | {"flow.drag": drag}
            result = ec.simulate(ec.load_scene("rotation", settings), model)
            told = [line for line in result.warnings if "gamma u h" in line]
            assert len(told) == (drag > 100.0 and model == "q_maxwellian")


def test_circles_in_q_keep_the_start_angle_or_are_told_of() -> None:
    """Nothing turns: all mass in the start angle's bin. Something does: even, and told."""
    for drag, words in ((0.0, []), (1.0, ["Circles of diameter 0.1"])):
        circles = {"particles.width": 0.1, "flow.angular_drag": drag, "times": [0.2]}
        result = ec.simulate(ec.load_scene("rotation", FREE | circles), "q_mono_kinetic")
        found = result.angle_distribution(60)[-1] * 2.0 * math.pi / 60
        assert [line[:23] for line in result.warnings] == words
        assert found[15] == pytest.approx(1.0 / 60.0 if words else 1.0)


def test_equal_ellipses_at_0_and_pi_have_no_mean_of_half_a_turn() -> None:
    """In one cell: 0 and pi is 0, modulo pi; with V2, which tells them apart, it is pi/2."""
    points = [[0.31, 0.02, 0.0], [0.33, 0.04, math.pi], [0.31, 0.04, 0.2], [0.33, 0.02, math.pi]]
    alike = scene(points=points)
    filled = start_density(scene_grid(alike), alike) > 0.0
    assert start_angle(scene_grid(alike), alike)[filled] == pytest.approx(0.05)
    assert any("differ by more than pi/2" in line for line in run_warnings.of_mixed_angles(alike))
    both = {"start.points": [[2.0, 2.0, 0.0], [2.0, 2.0, math.pi]], "particles.number": 2}
    other = ec.load_scene("stationary", both)
    assert start_angle(scene_grid(other), other).max() == pytest.approx(0.5 * math.pi)


@pytest.mark.parametrize("width", [1e-6, 0.03, 0.1, 0.4])
@pytest.mark.parametrize("middle", [0.013, 0.25, 0.2891])
def test_a_narrow_start_box_keeps_its_middle(width: float, middle: float) -> None:
    """Narrower than a cell (0.1): to rounding, and told. Wider: to a quarter of a cell's part."""
    box = [middle - 0.5 * width, middle + 0.5 * width]
    narrow = scene(x=box, y=[-0.2, 0.2])
    grid = scene_grid(narrow)
    density = start_density(grid, narrow) * grid.cell**2
    assert density.sum() == pytest.approx(1.0, abs=1e-14)
    miss = abs((density.sum(axis=0) * grid.x).sum() - middle)
    assert miss < (1e-10 if width <= 0.1 else 0.25 * 0.1**2 / width)
    assert bool(run_warnings.of_start(narrow)) == (width < 0.1)


def test_a_narrow_start_box_beside_the_edge_stays_within_the_grid() -> None:
    corner = scene(x=[-1.5, -1.499], y=[1.499, 1.5])
    density = start_density(scene_grid(corner), corner)
    assert np.argwhere(density).tolist() == [[29, 0]]
