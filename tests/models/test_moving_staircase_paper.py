"""Scheme `paper` on stairs in a flow that changes: step by step what it should be, and of first order.

In the plug of `test_moving_staircase` all mass has one velocity, so that a step is that of one number:

    v <- v + (1 - e^(-gamma dt))^3 (U(t + dt/2) - v)      before each direction: drag settles at once
    x <- x + dt v                                         FORCE along x
    v <- (v + dt gamma U(t + dt))/(1 + dt gamma)          implicit Euler

Equation, flux and stairs leave nothing besides; so the order in time is that of this recursion, 1. Runs do
not show it. Implicit Euler is off by dt/2 int e^(-gamma (T - s)) v''(s) ds, whose parts cancel as v''
changes its sign in a pulse, and what settles at once is off by (gamma dt)^3 a step, the other way: from 1,
2, 4 to 64 steps in each interval of the flow the velocity's order is 1.2, -0.7, 0.4 to 0.95 at gamma = 4,
and still 1.7 at gamma = 40. Besides, steps are as many as there is room for in an interval: half the CFL
number is not half the step; and FORCE spreads mass by h^2/2 a step, in many steps to the open ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.finite_volume.cells import CellFields
from tests.models.test_moving_staircase import END, NODES, exact, plug_scene, pulse, speed
from tests.validation.test_one_particle import moments

Step = tuple[float, float]


AT_NODES = speed(np.array(NODES))


def fluid(t: float) -> float:
    """Linear between the times of the flow."""
    return float(np.interp(t, NODES, AT_NODES))


def stepped(gamma: float, steps: Sequence[Step]) -> tuple[float, float]:
    """Velocity and place at the end of these steps; see the module."""
    v = x = 0.0
    for start, stop in steps:
        dt, middle = stop - start, fluid(0.5 * (start + stop))
        part = (-np.expm1(-gamma * dt)) ** 3
        v += part * (middle - v)
        x += dt * v
        v += part * (middle - v)
        v = (v + dt * gamma * fluid(stop)) / (1.0 + dt * gamma)
    return float(v), float(x)


@pytest.mark.parametrize("cfl", [0.8, 0.4])
@pytest.mark.parametrize("gamma", [4.0, 40.0])
@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_mono_kinetic"])
def test_every_step_is_that_of_one_number(
    model: str, gamma: float, cfl: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To rounding: no mass comes to the ends, 14 cells away, in as few steps."""
    taken: list[Step] = []
    begin = CellFields.begin_step

    def noted(cells: CellFields, time: float, after: float) -> None:
        taken.append((time, after))
        begin(cells, time, after)

    monkeypatch.setattr(CellFields, "begin_step", noted)
    result = ec.simulate(plug_scene(gamma, cfl), model, "paper", flow=pulse())
    found = moments(result)
    assert len(taken) <= 14
    assert [stop for _, stop in taken][-1] == END
    velocity, place = stepped(gamma, taken)
    assert found["velocity_x"] == pytest.approx(velocity, abs=1e-12)
    assert found["x"] == pytest.approx(place, abs=1e-12)


def even_steps(count: int) -> list[Step]:
    """As many in each interval of the flow."""
    ends = [np.linspace(a, b, count + 1) for a, b in pairwise(NODES)]
    return [(float(a), float(b)) for part in ends for a, b in pairwise(part)]


@pytest.mark.parametrize("gamma", [4.0, 40.0])
def test_these_steps_are_of_first_order(gamma: float) -> None:
    """Velocity and place, in steps so short that the first term of the error counts alone."""
    errors = [
        np.abs(np.subtract(stepped(gamma, even_steps(count)), exact(gamma)))
        for count in (4096, 8192)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx([1.0, 1.0], abs=0.05)
