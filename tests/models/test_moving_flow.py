"""Every model in a flow that changes in time, against ordinary differential equations.

    u = (U(t) + S(t) y, 0),        U and S linear between the times of the flow

From rest in a box around y = 0 the mean velocity of all mass obeys v' = gamma (U - v), whatever the
density, and an angle that all of it shares omega' = gamma_bar (g - omega) with Jeffery's g in the shear S.
Both are solved here with steps that end at the flow's times: what is left is the scheme's own error.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.finite_volume.well_balanced import WellBalancedHeun
from ellipsoid_coupling.flow import FlowField, FlowSeries
from tests.written_cases import plate

Floats = NDArray[np.float64]

TIMES = (0.0, 0.15, 0.25, 0.4, 0.5)
GAMMA, GAMMA_BAR, LONG, WIDE = 4.0, 5.0, 0.2, 0.1
END = 0.5
SCENE = {
    "name": "pulse",
    "times": [END],
    "domain": {"x": [-4.0, 4.0], "y": [-4.0, 4.0], "boundary": "open"},
    "particles": {"length": LONG, "width": WIDE, "number": 16, "realisations": 2},
    "start": {"x": [-0.5, 0.5], "y": [-0.5, 0.5], "angle": 0.3},
    "flow": {"source": "closed_form", "field": "shear", "drag": GAMMA, "angular_drag": GAMMA_BAR},
    "numerics": {"cell": 0.25, "angle_cells": 12},
}
# Evenly spread: their mean is that of the box.
POINTS = {"start.points": [[a, b] for a in (-0.4, -0.1, 0.1, 0.4) for b in (-0.4, -0.2, 0.2, 0.4)]}


def speed(t: Floats | float) -> Floats | float:
    return np.sin(5.0 * np.asarray(t)) + 0.5


def shear(t: Floats | float) -> Floats | float:
    return 2.0 * np.cos(4.0 * np.asarray(t))


def field(t: float, sheared: bool) -> FlowField:
    x = np.linspace(-4.0, 4.0, 5)
    y = np.broadcast_to(x[:, None], (5, 5))
    psi = speed(t) * y + (0.5 * shear(t) * y**2 if sheared else 0.0)
    return FlowField.from_stream_function(np.asarray(psi), x, x, "pulse")


def pulse(sheared: bool) -> FlowSeries:
    return FlowSeries.of_fields(TIMES, [field(t, sheared) for t in TIMES], "pulse")


class Exact(NamedTuple):
    way: float
    velocity: float
    angle: float
    spin: float


def exact(overdamped: bool) -> Exact:
    """By the classical Runge-Kutta rule, whose steps end at the flow's times: 1e-10 off."""
    factor = (LONG**2 - WIDE**2) / (LONG**2 + WIDE**2)

    def rates(t: float, state: Floats) -> Floats:
        u, s = (np.interp(t, TIMES, [float(f(k)) for k in TIMES]) for f in (speed, shear))
        _, v, angle, omega = state
        g = -0.5 * s + 0.5 * factor * s * np.cos(2.0 * angle)
        if overdamped:
            return np.array([u, 0.0, g, 0.0])
        return np.array([v, GAMMA * (u - v), omega, GAMMA_BAR * (g - omega)])

    state = np.array([0.0, 0.0, 0.3, 0.0])
    for start, end in pairwise(TIMES):
        h = (end - start) / 200
        for k in range(200):
            t = start + k * h
            k1 = rates(t, state)
            k2 = rates(t + h / 2, state + h / 2 * k1)
            k3 = rates(t + h / 2, state + h / 2 * k2)
            k4 = rates(t + h, state + h * k3)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    if overdamped:
        state[1] = float(speed(END))
    return Exact(*map(float, state))


def means(result: ec.Result) -> Exact:
    """Of all mass; angle and angular velocity of an r-grid are those of each cell with mass."""
    values = {name: array[-1] for name, array in result.variables.items()}
    if result.layout == "particles":
        mass: Floats = np.full(values["x"].shape, 1.0 / values["x"].size)
        x, angle = values["x"], values["angle"]
    else:
        mass = values["density"] / values["density"].sum()
        x = np.broadcast_to(result.coordinates["x"], mass.shape)
        angle = values.get("mean_angle", np.zeros(mass.shape))
    parts = (x, values["velocity_x"], angle, values["angular_velocity"])
    return Exact(*(float((mass * part).sum()) for part in parts))


def errors(model: str, scheme: str, key: str, value: float) -> Floats:
    """Of the mean place and velocity, and of the angle and angular velocity where all share them."""
    scene = ec.load_scene(SCENE, {key: value} | (POINTS if model == "microscopic" else {}))
    # Of densities over the angle the velocity alone is looked at: less mass then comes to the edge.
    sheared = not model.startswith("q_")
    result = ec.simulate(scene, model, scheme, flow=pulse(sheared))  # type: ignore[arg-type]
    found, expected = means(result), exact(model == "diffusive")
    off = np.array(found) - np.array(expected)
    if model == "diffusive":
        return np.asarray(np.abs(off[:3]))
    return np.asarray(np.abs(off if sheared else off[:2]))


# From a level to one of half the step: the orders of the mean velocity, and of angle and angular velocity.
EXACT, NOT_LOOKED_AT = 0, -1
# As samples step, but for their clocks, which take long to compile.
ON_OWN_CLOCKS = ("microscopic", "accurate", "numerics.tolerance", (1e-4, 1.25e-5), EXACT, 2)
ORDERS = [
    ("microscopic", "paper", "numerics.time_step", (1 / 80, 1 / 160), 1, 1),
    # The scheme is for drifts that are linear in time, as this one is along y = const.
    pytest.param(*ON_OWN_CLOCKS, marks=pytest.mark.heavy),
    ("mckean_vlasov", "accurate", "numerics.tolerance", (1e-4, 1.25e-5), EXACT, 2),
    ("rho_mono_kinetic", "paper", "numerics.cfl", (0.6, 0.3), 1, 1),
    ("rho_mono_kinetic", "accurate", "numerics.cfl", (0.05, 0.025), 2, 2),
    # FORCE at the drift's own velocity spreads mass over the open edge: the mean is not that of all.
    ("diffusive", "paper", "numerics.cfl", (0.6, 0.3), NOT_LOOKED_AT, 1),
    # v is that of the fluid at once.
    ("diffusive", "accurate", "numerics.cfl", (0.4, 0.2), EXACT, 2),
    # All angles of a cell: each has its own angular velocity.
    ("q_mono_kinetic", "accurate", "numerics.cfl", (0.2, 0.1), 2, NOT_LOOKED_AT),
    ("q_maxwellian", "paper", "numerics.cfl", (0.6, 0.3), 1, NOT_LOOKED_AT),
]
# What rounding may leave, and the band of a measured order: steps are whole parts of a time of the flow.
ROUNDING, BAND = 1e-10, {1: (0.7, 1.5), 2: (1.5, 2.8)}


@pytest.mark.parametrize(("model", "scheme", "key", "levels", "speed_order", "angle_order"), ORDERS)
def test_each_scheme_keeps_its_order(
    model: str,
    scheme: str,
    key: str,
    levels: tuple[float, float],
    speed_order: int,
    angle_order: int,
) -> None:
    coarse, fine = (errors(model, scheme, key, level) for level in levels)
    for order, which in ((speed_order, np.s_[1:2]), (angle_order, np.s_[2:])):
        if order == EXACT:
            assert max(coarse[which].max(), fine[which].max()) < ROUNDING
        elif order != NOT_LOOKED_AT:
            found = np.log2(coarse[which] / fine[which])
            assert (BAND[order][0] < found).all(), found
            assert (found < BAND[order][1]).all(), found


def test_the_balanced_scheme_takes_the_flow_of_both_ends_of_a_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What is left of the step is as small as in a steady flow, some 2e-4 of the mean velocity.

    The rest of its error is that of the cells: 9e-3 here, 4e-3 on cells of half the size, in a steady flow
    and in this one alike. With the flow of the step's start in both stages it leaves ten times as much.
    """

    def left_by_the_step() -> float:
        long, short = (errors("q_maxwellian", "accurate", "numerics.cfl", c)[1] for c in (0.8, 0.2))
        return float(abs(long - short))

    assert left_by_the_step() < 4e-4
    ends = WellBalancedHeun._steady_of_step
    monkeypatch.setattr(
        WellBalancedHeun, "_steady_of_step", lambda stepper: (ends(stepper)[0], ends(stepper)[0])
    )
    assert left_by_the_step() > 1.5e-3


class Wave(NamedTuple):
    """U = (a(y) + Re(b(y) e^(i omega t)), 0)."""

    psi: Callable[[Floats, float], Floats]
    steady: Callable[[float], float]
    amplitude: Callable[[float], complex]


OMEGA = 2.0 * np.pi
K = 2.0


def _plate_psi(y: Floats, t: float) -> Floats:
    return plate(t, k=K, omega=OMEGA)(np.zeros_like(y), y)[0]


def _channel_psi(y: Floats, t: float) -> Floats:
    return np.asarray((2.0 * y**2 - 4.0 / 3.0 * y**3) * (1.0 + 0.7 * np.sin(OMEGA * t)))


WAVES = {
    "plate": Wave(_plate_psi, lambda y: 0.0 * y, lambda y: np.exp(-(1.0 + 1.0j) * K * y)),
    "channel": Wave(
        _channel_psi, lambda y: 4.0 * y * (1.0 - y), lambda y: -0.7j * 4.0 * y * (1.0 - y)
    ),
}


def way(wave: Wave, y: float, t: float) -> float:
    """Of a particle at y that starts at rest: v' = gamma (u - v)."""
    steady, b = wave.steady(y), wave.amplitude(y) * GAMMA / (GAMMA + 1.0j * OMEGA)
    decayed = (1.0 - np.exp(-GAMMA * t)) / GAMMA
    turned = (np.exp(1.0j * OMEGA * t) - 1.0) / (1.0j * OMEGA)
    return float(steady * (t - decayed) + np.real(b * (turned - decayed)))


@pytest.mark.parametrize("name", WAVES)
def test_paths_err_by_the_square_of_the_folders_spacing(name: str) -> None:
    """Stokes' oscillating plate and a pulsating channel: the step is exact, u is linear between folders."""
    wave, times, starts = WAVES[name], (0.4, 1.0), [0.15, 0.3, 0.55, 0.8]
    settings = {
        "times": list(times), "domain": {"x": [-4.0, 4.0], "y": [0.0, 1.0], "boundary": "open"},
        "start": {"points": [[0.0, y] for y in starts]}, "particles.number": 4,
    }  # fmt: skip
    scene, found = ec.load_scene(SCENE, settings), []
    x, y = np.linspace(-4.0, 4.0, 5), np.linspace(0.0, 1.0, 65)
    exact_ways = np.array([[way(wave, at, t) for at in starts] for t in times])
    for parts in (8, 16, 32):
        at = np.linspace(0.0, 1.0, parts + 1)
        fields = [
            FlowField.from_stream_function(np.repeat(wave.psi(y, t)[:, None], 5, 1), x, y, name)
            for t in at
        ]
        result = ec.simulate(scene, "microscopic", flow=FlowSeries.of_fields(at, fields))
        found.append(float(np.abs(result.variables["x"][:, 0] - exact_ways).max()))
    assert found[0] < 0.02
    orders = np.log2(np.array(found[:-1]) / found[1:])
    assert orders == pytest.approx([2.0, 2.0], abs=0.1)
