"""Sources of `eq:macro_q_max` and `eq:macro_q_mono` cell by cell; the closure does not enter them.

At a fixed place and angle the force and torque do not depend on the velocities, so

    v' = F - Gamma v,                       F     = gamma u - grad V1 + force/m
    omega' = F_bar - Gamma_bar omega,       F_bar = gamma_bar g - dV2/dtheta + torque/I_c

are linear: the exact solution and an implicit Euler step are both a multiplication and an addition.
Fields are (4 or 3, na + 4, ny + 4, nx + 4); only the part of a row that holds mass is visited.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.angle_grid import AngleForces
from ellipsoid_coupling.kernels import parallel_kernel, view_kernel
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.external import sine_torque
from ellipsoid_coupling.schemes.grid import GHOSTS
from ellipsoid_coupling.schemes.q_grid import FULL_TURN, QVX, Extents, Q
from ellipsoid_coupling.schemes.sources import CellTerms, Kick, add_torque, exact_kick, set_pull
from ellipsoid_coupling.schemes.step_control import CFL, ROTATION

Floats = NDArray[np.float64]


# Runs are cut out before a loop: an index that is a sum would be gathered, not read in line.


@view_kernel
def _set_turning(
    turning: Floats | None, amplitude: float | None, j: int, first: int, angle: float, out: Floats
) -> None:
    """gamma_bar g - dV2/dtheta at a fixed angle."""
    if turning is not None:
        c2, s2 = cos_sin(2.0 * angle)
        end = first + out.size
        spin, along, across = (
            turning[0, j, first:end],
            turning[1, j, first:end],
            turning[2, j, first:end],
        )
        for i in range(out.size):
            out[i] = spin[i] + along[i] * s2 + across[i] * c2
    else:
        out[:] = 0.0
    if amplitude is not None:
        torque = sine_torque(angle, amplitude)
        for i in range(out.size):
            out[i] += torque


@view_kernel
def _accelerate(
    terms: CellTerms,
    forces: AngleForces | None,
    at: tuple[int, int, int],
    angle: float,
    out: Floats,
) -> None:
    """F and F_bar of a run of cells from `at` (angle, y, x) along x on: out (3 or 2, width)."""
    if out.shape[0] == 3:
        _set_turning(terms.turning, terms.amplitude, at[1], at[2], angle, out[2])
    j, first = at[1], at[2]
    if forces is None:
        set_pull(terms.steady, (0, j), None, (0, 0), 0.0, first, out[0])
        set_pull(terms.steady, (1, j), None, (0, 0), 0.0, first, out[1])
    else:
        # The potential tells some of the angles apart only.
        row = at[0] % forces.x.shape[0], j
        set_pull(terms.steady, (0, j), forces.x, row, terms.inverse_mass, first, out[0])
        set_pull(terms.steady, (1, j), forces.y, row, terms.inverse_mass, first, out[1])
        if out.shape[0] == 3:
            add_torque(forces.torque, row, terms.inverse_inertia, first, out[2])


@parallel_kernel
def accelerations(terms: CellTerms, forces: AngleForces | None, out: Floats) -> None:
    """F_x, F_y and, where it turns, F_bar of all cells: out (3 or 2, na, ny, nx), overwritten."""
    na, ny = out.shape[1], out.shape[2]
    for task in numba.prange(na * ny):
        a, j = task // ny, task % ny
        _accelerate(terms, forces, (a, j, 0), FULL_TURN * a / na, out[:, a, j])


# Rows of all angles are dealt out in so many tasks.
_TASKS = 64


class Limits(NamedTuple):
    """What bounds a step.

    Attributes
    ----------
    distances : (2 or 3,) float64
        How far mass may move along x, y and, where it is transported in it, the angle.
    sound : float
        Speed of sound, which adds to the velocities.
    damped : bool
        Damping is solved exactly, so that no velocity passes F/Gamma within a step.
    """

    distances: Floats
    sound: float
    damped: bool = False


# The step that flights in space and that turning allow.
Steps = tuple[float, float]


def shorter(steps: Steps) -> tuple[float, int]:
    """The shorter of both, and what it is limited by."""
    return min((steps[0], CFL), (steps[1], ROTATION))


@view_kernel
def _raise_speeds(
    fields: Floats,
    at: tuple[int, int, int],
    drift: Floats,
    rates: Floats,
    limits: tuple[Floats, float, bool],
    inverse: Floats,
    peaks: Floats,
) -> None:
    """Raise `peaks` (3 or 2, nx) to distance/dt for the largest dt of every cell of a run.

    dt (|v| + sound + |F - Gamma v| dt/2) = distance, so that with s = |v| + sound, a = |F - Gamma v|

        distance/dt = (s + sqrt(s^2 + 2 a distance))/2

    or s + a/Gamma, where damping holds velocities and that is less. What is not finite counts as
    infinite, so that the caller notices.

    limits : distances, sound and damped of `Limits`.
    drift : F and F_bar of the run. inverse : room for a run.
    """
    distances, sound, damped = limits
    a, j, begin = at
    width = drift.shape[1]
    q = fields[Q, a, j, begin : begin + width]
    for i in range(width):
        # Vacuum is what is not more than 0, so that NaN is none and shows.
        inverse[i] = 0.0 if q[i] <= 0.0 else 1.0 / q[i]
    for d in range(distances.size):
        momentum, pull, peak = fields[QVX + d, a, j, begin : begin + width], drift[d], peaks[d]
        rate, distance = rates[d], distances[d]
        holds = damped and rate > 0.0
        stay = 1.0 / rate if holds else 0.0
        for i in range(width):
            v = momentum[i] * inverse[i]
            change = abs(pull[i] - rate * v)
            speed = abs(v) + sound
            free = 0.5 * (speed + math.sqrt(speed * speed + 2.0 * change * distance))
            held = speed + change * stay if holds else np.inf
            # Comparisons that are false for NaN.
            freely = free <= held
            needed = free if freely else held
            known = needed < np.inf
            needed = needed if known else np.inf
            peak[i] = max(peak[i], 0.0 if inverse[i] == 0.0 else needed)


@parallel_kernel
def _relax(
    fields: Floats,
    extents: Extents,
    terms: CellTerms,
    forces: AngleForces | None,
    change: Kick,
    limits: tuple[Floats, float, bool] | None,
) -> Floats:
    """Set v to decay v + gain F, for (v, omega) each, wherever there is mass.

    Returns distance/dt of the steps that the new velocities allow, one a component of the momentum;
    see `_raise_speeds`.
    """
    components, rows = fields.shape[0] - 1, extents.shape[1]
    lines = extents.shape[0] * rows
    rates = np.array([terms.damping, terms.damping, terms.angular_damping])
    tasks = min(lines, _TASKS)
    speeds = np.zeros((tasks, components))
    for task in numba.prange(tasks):
        room, inverse = np.empty(components * fields.shape[3]), np.empty(fields.shape[3])
        peaks = np.zeros((components, fields.shape[3]))
        # Every so manyth line: mass is in some of the angles, and all threads shall have a share.
        for line in range(task, lines, tasks):
            a, j = line // rows, line % rows
            first = extents[a, j, 0]
            width = extents[a, j, 1] - first
            if width > 0:
                # Rows right after one another: loops over contiguous arrays vectorise.
                drift = room[: components * width].reshape(components, width)
                angle = FULL_TURN * a / (fields.shape[1] - 2 * GHOSTS)
                _accelerate(terms, forces, (a, j, first), angle, drift)
                at = a + GHOSTS, j + GHOSTS, first + GHOSTS
                _kick_row(fields, at, drift, change)
                if limits is not None:
                    _raise_speeds(fields, at, drift, rates, limits, inverse, peaks)
        for d in range(components):
            speeds[task, d] = peaks[d].max()
    fastest = np.zeros(components)
    for task in range(tasks):
        for d in range(components):
            fastest[d] = max(fastest[d], speeds[task, d])
    return fastest


@view_kernel
def _kick_row(
    fields: Floats,
    at: tuple[int, int, int],
    out: Floats,
    change: Kick,
) -> None:
    """`_relax` for a run of cells in the drift `out`."""
    a, j, begin = at
    end = begin + out.shape[1]
    q = fields[Q, a, j, begin:end]
    for d in range(out.shape[0]):
        keep = change.spin_decay if d == 2 else change.decay
        push = change.spin_gain if d == 2 else change.gain
        momentum, rate = fields[QVX + d, a, j, begin:end], out[d]
        for i in range(q.size):
            momentum[i] = keep * momentum[i] + push * q[i] * rate[i]


def _relaxed(
    fields: Floats,
    extents: Extents,
    terms: CellTerms,
    forces: AngleForces | None,
    change: Kick,
    limits: Limits | None,
) -> Steps:
    here = fields, extents, terms, forces, change
    if limits is None:
        _relax(*here, None)
        return math.inf, math.inf
    fastest = _relax(*here, (limits.distances, limits.sound, limits.damped))
    pairs = zip(limits.distances, fastest[: limits.distances.size], strict=True)
    allowed = [float(far / speed) if speed > 0.0 else math.inf for far, speed in pairs]
    return min(allowed[:2]), min(allowed[2:], default=math.inf)


def kick_exactly(
    fields: Floats,
    extents: Extents,
    terms: CellTerms,
    forces: AngleForces | None,
    dt: float,
    limits: Limits | None = None,
) -> Steps:
    """Solve v' = F - Gamma v and omega' = F_bar - Gamma_bar omega exactly over dt, in place.

    With `limits`, returns `largest_step` of the new velocities, found on the way.
    """
    return _relaxed(fields, extents, terms, forces, exact_kick(terms, dt), limits)


def step_implicitly(
    fields: Floats,
    extents: Extents,
    terms: CellTerms,
    forces: AngleForces | None,
    dt: float,
    limits: Limits | None = None,
) -> Steps:
    """One implicit Euler step, v1 = (v + dt F)/(1 + dt Gamma), in place; the paper's treatment.

    Returns what `kick_exactly` does.
    """
    decay = 1.0 / (1.0 + dt * terms.damping), 1.0 / (1.0 + dt * terms.angular_damping)
    change = Kick(decay[0], dt * decay[0], decay[1], dt * decay[1])
    return _relaxed(fields, extents, terms, forces, change, limits)


def largest_step(
    fields: Floats,
    extents: Extents,
    terms: CellTerms,
    forces: AngleForces | None,
    limits: Limits,
) -> Steps:
    """The steps in which no cell's mass moves farther than it may, its acceleration included.

    One for space, one for the angle; infinite where nothing moves, 0 where a velocity is not finite.
    """
    return _relaxed(fields, extents, terms, forces, Kick(1.0, 0.0, 1.0, 0.0), limits)
