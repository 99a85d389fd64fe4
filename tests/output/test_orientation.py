"""Order of results: the same definition for every layout, and an error that is the spread it claims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ellipsoid_coupling.output.orientation import FEWEST, axis_moments, order_series
from ellipsoid_coupling.result import FROZEN, Result


def test_particles_of_all_realisations_count_alike(particle_result: Result) -> None:
    """Against the mean of e^{2 i theta} over all of them, to rounding."""
    angle = particle_result.variables["angle"]
    expected = np.abs(np.exp(2j * angle).mean(axis=(1, 2)))
    np.testing.assert_allclose(order_series(particle_result).order, expected, rtol=1e-13)


def test_who_has_left_counts_no_more(particle_result: Result) -> None:
    marks = np.zeros((2, 3, 30))
    marks[:, :, 5:] = 1.0
    result = replace(particle_result, variables=particle_result.variables | {FROZEN: marks})
    expected = np.abs(np.exp(2j * result.variables["angle"][:, :, :5]).mean(axis=(1, 2)))
    np.testing.assert_allclose(order_series(result).order, expected, rtol=1e-13)
    assert np.count_nonzero(axis_moments(result, (1, 1))) == 2
    everyone = replace(result, variables=result.variables | {FROZEN: np.ones((2, 3, 30))})
    assert not axis_moments(everyone, (2, 2)).any()
    assert np.isnan(order_series(everyone).order).all()


def test_the_error_is_how_order_spreads(particle_result: Result) -> None:
    """200 ensembles of 20 realisations: their standard deviation, within a fifth (5 % by chance)."""
    rng = np.random.default_rng(5)
    found, told = [], []
    for _ in range(200):
        angle = rng.normal(0.0, 0.6, (2, 20, 30)) + rng.normal(0.0, 0.2, (2, 20, 1))
        variables = dict.fromkeys(particle_result.variables, angle) | {"angle": angle}
        series = order_series(replace(particle_result, variables=variables))
        found.append(series.order)
        told.append(series.error)
    np.testing.assert_allclose(np.mean(told, axis=0), np.std(found, axis=0), rtol=0.2)


def test_one_realisation_tells_no_error(particle_result: Result) -> None:
    variables = {name: values[:, :1] for name, values in particle_result.variables.items()}
    assert not order_series(replace(particle_result, variables=variables)).error.any()


def test_fields_weigh_with_their_density(rho_result: Result, q_result: Result) -> None:
    """rho: by hand, to rounding; q: two axes 30 degrees apart, S = cos(30 degrees)."""
    density, angle = (rho_result.variables[name] for name in ("density", "mean_angle"))
    wave = (density * np.exp(2j * angle)).sum(axis=(1, 2)) / density.sum(axis=(1, 2))
    np.testing.assert_allclose(order_series(rho_result).order, np.abs(wave), rtol=1e-13)
    np.testing.assert_allclose(order_series(q_result).order, np.cos(np.pi / 6), rtol=1e-13)
    moments = axis_moments(q_result, (6, 8))
    filled = q_result.cell_density() > 0.0
    np.testing.assert_allclose(np.abs(moments[filled]), np.cos(np.pi / 6), rtol=1e-13)
    np.testing.assert_allclose(np.angle(moments[filled]), -np.pi / 6, rtol=1e-13)
    assert not moments[~filled].any()


def test_bins_of_few_particles_tell_nothing(particle_result: Result) -> None:
    """The 90 of all realisations in one bin do; in 40 x 40 bins hardly any has four."""
    assert np.all(np.abs(axis_moments(particle_result, (1, 1))) > 0.0)
    density = particle_result.density(40) * (1.0 * 0.75 / 1600) * 90
    full = density > FEWEST - 0.5
    np.testing.assert_array_equal(axis_moments(particle_result, (40, 40)) != 0.0, full)


def test_angles_that_nothing_turns_keep_their_order(q_result: Result) -> None:
    """One cell for all angles, of a scene without anything that turns them: all start at 0.3, S = 1.

    Within the width of a bin of 720.
    """
    scene = q_result.scene
    still = scene.model_copy(
        update={
            "start": scene.start.model_copy(update={"angle": 0.3}),
            "interaction": None,
            "walls": None,
            "flow": None,
        }
    )
    variables = {name: values[:, :1] for name, values in q_result.variables.items()}
    variables["density"] = q_result.variables["density"].sum(axis=1, keepdims=True)
    held = replace(q_result, scene=still, variables=variables, coordinates={"angle": np.zeros(1)})
    np.testing.assert_allclose(order_series(held).order, 1.0, rtol=1e-12)
    moments = axis_moments(held, (6, 8))
    filled = held.cell_density() > 0.0
    assert np.angle(moments[filled]) == pytest.approx(0.6, abs=2.0 * np.pi / 720)
