"""Passes of the sources over an r-grid: all at once against one by one, and against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.grid import Grid, interior
from ellipsoid_coupling.finite_volume.implicit_turn import turn_implicitly
from ellipsoid_coupling.finite_volume.kick import exact_kick, implicit_kick
from ellipsoid_coupling.finite_volume.q_grid import RGrid
from ellipsoid_coupling.finite_volume.sources import Cells, Work, acceleration, treat
from ellipsoid_coupling.finite_volume.step_limits import ExtremesLimit, extremes_of
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.physics.angular import Sine
from tests.finite_volume.whole import kick as kick_by_numpy

Floats = NDArray[np.float64]

ROWS, COLUMNS = 70, 213
EVERYWHERE = RGrid(Grid(0.0, 0.0, 1.0, COLUMNS, ROWS)).everywhere


def some_cells(components: int) -> tuple[Cells, CellTerms, Forces]:
    """Random cells, a third of them vacuum, in random terms; the drift is not set."""
    rng = np.random.default_rng(components)
    fields = rng.standard_normal((components, 1, ROWS + 4, COLUMNS + 4))
    inner = interior(fields)[:, 0]
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
    forces = Forces(push[0], push[1], push[2] if turns else None)
    drift = np.full((3 if turns else 2, 1, *grid), np.nan)
    if turns:
        return Cells(fields, EVERYWHERE, drift, (0, 1, 2), (0, 1, 2, 4), (3,), (4,)), terms, forces
    return Cells(fields, EVERYWHERE, drift, (0, 1), (0, 1, 2), (), ()), terms, forces


def do(
    cells: Cells,
    terms: CellTerms,
    forces: Forces | None = None,
    *,
    fresh: bool = False,
    kicks: bool = False,
    time: float = 0.0,
    limits: bool = False,
) -> Floats:
    """One pass, with exact kicks over 0.1."""
    velocities = len(cells.rates)
    peaks = (0, 1, 2, 3) if velocities == 3 else (0, 1)
    limit = ExtremesLimit(peaks, 1.0, 1.0, 1.0, (0.0, 0.0), True)
    work = Work(exact_kick(terms, 0.1, velocities), kicks, time, limits)
    return treat(cells, acceleration(terms, forces) if fresh else None, work, limit)


def copy_of(cells: Cells) -> Cells:
    return cells._replace(fields=cells.fields.copy(), drift=cells.drift.copy())


# Terms are added one by one, each compiled or not: with and without each of them, not all sets of them.
@pytest.mark.parametrize(
    ("components", "interacting", "left_out"),
    [(5, True, "nothing"), (5, True, "turning"), (5, False, "angular"), (5, False, "steady"),
     (3, True, "nothing"), (3, False, "nothing"), (3, False, "steady")],
)  # fmt: skip
def test_the_drift_is_its_formula(components: int, interacting: bool, left_out: str) -> None:
    """By numpy, to rounding: F/m and F_bar of cells with mass, whatever the scene leaves out."""
    cells, terms, push = some_cells(components)
    terms = {
        "nothing": terms,
        "steady": terms._replace(steady=None),
        "turning": terms._replace(turning=None),
        "angular": terms._replace(angular=None),
    }[left_out]
    do(cells, terms, push if interacting else None, fresh=True)
    inner = interior(cells.fields)[:, 0]
    held = inner[0] > 0.0
    expected = np.zeros_like(cells.drift[:, 0])
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
    np.testing.assert_allclose(cells.drift[:, 0], expected * held, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("components", [3, 5])
@pytest.mark.parametrize("interacting", [False, True])
def test_one_pass_is_drift_and_kick_and_turn_and_peaks(components: int, interacting: bool) -> None:
    """The same bits: the same numbers in the same order."""
    cells, terms, push = some_cells(components)
    forces = push if interacting else None
    other = copy_of(cells)
    do(other, terms, forces, fresh=True)
    do(other, terms, kicks=True)
    do(other, terms, time=0.2)
    peaks = do(cells, terms, forces, fresh=True, kicks=True, time=0.2, limits=True)
    assert np.array_equal(cells.fields, other.fields)
    assert np.array_equal(cells.drift, other.drift)
    assert np.array_equal(peaks, do(other, terms, limits=True))
    assert not do(other, terms).any()


@pytest.mark.parametrize("components", [3, 5])
def test_a_kick_and_a_turn_are_their_formulas(components: int) -> None:
    """By numpy, which rounds alike: the same bits."""
    cells, terms, push = some_cells(components)
    do(cells, terms, push, fresh=True)
    expected = cells.fields[:, 0].copy()
    change = exact_kick(terms, 0.1, len(cells.rates))
    kick_by_numpy(expected, cells.drift[:, 0], change, 0.05)
    do(cells, terms, kicks=True, time=0.05)
    assert np.array_equal(cells.fields[:, 0], expected)


def test_extremes_are_those_of_cells_with_mass() -> None:
    """To rounding: a reciprocal is taken first."""
    cells, terms, forces = some_cells(5)
    found = extremes_of(do(cells, terms, forces, fresh=True, limits=True))
    inner, drift = interior(cells.fields)[:, 0], cells.drift[:, 0]
    held = inner[0] > 0.0
    rates = np.abs(inner[:, held]) / inner[0, held]
    assert found.speed == pytest.approx(rates[1:3].max(), rel=1e-14)
    assert found.spin == pytest.approx(rates[4].max(), rel=1e-14)
    assert found.force == np.abs(drift[:2]).max()
    assert found.torque == np.abs(drift[2]).max()


@pytest.mark.parametrize("component", [0, 1, 2, 4])
def test_what_is_not_finite_is_the_largest(component: int) -> None:
    cells, terms, _ = some_cells(5)
    cells.drift[...] = 0.0
    interior(cells.fields)[component, 0, 5, 6] = np.nan
    found = extremes_of(do(cells, terms, limits=True))
    assert (found.spin if component == 4 else found.speed) == np.inf
    cells.drift[2, 0, 1, 1] = np.nan
    assert extremes_of(do(cells, terms, limits=True)).torque == np.inf


@pytest.mark.parametrize("damping", [0.0, 40.0])
def test_the_implicit_turn_solves_its_equation(damping: float) -> None:
    """Omega1 = (omega + dt F_bar(phi + dt omega1))/(1 + dt Gamma_bar), F_bar by numpy; to rounding."""
    dt = 0.1
    cells, terms, forces = some_cells(5)
    terms = terms._replace(angular_damping=damping)
    do(cells, terms, forces, fresh=True)
    inner = interior(cells.fields)[:, 0]
    held = inner[0] > 0.0
    phi, omega = inner[3, held] / inner[0, held], inner[4, held] / inner[0, held]
    change = implicit_kick(terms, dt, 3)
    kick_by_numpy(cells.fields[:, 0], cells.drift[:, 0], change)
    turn_implicitly(cells, terms, change.gain[2], dt)
    new, turned = inner[4, held] / inner[0, held], inner[3, held] / inner[0, held]
    assert terms.turning is not None
    assert forces.torque is not None
    even, sine, cosine = (part[held] for part in terms.turning)
    torque = even + sine * np.sin(2.0 * turned) + cosine * np.cos(2.0 * turned)
    torque += terms.inverse_inertia * forces.torque[held] - 0.3 * np.cos(turned)
    np.testing.assert_allclose(turned, phi + dt * new, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(new * (1.0 + dt * damping), omega + dt * torque, atol=1e-10)
