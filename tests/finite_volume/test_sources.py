"""Sources of an r-grid: passes that do several things at once, against these one by one."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.fluxes import Ballistic
from ellipsoid_coupling.finite_volume.fused_xy_sweep import Move, sweep_planes, whole_plane
from ellipsoid_coupling.finite_volume.grid import interior
from ellipsoid_coupling.finite_volume.sources import (
    ANGLE,
    SPIN,
    Kick,
    TurnWork,
    exact_kick,
    extremes,
    kick_anew,
    kick_anew_work,
    kick_work,
    set_drift,
)
from ellipsoid_coupling.interaction.grid_forces import Forces
from tests.finite_volume.whole import kick

Floats = NDArray[np.float64]

ROWS, COLUMNS = 70, 13


def cells(components: int) -> tuple[Floats, CellTerms, Forces]:
    """Random cells, a third of them vacuum, in random terms."""
    rng = np.random.default_rng(components)
    fields = rng.standard_normal((components, ROWS + 4, COLUMNS + 4))
    inner = interior(fields)
    inner[0] = np.maximum(rng.random((ROWS, COLUMNS)) - 1.0 / 3.0, 0.0)
    inner[1:] *= inner[0]
    grid = ROWS, COLUMNS
    turns = components == 5
    terms = CellTerms(
        steady=rng.standard_normal((2, *grid)),
        turning=rng.standard_normal((3, *grid)) if turns else None,
        amplitude=0.3 if turns else None,
        damping=0.7,
        angular_damping=0.0,
        inverse_mass=1.5,
        inverse_inertia=20.0,
    )
    push = rng.standard_normal((3, *grid))
    return fields, terms, Forces(push[0], push[1], push[2] if turns else None)


@pytest.mark.parametrize("components", [3, 5])
@pytest.mark.parametrize("interacting", [False, True])
@pytest.mark.parametrize("left_out", ["nothing", "steady", "turning", "amplitude"])
def test_the_drift_is_its_formula(components: int, interacting: bool, left_out: str) -> None:
    """By numpy, to rounding: F/m and F_bar of cells with mass, whatever the scene leaves out."""
    fields, terms, push = cells(components)
    terms = {
        "nothing": terms,
        "steady": terms._replace(steady=None),
        "turning": terms._replace(turning=None),
        "amplitude": terms._replace(amplitude=None),
    }[left_out]
    drift = np.full((components // 2 + 1, ROWS, COLUMNS), np.nan)
    set_drift(fields, terms, push if interacting else None, drift)
    inner = interior(fields)
    held = inner[0] > 0.0
    expected = np.zeros_like(drift)
    if terms.steady is not None:
        expected[:2] += terms.steady
    if interacting:
        expected[:2] += terms.inverse_mass * np.array([push.x, push.y])
    if components == 5:
        angle = np.divide(inner[3], inner[0], out=np.zeros_like(inner[3]), where=held)
        if terms.turning is not None:
            even, sine, cosine = terms.turning
            expected[2] += even + sine * np.sin(2.0 * angle) + cosine * np.cos(2.0 * angle)
        if terms.amplitude is not None:
            expected[2] -= terms.amplitude * np.cos(angle)
        if interacting and push.torque is not None:
            expected[2] += terms.inverse_inertia * push.torque
    np.testing.assert_allclose(drift, expected * held, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("components", [3, 5])
@pytest.mark.parametrize("interacting", [False, True])
def test_a_kick_anew_is_drift_and_kick_and_extremes(components: int, interacting: bool) -> None:
    """The same bits: the same numbers in the same order."""
    fields, terms, push = cells(components)
    forces = push if interacting else None
    change = exact_kick(terms, 0.1)
    one, two = fields.copy(), fields.copy()
    drift, other = np.full((2, 3 if components == 5 else 2, ROWS, COLUMNS), np.nan)
    set_drift(one, terms, forces, drift)
    kick(one, drift, change)
    found = kick_anew(two, terms, forces, other, change)
    assert np.array_equal(one, two)
    assert np.array_equal(drift, other)
    assert found == extremes(one, drift)


@pytest.mark.parametrize("components", [pytest.param(3, marks=pytest.mark.heavy), 5])
@pytest.mark.parametrize("x_first", [True, False])
@pytest.mark.parametrize("reflecting", [True, False])
@pytest.mark.parametrize("threads", [1, 5])
def test_a_step_in_one_pass_is_its_parts_one_by_one(
    components: int, x_first: bool, reflecting: bool, threads: int
) -> None:
    """Kick, transport, turn, kick anew: the same bits, however the rows are cut into strips."""
    start, terms, _ = cells(components)
    terms = terms._replace(amplitude=None)
    drift = np.empty((components // 2 + 1, ROWS, COLUMNS))
    set_drift(start, terms, None, drift)
    change, dt = exact_kick(terms, 0.05), 0.05
    plane, strips, spans = whole_plane(start.shape[1:], threads)
    move = Move(x_first, 0.05, reflecting)

    def flown(fields: Floats, work: tuple[Any, Any]) -> float:
        flat = fields.reshape(components, -1)
        return sweep_planes(Ballistic((0.1,) * components), flat, plane, strips, spans, move, work)

    # With work that changes nothing.
    apart, others, nothing = start.copy(), drift.copy(), Kick(1.0, 0.0, 1.0, 0.0)
    kick(apart, drift, change, dt)
    gone = flown(apart, (kick_work(apart, drift, nothing, 0.0), TurnWork(0.0)))
    if components == 5:
        interior(apart)[ANGLE] += dt * interior(apart)[SPIN]
    # Kicked anew when all have arrived, as where cells feel each other, or at once.
    waiting, together = apart.copy(), start.copy()
    found = kick_anew(apart, terms, None, others, change)
    again = start.copy()
    assert flown(again, (kick_work(again, drift, change, dt), TurnWork(dt))) == gone
    assert np.array_equal(interior(again), interior(waiting))

    after = kick_anew_work(together, terms, drift, change, dt)
    # Room for each of these strips, which are not those of this machine.
    after = after._replace(peaks=np.zeros((components - 1, strips.first.size, COLUMNS)))
    assert flown(together, (kick_work(together, drift, change, dt), after)) == gone
    assert np.array_equal(interior(together), interior(apart))
    assert np.array_equal(drift, others)
    assert after.found() == found


def test_there_is_room_for_the_peaks_of_every_strip() -> None:
    fields, terms, _ = cells(5)
    drift = np.zeros((3, ROWS, COLUMNS))
    work = kick_anew_work(fields, terms, drift, exact_kick(terms, 0.1), 0.1)
    strips = whole_plane(fields.shape[1:], numba.get_num_threads())[1]
    assert work.peaks.shape == (4, strips.first.size, COLUMNS)


def test_extremes_are_those_of_cells_with_mass() -> None:
    """To rounding: a reciprocal is taken first."""
    fields, terms, forces = cells(5)
    drift = np.zeros((3, ROWS, COLUMNS))
    set_drift(fields, terms, forces, drift)
    found = extremes(fields, drift)
    inner = interior(fields)
    held = inner[0] > 0.0
    rates = np.abs(inner[:, held]) / inner[0, held]
    assert found.speed == pytest.approx(rates[1:3].max(), rel=1e-14)
    assert found.spin == pytest.approx(rates[4].max(), rel=1e-14)
    assert found.force == np.abs(drift[:2]).max()
    assert found.torque == np.abs(drift[2]).max()
    assert extremes(fields, None) == found._replace(force=0.0, torque=0.0)


@pytest.mark.parametrize("component", [0, 1, 2, 4])
def test_what_is_not_finite_is_the_largest(component: int) -> None:
    fields, _, _ = cells(5)
    interior(fields)[component, 5, 6] = np.nan
    found = extremes(fields, None)
    assert (found.spin if component == 4 else found.speed) == np.inf
    drift = np.zeros((3, ROWS, COLUMNS))
    drift[2, 1, 1] = np.nan
    assert extremes(fields, drift).torque == np.inf
