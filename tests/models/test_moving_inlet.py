"""Inlets in a flow that changes: a channel that pulsates, and one whose flow turns round.

The flow is A(t) times Poiseuille's, linear between its times, so that density x int max(A, 0) dt comes in
through the inlet, exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.flow import FlowField, FlowSeries
from ellipsoid_coupling.scenes import Scene
from tests.inlet_runs import DENSITY, balance, channel_scene
from tests.outlined_flows import channel_outline, poiseuille

Floats = NDArray[np.float64]

PERIOD = 0.8
NODES = np.linspace(0.0, PERIOD, 9)
TIMES = (0.3, 1.1)
STEADY = poiseuille(channel_outline())


def pulsating(t: Floats) -> Floats:
    return np.asarray(1.0 + 0.7 * np.sin(2.0 * np.pi * t / PERIOD))


def turning(t: Floats) -> Floats:
    return np.asarray(np.cos(2.0 * np.pi * t / PERIOD))


def flow(factor: Callable[[Floats], Floats]) -> FlowSeries:
    """One period, again and again."""
    arrays = STEADY.arrays
    fields = [
        FlowField(
            arrays._replace(coefficients=float(part) * arrays.coefficients),
            "a pulse",
            STEADY.outline,
        )
        for part in factor(NODES)
    ]
    return FlowSeries.of_fields(NODES, fields, repeat=True)


def fed(factor: Callable[[Floats], Floats], until: float) -> float:
    """Mass: density times the integral of what is linear between the nodes; of a kink 1e-9."""
    t = np.linspace(0.0, until, 1_000_001)
    values = np.maximum(np.interp(t, NODES, factor(NODES), period=PERIOD), 0.0)
    return DENSITY * float(np.trapezoid(values, t))


def scene(**changes: Any) -> Scene:
    own = {
        "particles.number": 1000, "particles.width": 0.05, "particles.realisations": 4,
        "numerics.angle_cells": 4,
    }  # fmt: skip
    return channel_scene(TIMES, own | changes)


@pytest.mark.parametrize("factor", [pulsating, turning])
@pytest.mark.parametrize(
    ("model", "scheme"), [("microscopic", "accurate"), ("mckean_vlasov", "paper")]
)
def test_as_many_particles_come_in_as_the_fluid_carries(
    model: str, scheme: Any, factor: Callable[[Floats], Floats]
) -> None:
    """Four standard deviations of a Poisson number, or one sample where they come in evenly."""
    result = ec.simulate(scene(), model, scheme, flow=flow(factor))
    came_in, inside, ended = balance(result)
    start = result.attributes["particles_at_start"]
    assert np.array_equal(start + came_in, inside + ended)
    assert result.attributes["mass_came_in"] == came_in[-1] / start
    for count, until in zip(came_in, TIMES, strict=True):
        expected = fed(factor, until) * start
        assert abs(count - expected) <= (4.0 * np.sqrt(expected) if model == "microscopic" else 1.0)


def test_newborn_particles_move_with_the_fluid_of_their_birth() -> None:
    """What has come in last: its velocity is the fluid's, but for 1/200 of its change; its place, too."""
    result = ec.simulate(scene(), "microscopic", flow=flow(pulsating))
    x, y, fate = (result.variables[name] for name in ("x", "y", "fate"))
    young = (fate[-1] == 0) & (x[-1] < 0.03)
    assert young.sum() > 10
    now = float(np.interp(TIMES[-1], NODES, pulsating(NODES), period=PERIOD))
    u = now * 6.0 * y[-1] * (1.0 - y[-1])
    # A' is 5.5 at most: what is 0.03/u old lags by A'/200 of 1.5.
    assert np.abs(result.variables["velocity_x"][-1] - u)[young].max() < 5.5 * 1.5 / 200.0
    # Poiseuille's profile of flux, by its second moment: four standard deviations of a mean.
    old = (fate[-1] == 0) & (fate[0] == -1)
    spread = (y[-1][old] - 0.5) ** 2
    assert spread.mean() == pytest.approx(0.05, abs=4.0 * spread.std() / np.sqrt(old.sum()))


@pytest.mark.parametrize(
    ("model", "factor"),
    [("rho_mono_kinetic", pulsating), ("rho_mono_kinetic", turning), ("diffusive", pulsating),
     ("q_mono_kinetic", pulsating)],
)  # fmt: skip
def test_grids_take_in_what_the_fluid_carries(
    model: str, factor: Callable[[Floats], Floats]
) -> None:
    """Even tracers: to rounding, as steps take the fluid of their middle, which is linear in time.

    In the flow that turns round the density outside of the outlet is 0, and a step may hold the turn, so
    that its middle is off by the square of a step.
    """
    result = ec.simulate(scene(**{"flow.drag": 1e6}), model, flow=flow(factor))
    left = dict(part.rsplit(" ", 1) for part in result.attributes["mass_left_by_patch"].split(", "))
    expected, masses = fed(factor, TIMES[-1]), result.attributes
    assert abs(masses["mass_end"] + masses["mass_left"] - masses["mass_start"]) < 1e-13
    if factor is pulsating:
        assert float(left["inlet"]) == pytest.approx(-expected, rel=1e-9)
        assert float(left["outlet"]) == pytest.approx(expected, rel=1e-9)
        np.testing.assert_allclose(result.cell_density(), DENSITY, rtol=1e-11)
    else:
        # What came in last goes out again where it came in.
        back = DENSITY * float(turned_back())
        assert float(left["inlet"]) == pytest.approx(back - expected, rel=0.02)


def turned_back() -> float:
    """Int max(-A, 0) dt to the last save; all of it has the inlet's density, as the channel is long."""
    t = np.linspace(0.0, TIMES[-1], 100_001)
    values = np.interp(t, NODES, turning(NODES), period=PERIOD)
    return float(np.trapezoid(np.maximum(-values, 0.0), t))


class Stop(BaseException):
    pass


@pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov", "rho_mono_kinetic"])
def test_a_resumed_run_has_the_same_bits(model: str, tmp_path: Path) -> None:
    """Stopped within a period, between births."""
    small = {"particles.number": 100, "particles.realisations": 2, "numerics.cell": 0.25}
    scheme: Any = "paper" if model == "mckean_vlasov" else "accurate"
    own = scene(times=[0.2, 0.5], **small, **{"flow.drag": 20.0})

    def stop(_stage: str, part: float) -> None:
        if part > 0.5:
            raise Stop

    whole = ec.simulate(own, model, scheme, flow=flow(pulsating))
    place = ec.RunFolder(tmp_path, checkpoint_seconds=0.0)
    with pytest.raises(Stop):
        ec.simulate(own, model, scheme, flow=flow(pulsating), folder=place, report=stop)
    resumed = ec.simulate(own, model, scheme, folder=ec.RunFolder(tmp_path, resume=True))
    for name, values in whole.variables.items():
        assert np.array_equal(values, resumed.variables[name], equal_nan=True), name
    assert whole.attributes["mass_left_by_patch"] == resumed.attributes["mass_left_by_patch"]
