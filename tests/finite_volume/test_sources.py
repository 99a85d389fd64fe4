"""Sources of an r-grid: passes that do several things at once, against these one by one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.grid import interior
from ellipsoid_coupling.finite_volume.sources import (
    ANGLE,
    SPIN,
    exact_kick,
    extremes,
    kick,
    kick_anew,
    set_drift,
    turn,
)
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.physics.angular import Sine
from tests.finite_volume.whole import kick as kick_by_numpy

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
        angular=Sine(0.3) if turns else None,
        damping=0.7,
        angular_damping=0.0,
        inverse_mass=1.5,
        inverse_inertia=20.0,
    )
    push = rng.standard_normal((3, *grid))
    return fields, terms, Forces(push[0], push[1], push[2] if turns else None)


@pytest.mark.parametrize("components", [3, 5])
@pytest.mark.parametrize("interacting", [False, True])
@pytest.mark.parametrize("left_out", ["nothing", "steady", "turning", "angular"])
def test_the_drift_is_its_formula(components: int, interacting: bool, left_out: str) -> None:
    """By numpy, to rounding: F/m and F_bar of cells with mass, whatever the scene leaves out."""
    fields, terms, push = cells(components)
    terms = {
        "nothing": terms,
        "steady": terms._replace(steady=None),
        "turning": terms._replace(turning=None),
        "angular": terms._replace(angular=None),
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
        if isinstance(terms.angular, Sine):
            expected[2] -= terms.angular.amplitude * np.cos(angle)
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
    kick(one, drift, change, 0.0)
    found = kick_anew(two, terms, forces, other, change)
    assert np.array_equal(one, two)
    assert np.array_equal(drift, other)
    assert found == extremes(one, drift)


@pytest.mark.parametrize("components", [3, 5])
def test_a_kick_and_a_turn_are_their_formulas(components: int) -> None:
    """By numpy, which rounds alike: the same bits."""
    fields, terms, push = cells(components)
    drift = np.empty((components // 2 + 1, ROWS, COLUMNS))
    set_drift(fields, terms, push, drift)
    change = exact_kick(terms, 0.05)
    expected = fields.copy()
    kick_by_numpy(expected, drift, change, 0.05)
    kick(fields, drift, change, 0.05)
    assert np.array_equal(fields, expected)
    if components == 5:
        interior(expected)[ANGLE] += 0.1 * interior(expected)[SPIN]
    turn(fields, 0.1)
    assert np.array_equal(fields, expected)


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
