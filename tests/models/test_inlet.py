"""Particles that the fluid carries in: how many, where, and that nothing is lost."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from tests.inlet_runs import DENSITY, balance, channel_scene
from tests.outlined_flows import channel_outline, poiseuille

# The mean speed is 1.
TIMES = (0.5, 2.0, 3.0)
FLOW = poiseuille(channel_outline())


def scene(**changes: Any) -> Scene:
    own = {
        "particles.number": 2000, "particles.width": 0.025, "particles.realisations": 2,
        "boundaries.inlet.angle": 0.7,
    }  # fmt: skip
    return channel_scene(TIMES, own | changes)


@pytest.fixture(scope="module", params=[("microscopic", "accurate"), ("mckean_vlasov", "paper")])
def run(request: pytest.FixtureRequest) -> Result:
    model, scheme = request.param
    return ec.simulate(scene(), model, scheme, flow=FLOW)


def test_what_comes_in_is_inside_or_out(run: Result) -> None:
    """Counts to the last one, and the masses of the attributes to rounding."""
    came_in, inside, ended = balance(run)
    start = run.attributes["particles_at_start"]
    assert np.array_equal(start + came_in, inside + ended)
    masses = run.attributes
    assert masses["mass_end"] == pytest.approx(inside[-1] / start, rel=1e-15)
    assert masses["mass_left"] == pytest.approx((ended[-1] - came_in[-1]) / start, abs=1e-15)
    assert masses["mass_end"] + masses["mass_left"] == pytest.approx(1.0, abs=1e-14)
    assert masses["mass_came_in"] == came_in[-1] / start


def test_as_much_comes_in_and_goes_out_as_the_fluid_carries(run: Result) -> None:
    """Density x flux x time: four standard deviations of a Poisson number; evenly, 1 % and one sample."""
    came_in, _, ended = balance(run)
    start = run.attributes["particles_at_start"]
    expected = DENSITY * np.array(TIMES) * start
    # The start is at rest: what is near the outlet lags by 1/gamma.
    lag = DENSITY / 200.0 * start
    for count, number in ((came_in, expected), (ended, expected - lag)):
        allowed = 4.0 * np.sqrt(number) if run.model == "microscopic" else 0.01 * number + 2.0
        assert np.all(np.abs(count - number) <= allowed)


def test_the_density_stays_that_of_the_start(run: Result) -> None:
    """On eight bins: four standard deviations of chance, or 3 % of a quadrature with 500 points a bin."""
    coarse = run.density(60).reshape(3, 2, 30, 4, 15).mean(axis=(2, 4))
    per_bin = run.attributes["particles_at_start"] / 8.0
    part = 4.0 / math.sqrt(per_bin) if run.model == "microscopic" else 0.03
    assert np.abs(coarse / DENSITY - 1.0).max() < part


def test_they_come_in_with_the_fluid_at_the_inlet_s_angle(run: Result) -> None:
    """What was born within the last tenth: its velocity is the fluid's, which no lag has changed."""
    x, y, fate = (run.variables[name] for name in ("x", "y", "fate"))
    newborn = (fate[-2] == -1) & (fate[-1] == 0) & (x[-1] < 0.05)
    assert newborn.any()
    u = 6.0 * y[-1] * (1.0 - y[-1])
    assert np.abs(run.variables["velocity_x"][-1] - u)[newborn].max() < 1e-3
    assert np.abs(run.variables["velocity_y"][-1])[newborn].max() < 1e-6
    # Jeffery's rate is at most (1 + lambda)/2 |du/dy| < 6, for 0.05/u in time.
    slow = newborn & (u > 1.0)
    assert np.abs(run.variables["angle"][-1] - 0.7)[slow].max() < 6.0 * 0.05


def test_before_its_birth_a_particle_has_no_place(run: Result, tmp_path: Path) -> None:
    """Not a number, and no other value is; the file holds the codes as whole numbers with meanings."""
    unborn = run.variables["fate"] == -1
    assert unborn[0].any()
    for name in ("x", "y", "angle", "velocity_x", "velocity_y", "angular_velocity"):
        assert np.array_equal(np.isnan(run.variables[name]), unborn)
    run.save(tmp_path / "result.nc")
    loaded = Result.load(tmp_path)
    assert np.array_equal(loaded.variables["fate"], run.variables["fate"])
    assert loaded.variables["fate"].dtype == np.int32
    ended = run.variables["fate"] > 0
    assert ended[-1].any()
    assert np.array_equal(~np.isnan(loaded.variables["end_time"]), ended)
    assert np.all(run.variables["end_time"][ended] <= TIMES[-1])
    attributes = run.to_dataset()["particle_fate"].attrs
    assert attributes["flag_values"].tolist() == [-1, 0, 2, 4]
    assert attributes["flag_meanings"] == "not_yet inside remove@outlet inlet@inlet"


@pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])
def test_births_and_fates_after_a_kill_have_the_same_bits(model: str, tmp_path: Path) -> None:
    """With noise, between births and ends: positions, velocities and fates."""

    class Stop(BaseException):
        pass

    def stop(_stage: str, part: float) -> None:
        if part > 0.4:
            raise Stop

    noise = {"noise.noise": 0.3, "noise.angular_noise": 0.3}
    own = scene(times=[0.2, 1.5], **noise, **{"particles.number": 100})
    whole = ec.simulate(own, model, "paper", flow=FLOW)
    place = ec.RunFolder(tmp_path, checkpoint_seconds=0.0)
    with pytest.raises(Stop):
        ec.simulate(own, model, "paper", flow=FLOW, folder=place, report=stop)
    resumed = ec.simulate(own, model, "paper", folder=ec.RunFolder(tmp_path, resume=True))
    for name, values in whole.variables.items():
        assert np.array_equal(values, resumed.variables[name], equal_nan=True), name
    assert whole.attributes["fates"] == resumed.attributes["fates"]
    came_in, _, ended = balance(whole)
    assert came_in[-1] > 10
    assert ended[-1] > 10


def test_an_inlet_that_nobody_can_store_is_refused() -> None:
    with pytest.raises(InputError, match=r"key boundaries: .*inlets whose particles fit"):
        ec.simulate(scene(**{"boundaries.inlet.density": 1e12}), "microscopic", flow=FLOW)


def test_a_side_of_the_domain_may_be_an_inlet() -> None:
    """Where nothing is known of the flow's outline: walls and an outlet are sides as well."""
    sides = {"left": {"kind": "inlet", "density": DENSITY}, "right": {"kind": "remove"}}
    table = scene().model_dump(mode="json", exclude_none=True) | {"boundaries": sides}
    own = ec.load_scene(table, {"domain.boundary": "reflecting"})
    result = ec.simulate(own, "mckean_vlasov", "paper", flow=poiseuille(None))
    came_in, inside, ended = balance(result)
    assert np.array_equal(result.attributes["particles_at_start"] + came_in, inside + ended)
    expected = DENSITY * TIMES[-1] * result.attributes["particles_at_start"]
    assert came_in[-1] == pytest.approx(expected, rel=0.01)
    assert result.attributes["fates"].startswith("left 0, right ")


def test_an_inlet_needs_a_fluid() -> None:
    still = ec.load_scene("cavity_free", {"flow": None, "boundaries.left.kind": "inlet",
                                          "boundaries.left.density": 1.0})  # fmt: skip
    with pytest.raises(InputError, match=r"a fluid, \[flow\], that carries particles in"):
        ec.simulate(still, "microscopic")
