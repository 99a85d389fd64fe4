"""Sources of `eq:macro_rho_mono` cell by cell: drift, damping, and the turning of the mean angle.

Conserved fields (K, ny + 4, nx + 4): rho, rho v_x, rho v_y and, where something turns, rho phi and
rho omega. In a cell the particles share v, phi and omega, so the sources are those of one particle:

    v' = F - Gamma v          phi' = omega          omega' = F_bar - Gamma_bar omega
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.kernels import kernel, parallel_kernel, view_kernel
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.external import sine_torque
from ellipsoid_coupling.schemes.grid import GHOSTS

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


class CellTerms(NamedTuple):
    """What drives a cell, made once; None where the scene does not have it.

    Attributes
    ----------
    steady : (2, ny, nx) float64 or None
        gamma u - grad V1.
    turning : (3, ny, nx) or None
        gamma_bar times the three coefficients of Jeffery's term g = a + b sin 2 phi + c cos 2 phi.
    amplitude : float or None
        Of V2.
    damping, angular_damping : float
        gamma + A^2/2, gamma_bar + B^2/2.
    inverse_mass, inverse_inertia : float
    """

    steady: Floats | None
    turning: Floats | None
    amplitude: float | None
    damping: float
    angular_damping: float
    inverse_mass: float
    inverse_inertia: float


@kernel
def angular_rate(
    turning: Floats | None, amplitude: float | None, j: int, i: int, angle: float
) -> tuple[float, float]:
    """gamma_bar g - dV2/dtheta and its derivative with respect to the angle."""
    rate, slope = 0.0, 0.0
    if turning is not None:
        c2, s2 = cos_sin(2.0 * angle)
        rate += turning[0, j, i] + turning[1, j, i] * s2 + turning[2, j, i] * c2
        slope += 2.0 * (turning[1, j, i] * c2 - turning[2, j, i] * s2)
    if amplitude is not None:
        rate += sine_torque(angle, amplitude)
        slope += amplitude * cos_sin(angle)[1]
    return rate, slope


@parallel_kernel
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
    for j in numba.prange(drift.shape[1]):
        _set_drift_row(fields, terms, forces, j, drift)


@view_kernel
def _set_drift_row(
    fields: Floats, terms: CellTerms, forces: Forces | None, j: int, drift: Floats
) -> None:
    density = fields[RHO, j + GHOSTS, GHOSTS:-GHOSTS]
    if fields.shape[0] == 5:
        carried = fields[ANGLE, j + GHOSTS, GHOSTS:-GHOSTS]
        _set_turning(terms, density, carried, j, drift[2, j])
    if forces is None:
        set_pull(terms.steady, (0, j), None, (0,), 0.0, 0, drift[0, j])
        set_pull(terms.steady, (1, j), None, (0,), 0.0, 0, drift[1, j])
    else:
        set_pull(terms.steady, (0, j), forces.x, (j,), terms.inverse_mass, 0, drift[0, j])
        set_pull(terms.steady, (1, j), forces.y, (j,), terms.inverse_mass, 0, drift[1, j])
        if fields.shape[0] == 5:
            add_torque(forces.torque, (j,), terms.inverse_inertia, 0, drift[2, j])
    for d in range(drift.shape[0]):
        _clear_vacuum(density, drift[d, j])


@view_kernel
def set_pull(
    steady: Floats | None,
    steady_row: tuple[int, int],
    force: NDArray[np.floating] | None,
    force_row: tuple[int, ...],
    weight: float,
    first: int,
    out: Floats,
) -> None:
    """F_x or F_y of a run of cells from `first` on: the steady part and the weighted force."""
    # Runs are cut out before a loop: an index that is a sum would be gathered, not read in line.
    end = first + out.size
    if steady is not None:
        here = steady[steady_row][first:end]
        if force is not None:
            push = force[force_row][first:end]
            for i in range(out.size):
                out[i] = here[i] + weight * push[i]
        else:
            for i in range(out.size):
                out[i] = here[i]
    elif force is not None:
        push = force[force_row][first:end]
        for i in range(out.size):
            out[i] = weight * push[i]
    else:
        out[:] = 0.0


@view_kernel
def add_torque(
    torque: NDArray[np.floating] | None,
    row: tuple[int, ...],
    weight: float,
    first: int,
    out: Floats,
) -> None:
    """Add the weighted torque of a run of cells from `first` on, if there is any."""
    if torque is not None:
        here = torque[row][first : first + out.size]
        for i in range(out.size):
            out[i] += weight * here[i]


@view_kernel
def _set_turning(terms: CellTerms, density: Floats, carried: Floats, j: int, out: Floats) -> None:
    """`angular_rate` of a row; `carried` is rho phi."""
    turning, amplitude = terms.turning, terms.amplitude
    for i in range(out.size):
        # Vacuum has no angle; what is written there is cleared.
        angle = carried[i] / density[i]
        out[i] = angular_rate(turning, amplitude, j, i, angle)[0]


@view_kernel
def _clear_vacuum(density: Floats, out: Floats) -> None:
    for i in range(out.size):
        out[i] = 0.0 if density[i] <= 0.0 else out[i]


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


@parallel_kernel
def kick(fields: Floats, drift: Floats, change: Kick, turning: float) -> None:
    """Kick v and omega in the drift as it is, in place; then phi += turning omega, where it turns."""
    for j in numba.prange(drift.shape[1]):
        _kick_row(fields, drift, change, j)
        if fields.shape[0] == 5 and turning != 0.0:
            _turn_row(fields, j, turning)


@parallel_kernel
def kick_anew(
    fields: Floats, terms: CellTerms, forces: Forces | None, drift: Floats, change: Kick
) -> Extremes:
    """`set_drift`, `kick` and what `extremes` finds after that, in one pass over memory."""
    rows, columns = drift.shape[1:]
    tasks = min(rows, _TASKS)
    largest = np.zeros((tasks, 4))
    for task in numba.prange(tasks):
        peaks, inverse = np.zeros((4, columns)), np.empty(columns)
        for j in range(task * rows // tasks, (task + 1) * rows // tasks):
            _set_drift_row(fields, terms, forces, j, drift)
            _kick_row(fields, drift, change, j)
            _raise_row(fields, drift, j, inverse, peaks)
        for k in range(4):
            largest[task, k] = peaks[k].max()
    return _largest_of(largest)


@view_kernel
def _kick_row(fields: Floats, drift: Floats, change: Kick, j: int) -> None:
    density = fields[RHO, j + GHOSTS, GHOSTS:-GHOSTS]
    for d in range(2):
        momentum = fields[MOMENTUM_X + d, j + GHOSTS, GHOSTS:-GHOSTS]
        _kick(momentum, density, drift[d, j], change.decay, change.gain)
    if fields.shape[0] == 5:
        spins = fields[SPIN, j + GHOSTS, GHOSTS:-GHOSTS]
        _kick(spins, density, drift[2, j], change.spin_decay, change.spin_gain)


@view_kernel
def _kick(carried: Floats, density: Floats, rate: Floats, decay: float, gain: float) -> None:
    for i in range(density.size):
        carried[i] = decay * carried[i] + gain * density[i] * rate[i]


@view_kernel
def _turn_row(fields: Floats, j: int, dt: float) -> None:
    angles = fields[ANGLE, j + GHOSTS, GHOSTS:-GHOSTS]
    spins = fields[SPIN, j + GHOSTS, GHOSTS:-GHOSTS]
    for i in range(angles.size):
        angles[i] += dt * spins[i]


@parallel_kernel
def turn(fields: Floats, dt: float) -> None:
    """Phi += dt omega in every cell, in place; nothing where nothing turns."""
    if fields.shape[0] == 5:
        for j in numba.prange(fields.shape[1] - 2 * GHOSTS):
            _turn_row(fields, j, dt)


@parallel_kernel
def step_implicitly(fields: Floats, drift: Floats, terms: CellTerms, dt: float) -> None:
    """One implicit Euler step of all sources, in place; the paper's treatment.

        v1 = (v + dt F)/(1 + dt Gamma)
        phi1 = phi + dt omega1,  omega1 = (omega + dt F_bar(phi1))/(1 + dt Gamma_bar)

    The torque of the interaction is that of the old angle, fluid and V2 are taken at the new one by
    Newton's iteration.
    """
    for j in numba.prange(drift.shape[1]):
        for i in range(drift.shape[2]):
            rho = fields[RHO, j + GHOSTS, i + GHOSTS]
            if rho <= 0.0:
                continue
            for d in range(2):
                k = MOMENTUM_X + d
                pushed = fields[k, j + GHOSTS, i + GHOSTS] + dt * rho * drift[d, j, i]
                fields[k, j + GHOSTS, i + GHOSTS] = pushed / (1.0 + dt * terms.damping)
            if fields.shape[0] == 5:
                angle = fields[ANGLE, j + GHOSTS, i + GHOSTS] / rho
                spin = fields[SPIN, j + GHOSTS, i + GHOSTS] / rho
                new = _implicit_spin(angle, spin, drift[2, j, i], terms, (j, i), dt)
                fields[SPIN, j + GHOSTS, i + GHOSTS] = rho * new
                fields[ANGLE, j + GHOSTS, i + GHOSTS] += dt * rho * new


@kernel
def _implicit_spin(
    angle: float, spin: float, drift: float, terms: CellTerms, cell: tuple[int, int], dt: float
) -> float:
    """omega1 of one cell."""
    j, i = cell
    old_rate, _ = angular_rate(terms.turning, terms.amplitude, j, i, angle)
    inertia = 1.0 + dt * terms.angular_damping
    new = (spin + dt * drift) / inertia
    for _ in range(_NEWTON_STEPS):
        rate, slope = angular_rate(terms.turning, terms.amplitude, j, i, angle + dt * new)
        miss = inertia * new - spin - dt * (drift - old_rate + rate)
        new -= miss / (inertia - dt * dt * slope)
    return new


@view_kernel
def _raise_to(carried: Floats, inverse: Floats, peaks: Floats) -> None:
    """Raise `peaks` to the magnitude of carried * inverse; what is not finite counts as infinite."""
    for i in range(peaks.size):
        size = abs(carried[i] * inverse[i])
        known = size < np.inf
        peaks[i] = max(peaks[i], size if known else np.inf)


@view_kernel
def _raise_row(
    fields: Floats, drift: Floats | None, j: int, inverse: Floats, peaks: Floats
) -> None:
    """Raise `peaks` (4, nx) to a row's speeds, spins and, with the drift, forces and torques."""
    density = fields[RHO, j + GHOSTS, GHOSTS:-GHOSTS]
    for i in range(inverse.size):
        # Written so that NaN is no vacuum.
        inverse[i] = 0.0 if density[i] <= 0.0 else 1.0 / density[i]
    for d in range(2):
        _raise_to(fields[MOMENTUM_X + d, j + GHOSTS, GHOSTS:-GHOSTS], inverse, peaks[0])
    if fields.shape[0] == 5:
        _raise_to(fields[SPIN, j + GHOSTS, GHOSTS:-GHOSTS], inverse, peaks[1])
    if drift is not None:
        inverse[:] = 1.0
        for d in range(drift.shape[0]):
            _raise_to(drift[d, j], inverse, peaks[3 if d == 2 else 2])


@kernel
def _largest_of(largest: Floats) -> Extremes:
    return Extremes(
        largest[:, 0].max(), largest[:, 1].max(), largest[:, 2].max(), largest[:, 3].max()
    )


@parallel_kernel
def extremes(fields: Floats, drift: Floats | None) -> Extremes:
    """Of all cells that are not vacuum; no force and torque without a drift."""
    rows, columns = fields.shape[1] - 2 * GHOSTS, fields.shape[2] - 2 * GHOSTS
    tasks = min(rows, _TASKS)
    largest = np.zeros((tasks, 4))
    for task in numba.prange(tasks):
        peaks, inverse = np.zeros((4, columns)), np.empty(columns)
        for j in range(task * rows // tasks, (task + 1) * rows // tasks):
            _raise_row(fields, drift, j, inverse, peaks)
        for k in range(4):
            largest[task, k] = peaks[k].max()
    return _largest_of(largest)
