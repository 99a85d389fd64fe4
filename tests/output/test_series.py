"""Numbers over time against closed forms, for every layout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ellipsoid_coupling.output.series import time_series
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import load_scene


def with_variables(result: Result, **values: object) -> Result:
    """The result with some variables filled by numbers or arrays."""
    filled = {
        name: np.broadcast_to(np.asarray(value, np.float64), result.variables["x"].shape).copy()
        for name, value in values.items()
    }
    return replace(result, variables=result.variables | filled)


def test_particles_of_one_angle_and_speed(particle_result: Result) -> None:
    """All parallel, also those turned by half a turn; exact to rounding."""
    turned = np.where(np.arange(30) % 2, 0.3, 0.3 + np.pi)
    result = with_variables(
        particle_result, angle=turned, velocity_x=3.0, velocity_y=-4.0, angular_velocity=-2.0
    )
    series = time_series(result)
    assert series.times == pytest.approx(result.times, abs=0.0)
    assert series.mass == pytest.approx(1.0, abs=1e-13)
    assert series.speed == pytest.approx(5.0, abs=1e-13)
    assert series.turning == pytest.approx(2.0, abs=1e-13)
    assert series.order == pytest.approx(1.0, abs=1e-13)


def test_even_angles_have_no_order(particle_result: Result) -> None:
    series = time_series(with_variables(particle_result, angle=np.pi * np.arange(30) / 30))
    assert series.order == pytest.approx(0.0, abs=1e-13)


def test_particles_that_have_left_count_in_nothing(particle_result: Result) -> None:
    """Two thirds have left at the second time; they are fast, and lie across."""
    gone = np.zeros((2, 3, 30))
    gone[1, :2] = 1.0
    result = with_variables(
        particle_result,
        frozen=gone,
        angle=gone * np.pi / 2,
        velocity_x=1.0 + 100.0 * gone,
        velocity_y=0.0,
    )
    series = time_series(result)
    assert series.mass == pytest.approx([1.0, 1.0 / 3.0], abs=1e-13)
    assert series.speed == pytest.approx(1.0, abs=1e-13)
    assert series.order == pytest.approx(1.0, abs=1e-13)


def test_none_left_is_not_a_number(particle_result: Result) -> None:
    series = time_series(with_variables(particle_result, frozen=1.0))
    assert series.mass == pytest.approx(0.0, abs=0.0)
    assert np.isnan(series.speed).all()


def test_a_grid_is_weighted_by_its_density(rho_result: Result) -> None:
    """Time 0 holds 7 in one cell and 3 in three others: a sum of 16, cells of 1/64."""
    variables = dict(rho_result.variables)
    for name in ("velocity_x", "velocity_y", "angular_velocity", "mean_angle"):
        variables[name] = np.zeros_like(variables["density"])
    variables["velocity_x"][0, 1, 6] = 2.0
    variables["mean_angle"][0, 1, 6] = np.pi / 2
    series = time_series(replace(rho_result, variables=variables))
    assert series.mass[0] == pytest.approx(16.0 / 64.0, abs=1e-13)
    assert series.speed[0] == pytest.approx(np.sqrt(4.0 * 7.0 / 16.0), abs=1e-13)
    assert series.order is not None
    assert series.order[0] == pytest.approx(abs(9.0 - 7.0) / 16.0, abs=1e-13)


def test_a_q_grid_is_weighted_over_its_angles(q_result: Result) -> None:
    """Equal parts at 330 and 0 degrees move at 1 and 3 in both directions; |1 + e^{-i pi/3}|/2."""
    series = time_series(q_result)
    assert series.speed == pytest.approx(np.sqrt(2.0 * (1.0 + 9.0) / 2.0), abs=1e-13)
    assert series.turning == pytest.approx(np.sqrt(5.0), abs=1e-13)
    assert series.order == pytest.approx(np.cos(np.pi / 6), abs=1e-13)
    assert "alignment of main axes" in series.by_name()


def test_circles_have_no_main_axis(particle_result: Result) -> None:
    scene = load_scene("cavity", {"times": list(particle_result.times), "particles.width": 0.05})
    series = time_series(replace(particle_result, scene=scene))
    assert series.order is None
    assert list(series.by_name()) == ["mass in the domain", "rms speed", "rms angular velocity"]


def test_a_run_without_a_saved_time_has_empty_series(rho_result: Result) -> None:
    variables = {name: values[:0] for name, values in rho_result.variables.items()}
    series = time_series(replace(rho_result, times=np.empty(0), variables=variables))
    assert all(values.shape == (0,) for values in series.by_name().values())
