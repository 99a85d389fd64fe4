"""Sources and work on the (angle, y, x) grid against numpy's word for the same formulas."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.boundary import fill_periodic
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.hydrostatic_reconstruction import (
    MIRRORS,
    PASSES,
    STEEPEST,
    STOPS,
    WRAPS,
    set_ahead,
    set_work,
)
from ellipsoid_coupling.finite_volume.kick import dampings, exact_kick
from ellipsoid_coupling.finite_volume.q_grid import NORMAL, inside, occupied_extents
from ellipsoid_coupling.finite_volume.sources import Acceleration, Cells, Work, acceleration, treat
from ellipsoid_coupling.finite_volume.step_limits import CellwiseLimit
from ellipsoid_coupling.geometry.boundaries import Reflect
from ellipsoid_coupling.interaction.q_grid import AngleForces
from ellipsoid_coupling.physics.angular import Sine
from tests.finite_volume.whole import fill

Floats = NDArray[np.float64]

# Rows as long as several pieces, see `rows.piece_of`.
ANGLES, ROWS, COLUMNS = 6, 5, 211
GRID = ANGLES, ROWS, COLUMNS


def some_fields(components: int) -> Floats:
    """Random q and momenta, a third of the cells empty, in padded fields."""
    rng = np.random.default_rng(components)
    fields = np.zeros((components, *(n + 2 * GHOSTS for n in GRID)))
    inner = inside(fields)
    inner[0] = np.maximum(rng.random(GRID) - 1.0 / 3.0, 0.0)
    inner[1:] = inner[0] * rng.standard_normal((components - 1, *GRID))
    return fields


def some_terms(turns: bool, damping: float = 0.7) -> CellTerms:
    rng = np.random.default_rng(7)
    return CellTerms(
        steady=rng.standard_normal((2, ROWS, COLUMNS)),
        turning=rng.standard_normal((3, ROWS, COLUMNS)) if turns else None,
        angular=Sine(0.3) if turns else None,
        damping=damping,
        angular_damping=0.4 if turns else 0.0,
        inverse_mass=1.5,
        inverse_inertia=20.0,
    )


def some_forces(turns: bool, kind: type[np.floating]) -> AngleForces:
    """Of half the angles, which the others share."""
    rng = np.random.default_rng(8)
    x, y, torque = rng.standard_normal((3, ANGLES // 2, ROWS, COLUMNS)).astype(kind)
    return AngleForces(x, y, torque if turns else None)


def expected_drift(terms: CellTerms, forces: AngleForces | None, components: int) -> Floats:
    """F_x, F_y and F_bar, (components - 1, na, ny, nx)."""
    drift = np.zeros((components - 1, *GRID))
    if terms.steady is not None:
        drift[:2] += terms.steady[:, None]
    if components == 4 and terms.turning is not None:
        theta = 2.0 * np.pi * np.arange(ANGLES)[:, None, None] / ANGLES
        even, sine, cosine = terms.turning
        drift[2] += even + sine * np.sin(2.0 * theta) + cosine * np.cos(2.0 * theta)
        if isinstance(terms.angular, Sine):
            drift[2] -= terms.angular.amplitude * np.cos(theta)
    if forces is not None:
        drift[0] += terms.inverse_mass * np.tile(forces.x.astype(np.float64), (2, 1, 1))
        drift[1] += terms.inverse_mass * np.tile(forces.y.astype(np.float64), (2, 1, 1))
        if forces.torque is not None:
            drift[2] += terms.inverse_inertia * np.tile(forces.torque.astype(np.float64), (2, 1, 1))
    return drift


def cells_of(fields: Floats) -> Cells:
    """What sources see of padded fields; the drift is not kept."""
    each, none = tuple(range(len(fields))), np.zeros((len(fields) - 1, 0, ROWS, COLUMNS))
    return Cells(fields, occupied_extents(fields), none, each[:-1], each, (), ())


def do(
    cells: Cells,
    terms: CellTerms,
    force: Acceleration,
    dt: float | None = None,
    limit: CellwiseLimit | None = None,
) -> Floats:
    """One pass: a kick over dt, if any, and what a limit reaches, if there is one."""
    velocities = len(cells.rates)
    work = Work(exact_kick(terms, dt or 0.0, velocities), dt is not None, 0.0, limit is not None)
    zero = (0.0,) * velocities
    return treat(cells, force, work, limit or CellwiseLimit(cells.rates, zero, zero, zero))


@pytest.mark.parametrize("components", [3, 4])
@pytest.mark.parametrize("kind", [None, np.float32, np.float64])
def test_accelerations_are_their_formula(components: int, kind: type[np.floating] | None) -> None:
    """To rounding, forces in single precision taken as they are."""
    turns = components == 4
    terms, forces = some_terms(turns), some_forces(turns, kind) if kind else None
    cells, out = cells_of(some_fields(components)), np.full((components - 1, *GRID), np.nan)
    whole = np.broadcast_to(np.array([0, COLUMNS]), (ANGLES, ROWS, 2)).copy()
    cells = cells._replace(extents=whole, drift=out)
    do(cells, terms, acceleration(terms, forces, vacuum=-math.inf))
    np.testing.assert_allclose(out, expected_drift(terms, forces, components), rtol=1e-13)


@pytest.mark.parametrize("components", [3, 4])
@pytest.mark.parametrize("kind", [None, np.float32, np.float64])
def test_a_kick_is_the_exact_solution(components: int, kind: type[np.floating] | None) -> None:
    """M becomes e^{-Gamma dt} m + gain q F, to rounding; vacuum stays empty."""
    turns, dt = components == 4, 0.2
    terms, forces = some_terms(turns), some_forces(turns, kind) if kind else None
    fields = some_fields(components)
    inner, drift = inside(fields).copy(), expected_drift(terms, forces, components)
    assert not do(cells_of(fields), terms, acceleration(terms, forces), dt).any()
    change = exact_kick(terms, dt, components - 1)
    decay, gain = np.array(change.decay), np.array(change.gain)
    scaled = decay[:, None, None, None] * inner[1:] + gain[:, None, None, None] * inner[0] * drift
    np.testing.assert_allclose(inside(fields)[1:], scaled, rtol=1e-12, atol=1e-14)
    assert np.array_equal(inside(fields)[0], inner[0])


@pytest.mark.parametrize("damped", [False, True])
@pytest.mark.parametrize("sound", [0.0, 1.6])
def test_the_largest_step_moves_the_fastest_cell_just_so_far(damped: bool, sound: float) -> None:
    """Dt (|v| + sound + |F - Gamma v| dt/2) = distance, or the terminal speed's bound; to 1e-12."""
    terms, forces = some_terms(True, damping=30.0), some_forces(True, np.float64)
    fields = some_fields(4)
    inner, drift = inside(fields), expected_drift(terms, forces, 4)
    held = inner[0] > 0.0
    distances = np.array([0.1, 0.2, 0.3])
    expected = []
    for d, rate in enumerate((terms.damping, terms.damping, terms.angular_damping)):
        v = inner[1 + d][held] / inner[0][held]
        change, speed = np.abs(drift[d][held] - rate * v), np.abs(v) + sound
        dt = 2.0 * distances[d] / (speed + np.sqrt(speed**2 + 2.0 * change * distances[d]))
        np.testing.assert_allclose(dt * (speed + 0.5 * change * dt), distances[d], rtol=1e-12)
        longer = np.maximum(dt, distances[d] / (speed + change / rate)) if damped else dt
        expected.append(longer.min())
    reach = tuple(distances.tolist())
    limit = CellwiseLimit((0, 1, 2), reach, dampings(terms, 3), reach, sound, damped)
    force = acceleration(terms, forces)
    found = limit.steps(do(cells_of(fields), terms, force, limit=limit))
    assert found == pytest.approx((min(expected[:2]), expected[2]), rel=1e-12)
    inside(fields)[2][held] = np.nan
    assert limit.steps(do(cells_of(fields), terms, force, limit=limit))[0] == 0.0


@pytest.mark.parametrize("axis", [-1, -2, -3])
@pytest.mark.parametrize("ends", [STOPS, MIRRORS, WRAPS, PASSES])
@pytest.mark.parametrize("interacting", [False, True])
def test_work_is_that_of_the_trapezoidal_rule(axis: int, ends: int, interacting: bool) -> None:
    """Between all neighbours; nothing across a wall, mirrored in its ghosts; what passes goes on."""
    rng = np.random.default_rng(9)
    pull, half, weight = 6.0 * rng.standard_normal(GRID), 0.4, 1.5
    potential = rng.standard_normal((ANGLES // 2, ROWS, COLUMNS)) if interacting else None
    work = half * (pull + np.roll(pull, -1, axis))
    if potential is not None:
        full = np.tile(potential, (2, 1, 1))
        work += weight * (full - np.roll(full, -1, axis))
    expected = np.zeros([n + 2 * GHOSTS for n in GRID])
    inside(expected)[...] = work
    if axis == -3:
        fill_periodic(expected[None], 1)
    elif ends == WRAPS:
        lines = np.moveaxis(expected, axis, 0)
        lines[:GHOSTS], lines[-GHOSTS:] = lines[-2 * GHOSTS : -GHOSTS], lines[GHOSTS : 2 * GHOSTS]
    else:
        lines = np.moveaxis(expected, axis, 0)
        lines[-GHOSTS - 1] = 0.0
        if ends == MIRRORS:
            lines[0], lines[-GHOSTS] = -lines[GHOSTS], -lines[-GHOSTS - 2]
        elif ends == PASSES:
            lines[:GHOSTS], lines[-GHOSTS - 1 :] = lines[GHOSTS], lines[-GHOSTS - 2]
    kept = np.clip(expected, -STEEPEST, STEEPEST)
    assert (kept != expected).any()
    out = np.array([np.ones(expected.size), np.zeros(expected.size)])
    set_work(pull, potential, axis, (ends, ends), (half, weight), out)
    np.testing.assert_allclose(out[0], np.exp(0.5 * kept).ravel(), rtol=1e-14)
    np.testing.assert_allclose(out[1], (expected - kept).ravel(), atol=1e-14)


@pytest.mark.parametrize("components", [3, 4])
def test_the_density_ahead_loses_what_flows_out(components: int) -> None:
    """By central differences over the ghosts, to rounding."""
    fields = some_fields(components)
    axes = (-1, -2, -3)[: components - 1]
    factors = (0.1, 0.2, 0.3)[: components - 1]
    expected = inside(fields)[0].copy()
    for axis, factor in zip(axes, factors, strict=True):
        if axis == -3:
            fill_periodic(fields, 1)
        else:
            fill(fields, axis, Reflect())
        momentum = fields[NORMAL[axis]]
        high, low = np.roll(momentum, -1, axis), np.roll(momentum, 1, axis)
        expected -= factor * inside(high - low)
    out = np.full(GRID, np.nan)
    set_ahead(fields, axes, factors, out)
    np.testing.assert_allclose(out, expected, atol=1e-14)
