"""Sources of `eq:macro_rho_mono` cell by cell: drift, damping, and the turning of the mean angle.

Conserved fields (K, ny + 4, nx + 4): rho, rho v_x, rho v_y and, where something turns, rho phi and
rho omega. In a cell the particles share v, phi and omega, so the sources are those of one particle:

    v' = F - Gamma v          phi' = omega          omega' = F_bar - Gamma_bar omega
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import (
    Values,
    add,
    axpy,
    div,
    fill,
    maximum,
    mul,
    scale,
    select,
    total,
)
from ellipsoid_coupling.compiled.jit import (
    apart_kernel,
    inline_kernel,
    kernel,
    parallel_kernel,
)
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, unpack
from ellipsoid_coupling.compiled.rows import Rows, load, map_fields, rows_at, store
from ellipsoid_coupling.finite_volume.cell_acceleration import (
    CellTerms,
    Drive,
    NoForces,
    angular_rate,
    drive_at,
    driven,
)
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.physics.angular import outer_torque
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.scenes.kinds import Record

Floats = NDArray[np.float64]

RHO, MOMENTUM_X, MOMENTUM_Y, ANGLE, SPIN = range(5)

# Newton's iteration for the angle converges quadratically from a guess that is dt^2 off.
_NEWTON_STEPS = 4


# Rows are dealt out in so many tasks at most, each with peaks of its own.
_TASKS = 64


class Extremes(NamedTuple):
    """The largest |v_x| or |v_y|, |omega|, |F_x| or |F_y| and |F_bar|; infinite if not finite."""

    speed: float
    spin: float
    force: float
    torque: float


@inline_kernel
def _drift_of(cell: Values, drive: Drive, angular: Record | None, i: int) -> Values:
    """F_x, F_y and, where it turns, F_bar of cell i of a run, which holds `cell`; 0 in vacuum."""
    # Vacuum has no angle; what comes out for it is not used.
    angle = total(div(cell[ANGLE:SPIN], cell[RHO]))
    double, outer = cos_sin(2.0 * angle), outer_torque(angular, angle)
    rates = driven(drive, i, double, outer, cell[SPIN:])
    return select(cell[RHO] <= 0.0, fill(0.0, rates), rates)


@apart_kernel
def _set_drift_row(
    cells: Rows, drive: Drive, angular: Record | None, width: int, drift: Rows
) -> None:
    for i in range(round_up_to_vectors(width)):
        if i < width:
            store(drift, i, _drift_of(load(cells, i), drive, angular, i))


@parallel_kernel
def _set_drift(
    fields: Floats,
    components: tuple[int, ...],
    rates: tuple[int, ...],
    terms: CellTerms,
    forces: Any,
    drift: Floats,
) -> None:
    rows, columns = drift.shape[1:]
    packed = pack(terms)
    for j in numba.prange(rows):
        here = unpack(packed)
        cells = _cells(fields, components, j)
        drive = drive_at(here, forces, (j, rows, 0), j)
        _set_drift_row(cells, drive, here.angular, columns, _drifts(drift, rates, j))


@inline_kernel
def _cells(fields: Floats, components: tuple[int, ...], j: int) -> Rows:
    """Row j of the interior of padded fields."""
    return rows_at(fields, axpy(components, fields.shape[1], j + GHOSTS), GHOSTS)


@inline_kernel
def _drifts(drift: Floats, rates: tuple[int, ...], j: int) -> Rows:
    """Row j of the drift; of a drift of one row, that one."""
    return rows_at(drift, axpy(rates, drift.shape[1], j % drift.shape[1]), 0)


def _parts(fields: Floats) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The components of fields and drift: kernels know by the lengths how many there are."""
    components = fields.shape[0]
    return tuple(range(components)), tuple(range(components // 2 + 1))


def set_drift(fields: Floats, terms: CellTerms, forces: Forces | None, drift: Floats) -> None:
    """Write F_x, F_y and F_bar of every cell that is not vacuum.

    Parameters
    ----------
    fields : (5 or 3, ny + 4, nx + 4) float64
    terms : CellTerms
    forces : Forces or None
        Interaction and walls, not yet divided by mass and inertia; None without interaction.
    drift : (3 or 2, ny, nx)
        Overwritten.
    """
    _set_drift(fields, *_parts(fields), terms, forces or NoForces(), drift)


class Kick(NamedTuple):
    """The exact solution of v' = F - Gamma v over a time: v becomes decay v + gain F."""

    decay: float
    gain: float
    spin_decay: float
    spin_gain: float


def exact_kick(terms: CellTerms, dt: float) -> Kick:
    """Of v and of omega."""
    linear, angular = terms.damping, terms.angular_damping
    return Kick(
        math.exp(-linear * dt),
        exact_gain(linear, dt),
        math.exp(-angular * dt),
        exact_gain(angular, dt),
    )


def exact_gain(rate: float, dt: float) -> float:
    """The integral of exp(-rate s) over a step."""
    return -math.expm1(-rate * dt) / rate if rate else dt


@inline_kernel
def kicked(density: float, carried: Values, drift: Values, decay: Values, gain: Values) -> Values:
    """Rho v after a kick, v becoming decay v + gain F, for each component of the momentum."""
    return add(mul(decay, carried), mul(scale(density, gain), drift))


@inline_kernel
def _kicked_cell(cell: Values, drift: Values, change: Kick) -> Values:
    """Momenta and spin of a cell after a kick."""
    spins = cell[SPIN:]
    decays = (change.decay, change.decay, *fill(change.spin_decay, spins))
    gains = (change.gain, change.gain, *fill(change.spin_gain, spins))
    carried = cell[MOMENTUM_X:ANGLE] + spins
    return kicked(cell[RHO], carried, drift, decays, gains)


@apart_kernel
def _kick_row(cells: Rows, drift: Rows, change: Kick, turning: float, width: int) -> None:
    momenta, angles, spins = cells[MOMENTUM_X:ANGLE], cells[ANGLE:SPIN], cells[SPIN:]
    for i in range(round_up_to_vectors(width)):
        if i < width:
            cell = load(cells, i)
            new = _kicked_cell(cell, load(drift, i), change)
            store(momenta + spins, i, new)
            store(angles, i, axpy(turning, new[2:], cell[ANGLE:SPIN]))


@parallel_kernel
def _kick(
    fields: Floats,
    components: tuple[int, ...],
    rates: tuple[int, ...],
    drift: Floats,
    change: Kick,
    turning: float,
) -> None:
    rows, columns = drift.shape[1:]
    for j in numba.prange(rows):
        cells = _cells(fields, components, j)
        _kick_row(cells, _drifts(drift, rates, j), change, turning, columns)


def kick(fields: Floats, drift: Floats, change: Kick, turning: float) -> None:
    """Kick v and omega in the drift as it is; then phi += turning omega, where it turns."""
    _kick(fields, *_parts(fields), drift, change, turning)


@inline_kernel
def _size(weight: float, value: float) -> float:
    """Magnitude of a rate or of a carried quantity; infinite if not finite."""
    size = abs(value * weight)
    # A comparison that is false for NaN.
    known = size < np.inf
    return size if known else np.inf


@inline_kernel
def _sizes(density: float, carried: Values, drift: Values) -> Values:
    """Speed, force and, where they are given, spin and torque of a cell."""
    # Written so that NaN is no vacuum.
    inverse = 0.0 if density <= 0.0 else 1.0 / density
    rates, forces = map_fields(_size, (inverse,), (carried,)), map_fields(_size, (1.0,), (drift,))
    return (max(rates[0], rates[1]), max(forces[0], forces[1]), *rates[2:], *forces[2:])


@apart_kernel
def _kick_anew_row(
    cells: Rows,
    drive: Drive,
    angular: Record | None,
    change: Kick,
    width: int,
    drift: Rows,
    peaks: Rows,
) -> None:
    momenta, spins = cells[MOMENTUM_X:ANGLE], cells[SPIN:]
    for i in range(round_up_to_vectors(width)):
        if i < width:
            cell = load(cells, i)
            here = _drift_of(cell, drive, angular, i)
            store(drift, i, here)
            new = _kicked_cell(cell, here, change)
            store(momenta + spins, i, new)
            found = _sizes(cell[RHO], new, here)
            store(peaks, i, maximum(load(peaks, i), found))


@apart_kernel
def _raise_row(cells: Rows, drift: Rows, width: int, peaks: Rows) -> None:
    for i in range(round_up_to_vectors(width)):
        if i < width:
            cell = load(cells, i)
            found = _sizes(cell[RHO], cell[MOMENTUM_X:ANGLE] + cell[SPIN:], load(drift, i))
            store(peaks, i, maximum(load(peaks, i), found))


@parallel_kernel
def _kick_anew(
    fields: Floats,
    components: tuple[int, ...],
    rates: tuple[int, ...],
    terms: CellTerms,
    forces: Any,
    drift: Floats,
    change: Kick,
    largest: Floats,
) -> None:
    rows, columns = drift.shape[1:]
    tasks = largest.shape[0]
    packed = pack(terms)
    for task in numba.prange(tasks):
        here = unpack(packed)
        found = np.zeros((len(components) - 1, columns))
        peaks = rows_at(found, components[:-1], 0)
        for j in range(task * rows // tasks, (task + 1) * rows // tasks):
            cells, drifts = _cells(fields, components, j), _drifts(drift, rates, j)
            drive = drive_at(here, forces, (j, rows, 0), j)
            _kick_anew_row(cells, drive, here.angular, change, columns, drifts, peaks)
        for k in range(found.shape[0]):
            largest[task, k] = found[k].max()


def kick_anew(
    fields: Floats, terms: CellTerms, forces: Forces | None, drift: Floats, change: Kick
) -> Extremes:
    """`set_drift`, a kick, and what `extremes` finds after that, in one pass over memory."""
    largest = np.zeros((min(drift.shape[1], _TASKS), 4))
    here = fields, *_parts(fields), terms, forces or NoForces(), drift
    _kick_anew(*here, change, largest)
    return _extremes_of(largest)


def _extremes_of(largest: Floats) -> Extremes:
    """Of what tasks have found, (tasks, 4): speeds, forces, spins and torques."""
    speed, force, spin, torque = largest.max(axis=0)
    return Extremes(float(speed), float(spin), float(force), float(torque))


@apart_kernel
def _turn_row(cells: Rows, turning: float, width: int) -> None:
    angles, spins = cells[ANGLE:SPIN], cells[SPIN:]
    for i in range(round_up_to_vectors(width)):
        if i < width:
            store(angles, i, axpy(turning, load(spins, i), load(angles, i)))


@parallel_kernel
def _turn(fields: Floats, components: tuple[int, ...], turning: float) -> None:
    rows, columns = fields.shape[1] - 2 * GHOSTS, fields.shape[2] - 2 * GHOSTS
    for j in numba.prange(rows):
        _turn_row(_cells(fields, components, j), turning, columns)


def turn(fields: Floats, turning: float) -> None:
    """Set phi to phi + turning omega, in place; nothing where nothing turns."""
    if fields.shape[0] > ANGLE:
        _turn(fields, _parts(fields)[0], turning)


@parallel_kernel
def step_implicitly(fields: Floats, drift: Floats, terms: CellTerms, dt: float) -> None:
    """One implicit Euler step of all sources, in place; the paper's treatment.

        v1 = (v + dt F)/(1 + dt Gamma)
        phi1 = phi + dt omega1,  omega1 = (omega + dt F_bar(phi1))/(1 + dt Gamma_bar)

    The torque of the interaction is that of the old angle, fluid and V2 are taken at the new one by
    Newton's iteration.
    """
    packed = pack(terms)
    for j in numba.prange(drift.shape[1]):
        here = unpack(packed)
        for i in range(drift.shape[2]):
            rho = fields[RHO, j + GHOSTS, i + GHOSTS]
            if rho <= 0.0:
                continue
            for d in range(2):
                k = MOMENTUM_X + d
                pushed = fields[k, j + GHOSTS, i + GHOSTS] + dt * rho * drift[d, j, i]
                fields[k, j + GHOSTS, i + GHOSTS] = pushed / (1.0 + dt * here.damping)
            if fields.shape[0] == 5:
                angle = fields[ANGLE, j + GHOSTS, i + GHOSTS] / rho
                spin = fields[SPIN, j + GHOSTS, i + GHOSTS] / rho
                new = _implicit_spin(angle, spin, drift[2, j, i], here, (j, i), dt)
                fields[SPIN, j + GHOSTS, i + GHOSTS] = rho * new
                fields[ANGLE, j + GHOSTS, i + GHOSTS] += dt * rho * new


@kernel
def _implicit_spin(
    angle: float, spin: float, drift: float, terms: CellTerms, cell: tuple[int, int], dt: float
) -> float:
    """omega1 of one cell."""
    j, i = cell
    old_rate, _ = angular_rate(terms.turning, terms.angular, j, i, angle)
    inertia = 1.0 + dt * terms.angular_damping
    new = (spin + dt * drift) / inertia
    for _ in range(_NEWTON_STEPS):
        rate, slope = angular_rate(terms.turning, terms.angular, j, i, angle + dt * new)
        miss = inertia * new - spin - dt * (drift - old_rate + rate)
        new -= miss / (inertia - dt * dt * slope)
    return new


@parallel_kernel
def _extremes(
    fields: Floats,
    components: tuple[int, ...],
    rates: tuple[int, ...],
    drift: Floats,
    largest: Floats,
) -> None:
    rows, columns = fields.shape[1] - 2 * GHOSTS, fields.shape[2] - 2 * GHOSTS
    tasks = largest.shape[0]
    for task in numba.prange(tasks):
        found = np.zeros((len(components) - 1, columns))
        peaks = rows_at(found, components[:-1], 0)
        for j in range(task * rows // tasks, (task + 1) * rows // tasks):
            cells, drifts = _cells(fields, components, j), _drifts(drift, rates, j)
            _raise_row(cells, drifts, columns, peaks)
        for k in range(found.shape[0]):
            largest[task, k] = found[k].max()


def extremes(fields: Floats, drift: Floats | None) -> Extremes:
    """Of all cells that are not vacuum; no force and torque without a drift."""
    largest = np.zeros((min(fields.shape[1] - 2 * GHOSTS, _TASKS), 4))
    components, rates = _parts(fields)
    nothing = np.zeros((len(rates), 1, fields.shape[2] - 2 * GHOSTS))
    _extremes(fields, components, rates, nothing if drift is None else drift, largest)
    return _extremes_of(largest)
