"""Particles in a periodic domain: they go around, all places are alike, and nothing is lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare.exact_solution import exact_reference
from ellipsoid_coupling.compiled.tuning import LARGE_CLOUD
from ellipsoid_coupling.flow import analytic_flow
from ellipsoid_coupling.models import Setup, build_model, model_terms
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from tests.known_flows import channel

Floats = NDArray[np.float64]

MODELS = pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])
SCHEMES = pytest.mark.parametrize("scheme", ["paper", "accurate"])
# Each model and each scheme once, which compiles faster than the other way round.
CROSSED = pytest.mark.parametrize(
    ("model", "scheme"), [("microscopic", "paper"), ("mckean_vlasov", "accurate")]
)
# Nothing but pairs, in both directions periodic.
PAIRS: dict[str, Any] = {
    "domain.x": [0.0, 1.0], "domain.y": [-0.5, 0.3], "domain.boundary": "periodic",
    "start.x": [0.0, 0.3], "start.y": [-0.5, -0.25], "times": [0.1, 0.3], "flow": None,
    "particles.number": 36, "particles.realisations": 2, "numerics.tolerance": 1e-6,
}  # fmt: skip
# A shear flow, periodic in x between two walls.
CHANNEL: dict[str, Any] = {
    "domain.x": [0.0, 0.8], "domain.y": [-0.25, 0.25], "domain.boundary": "reflecting",
    "boundaries.left.kind": "periodic", "boundaries.right.kind": "periodic",
    "start.x": [0.0, 0.2], "start.y": [0.05, 0.2], "times": [8.0], "flow.field": "shear",
    "interaction": None, "particles.number": 400, "particles.realisations": 1,
    "numerics.cell": 0.0125, "numerics.angle_cells": 8,
}  # fmt: skip
# Moves no place: where places are exact kernels for noise do, which the gas needs.
TURNING = {"noise": {"noise": 0.0, "angular_noise": 0.5}}


def scene(settings: dict[str, Any], **changes: Any) -> Scene:
    return ec.load_scene("rotation", settings | changes)


def places(result: Result) -> tuple[Floats, Floats]:
    return result.variables["x"], result.variables["y"]


def apart(first: Floats, second: Floats, period: float) -> float:
    """The largest distance of places on a ring."""
    delta = first - second
    return float(np.abs(delta - period * np.round(delta / period)).max())


@MODELS
@SCHEMES
@pytest.mark.parametrize("method", ["direct", "harmonics"])
def test_all_places_are_alike(model: str, scheme: Any, method: str) -> None:
    """A start in the corner spreads over both seams like one elsewhere; all are saved inside.

    To rounding, which close pairs make grow. Harmonics are alike from node to node only.
    """
    if (model, method) == ("microscopic", "harmonics"):
        pytest.skip("pairs have no harmonics")
    shift = {"start.x": [0.31, 0.61], "start.y": [-0.14, 0.11], "numerics.interaction": method}
    first = ec.simulate(scene(PAIRS, **{"numerics.interaction": method}), model, scheme)
    second = ec.simulate(scene(PAIRS, **shift), model, scheme)
    x, y = places(first)
    assert 0.0 <= x.min() < 0.1 < 0.9 < x.max() < 1.0
    assert -0.5 <= y.min() < -0.45 < 0.25 < y.max() < 0.3
    atol = 1e-9 if method == "direct" else 1e-3
    for start, other, moved, period in zip(
        (x, y), places(second), (0.31, 0.36), (1.0, 0.8), strict=True
    ):
        assert apart(start + moved, other, period) < atol
    for name in ("velocity_x", "velocity_y", "angular_velocity"):
        before, after = first.variables[name], second.variables[name]
        np.testing.assert_allclose(after, before, rtol=0.0, atol=20.0 * atol * np.abs(before).max())


@SCHEMES
def test_momentum_is_kept(scheme: Any) -> None:
    """Without drag and noise, across both seams: to rounding."""
    result = ec.simulate(scene(PAIRS), "microscopic", scheme)
    for name in ("velocity_x", "velocity_y"):
        velocity = result.variables[name]
        assert np.abs(velocity.sum(axis=-1)).max() < 1e-12 * np.abs(velocity).sum(axis=-1).max()


def test_a_large_cloud_is_stepped_as_a_small_one() -> None:
    """With the pair sum on all threads: translated starts agree, to rounding."""
    changes = {
        "particles.number": LARGE_CLOUD, "particles.realisations": 1, "times": [0.02],
        "particles.length": 0.02, "particles.width": 0.01, "start.x": [0.0, 1.0],
    }  # fmt: skip
    one = ec.simulate(scene(PAIRS, **changes), "microscopic", "paper")
    moved = ec.simulate(
        scene(PAIRS, **changes, **{"start.y": [-0.2, 0.05]}), "microscopic", "paper"
    )
    (x, y), (x_moved, y_moved) = places(one), places(moved)
    assert apart(x, x_moved, 1.0) < 1e-9
    assert apart(y + 0.3, y_moved, 0.8) < 1e-9
    assert y.max() > 0.2


def fly(scheme: Any, model: str, x: float, velocity: tuple[float, float], until: float) -> Floats:
    """Where a free particle is that starts at (x, 0.1), of so many degrees."""
    changes = {
        "particles.number": 1, "particles.realisations": 1,
        "start": {"points": [[x, 0.1]], "x": [x, x], "y": [0.1, 0.1]},
        "numerics.time_step": 1.7, "times": [until],
    }  # fmt: skip
    found = scene(PAIRS, **changes)
    running = build_model(model, Setup(found, model_terms(found, model), scheme, None, 0, 1))
    state = running.state()
    state["velocity"][0, :2, 0] = velocity
    running.restore(state)
    while running.time < until:
        running.advance(until)
    shot = running.snapshot()
    assert (shot["velocity_x"].item(), shot["velocity_y"].item()) == velocity
    assert running.health().outside == 0
    return np.array([shot["x"].item(), shot["y"].item()])


@MODELS
@SCHEMES
def test_a_free_flight_around_the_domain_returns(model: str, scheme: Any) -> None:
    """Twenty times around in x, sixty in y, several times in a step: to rounding."""
    at = fly(scheme, model, 0.7, (2.0, -4.8), 10.0)
    np.testing.assert_allclose(at, [0.7, 0.1], rtol=0.0, atol=1e-12)


@CROSSED
def test_places_in_a_shear_flow_are_exact(model: str, scheme: Any) -> None:
    """X = x0 + y (t - (1 - exp(-t))), on the ring; `paper` errs like its step, in time by 1/2 dt."""
    found = scene(CHANNEL | TURNING, times=[1e-6, 8.0])
    x, y = places(ec.simulate(found, model, scheme))
    expected = x[0] + y[0] * (8.0 - 1.0 + math.exp(-8.0))
    assert apart(expected, x[-1], 0.8) < (5e-3 if scheme == "paper" else 1e-4)
    np.testing.assert_allclose(y[0], y[-1], atol=1e-12)
    assert expected.max() > 1.5


@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_mono_kinetic"])
def test_grids_and_particles_have_one_solution(model: str) -> None:
    """A box that is sheared over the seam, in 16 x 16 bins; parts of the mass that lie elsewhere.

    The exact paths' 256^2 points and 200^2 samples are off by half a row of points at the box's rim,
    2.4 %, the grid by the diffusion of its rim, 4 %.
    """
    sheared = scene(CHANNEL, times=[3.0])
    exact = exact_reference(sheared, analytic_flow("shear"))
    grid = ec.simulate(sheared, model, "accurate")
    many = scene(CHANNEL, times=[3.0], **{"particles.number": 40000})
    particles = ec.simulate(many, "mckean_vlasov", "accurate")
    bins = [result.density(cells=16)[-1] for result in (exact, grid, particles)]
    area = 0.8 * 0.5 / 16**2
    assert np.abs(bins[2] - bins[0]).sum() * area < 0.04
    assert np.abs(bins[1] - bins[0]).sum() * area < 0.08


@CROSSED
def test_an_ideal_gas_fills_the_domain_evenly(model: str, scheme: Any) -> None:
    """Heat, from one corner of the channel: chi^2 of 4 x 4 bins below its 99.9 % quantile, 37.7."""
    gas = {
        "noise": {"noise": 1.0, "angular_noise": 0.0}, "flow.drag": 0.0, "particles.number": 4000,
        "times": [20.0], "numerics.tolerance": 1e-3,
    }  # fmt: skip
    result = ec.simulate(scene(CHANNEL, **gas), model, scheme)
    counts = result.density(cells=4)[-1] * 4000 * 0.4 / 16
    assert counts.sum() == pytest.approx(4000.0)
    assert ((counts - 250.0) ** 2 / 250.0).sum() < 37.7


@CROSSED
def test_who_hits_a_solid_beyond_the_seam_is_frozen_there(model: str, scheme: Any) -> None:
    """The flow ends nowhere along x: particles cross the seam, and stop where the solid begins."""
    changes = {
        "domain.x": [0.0, 4.0], "domain.y": [0.0, 1.0], "boundaries.bottom.kind": "remove",
        "boundaries.top.kind": "remove", "start.x": [3.0, 3.6], "start.y": [0.1, 0.72],
        "times": [0.5, 4.0], "particles.number": 100,
        "numerics.cell": 0.125, "flow.drag": 10.0, "flow.angular_drag": 10.0,
    }  # fmt: skip
    blocked = scene(CHANNEL, **changes)
    result = ec.simulate(blocked, model, scheme, flow=channel(solid=(1.0, 2.0)))
    (x, y), frozen = places(result), result.variables["frozen"]
    assert np.all(frozen[0] == 0.0)
    np.testing.assert_array_equal(frozen[-1] == 1.0, (y[0] > 0.25) & (y[0] < 0.75))
    stopped = x[-1][frozen[-1] == 1.0]
    assert np.all((stopped >= 1.0) & (stopped < 1.0 + 1.0 / 16.0))
    assert np.all((x >= 0.0) & (x < 4.0))


@MODELS
@SCHEMES
def test_a_restored_model_goes_on_with_the_same_bits(model: str, scheme: Any) -> None:
    found = scene(PAIRS)
    setup = Setup(found, model_terms(found, model), scheme, None, 0, 2)
    whole, first, second = (build_model(model, setup) for _ in range(3))
    for running, until in ((whole, 0.15), (first, 0.15)):
        while running.time < until:
            running.advance(until)
    second.restore({name: array.copy() for name, array in first.state().items()})
    for running in (whole, second):
        while running.time < 0.3:
            running.advance(0.3)
    ends = whole.snapshot(), second.snapshot()
    for name, values in ends[0].items():
        np.testing.assert_array_equal(values, ends[1][name])


@MODELS
@pytest.mark.parametrize("length", [0.1415, 0.1413])
def test_a_period_must_hold_twice_the_reach(model: str, length: float) -> None:
    """Reach sqrt(8) L of 0.4 = 0.8/2."""
    found = scene(PAIRS, **{"particles.length": length, "times": [0.001]})
    if length < 0.1414:
        assert ec.simulate(found, model, "paper").variables["x"].shape[-1] > 0
        return
    with pytest.raises(ec.InputError, match=r"domain\.y.*at least twice the potential's reach"):
        ec.simulate(found, model, "paper")
