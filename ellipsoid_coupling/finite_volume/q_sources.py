"""Sources of `eq:macro_q_max` and `eq:macro_q_mono` cell by cell; the closure does not enter them.

At a fixed place and angle the force and torque do not depend on the velocities, so

    v' = F - Gamma v,                       F     = gamma u - grad V1 + force/m
    omega' = F_bar - Gamma_bar omega,       F_bar = gamma_bar g - dV2/dtheta + torque/I_c

are linear: the exact solution and an implicit Euler step are both a multiplication and an addition.
Fields are (4 or 3, na + 4, ny + 4, nx + 4); only the part of a row that holds mass is visited.
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
    maximum,
)
from ellipsoid_coupling.compiled.jit import apart_kernel, inline_kernel, one_by_one, parallel_kernel
from ellipsoid_coupling.compiled.loops import block_size, prefetch_block, round_up_to_vectors
from ellipsoid_coupling.compiled.parallel_arguments import pack, unpack
from ellipsoid_coupling.compiled.rows import (
    Rows,
    load,
    map_fields,
    rows_at,
    store,
)
from ellipsoid_coupling.finite_volume.cell_acceleration import (
    CellTerms,
    Drive,
    NoForces,
    drive_at,
    driven,
)
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.q_grid import FULL_TURN, QOMEGA, QVX, Extents, Q
from ellipsoid_coupling.finite_volume.sources import Kick, exact_kick, kicked
from ellipsoid_coupling.interaction.q_grid import AngleForces
from ellipsoid_coupling.physics.angular import outer_torque
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.stepping.step_control import CFL, ROTATION

Floats = NDArray[np.float64]


@inline_kernel
def _held_angle(terms: CellTerms, a: int, angles: int) -> tuple[tuple[float, float], float]:
    """Cos 2 theta and sin 2 theta of angle a, and -dV2/dtheta."""
    angle = FULL_TURN * a / angles
    return cos_sin(2.0 * angle), outer_torque(terms.angular, angle)


@apart_kernel
def _accelerate_row(
    drive: Drive, held_angle: tuple[tuple[float, float], float], width: int, out: Rows
) -> None:
    double, outer = held_angle
    for i in range(round_up_to_vectors(width)):
        if i < width:
            store(out, i, driven(drive, i, double, outer, load(out[2:], i)))


@parallel_kernel
def _accelerations(
    terms: CellTerms, forces: Any, distinct: int, parts: tuple[int, ...], out: Floats
) -> None:
    na, ny, nx = out.shape[1:]
    packed = pack(terms)
    for task in numba.prange(na * ny):
        a, j, here = task // ny, task % ny, unpack(packed)
        drive = drive_at(here, forces, (j, ny, 0), a % distinct * ny + j)
        rows = rows_at(out, axpy(parts, na * ny, task), 0)
        _accelerate_row(drive, _held_angle(here, a, na), nx, rows)


def accelerations(terms: CellTerms, forces: AngleForces | None, out: Floats) -> None:
    """F_x, F_y and, where it turns, F_bar of all cells: out (3 or 2, na, ny, nx), overwritten."""
    parts = tuple(range(out.shape[0]))
    _accelerations(terms, forces or NoForces(), _distinct_angles(forces), parts, out)


def _distinct_angles(forces: AngleForces | None) -> int:
    """So many angles have forces of their own, which the others share."""
    return 1 if forces is None else forces.x.shape[0]


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
    ahead : (2 or 3,) float64 or None
        Over which accelerations count, at least `distances`, which it is if None; see
        `step_control.looking_ahead`.
    """

    distances: Floats
    sound: float
    damped: bool = False
    ahead: Floats | None = None


# The step that flights in space and that turning allow.
Steps = tuple[float, float]


def shorter(steps: Steps) -> tuple[float, int]:
    """The shorter of both, and what it is limited by."""
    return min((steps[0], CFL), (steps[1], ROTATION))


@inline_kernel
def _needed(
    inverse: float,
    sound: float,
    damped: bool,
    carried: float,
    pull: float,
    rate: float,
    ahead: float,
) -> float:
    """Distance/dt for the largest dt of a cell; infinite if not finite, 0 in vacuum.

    dt (|v| + sound + |F - Gamma v| dt/2) = distance, so that with s = |v| + sound, a = |F - Gamma v|

        distance/dt = (s + sqrt(s^2 + 2 a distance))/2

    with `ahead` under the root instead of the distance, which it may exceed; or s + a/Gamma, where
    damping holds velocities and that is less.
    """
    v = carried * inverse
    change, speed = abs(pull - rate * v), abs(v) + sound
    free = 0.5 * (speed + math.sqrt(speed * speed + 2.0 * change * ahead))
    holds = damped and rate > 0.0
    # The same for all cells, so that no cell waits for a division.
    stay = 1.0 / rate if holds else 0.0
    held = speed + change * stay if holds else np.inf
    # Comparisons that are false for NaN.
    freely = free <= held
    needed = free if freely else held
    known = needed < np.inf
    needed = needed if known else np.inf
    return 0.0 if inverse == 0.0 else needed


class _Rates(NamedTuple):
    """What the components of the momentum have of their own, (3 or 2,) each; see `Kick`."""

    decays: Values
    gains: Values
    damping: Values
    ahead: Values


@apart_kernel
def _relax_row(
    cells: Rows,
    drive: Drive,
    held_angle: tuple[tuple[float, float], float],
    rates: _Rates,
    limits: tuple[float, bool] | None,
    width: int,
    peaks: Rows,
) -> None:
    """Kick a run of cells; with `limits`, sound and damped, raise `peaks` to `_needed`."""
    double, outer = held_angle
    momenta = cells[QVX:]
    for i in range(round_up_to_vectors(width)):
        if i < width:
            cell = load(cells, i)
            drift = driven(drive, i, double, outer, cell[QOMEGA:])
            new = kicked(cell[Q], cell[QVX:], drift, rates.decays, rates.gains)
            store(momenta, i, new)
            if limits is not None:
                # Vacuum is what is not more than 0, so that NaN is none and shows.
                inverse = 0.0 if cell[Q] <= 0.0 else 1.0 / cell[Q]
                shared = inverse, limits[0], limits[1]
                found = map_fields(_needed, shared, (new, drift, rates.damping, rates.ahead))
                store(peaks, i, maximum(load(peaks, i), found))


@parallel_kernel
def _relax(
    fields: Floats,
    extents: Extents,
    terms: CellTerms,
    forces: Any,
    distinct: int,
    parts: tuple[int, ...],
    decays: Values,
    gains: Values,
    damping: Values,
    ahead: Values,
    limits: tuple[float, bool],
    limited: bool,
    fastest: Floats,
) -> None:
    """Set v to decay v + gain F, for (v, omega) map_fields, wherever there is mass.

    distinct : so many angles have forces of their own, which the others share.
    fastest : (tasks, 3 or 2), overwritten by distance/dt of the steps that the new velocities
        allow, see `_needed`; by 0 unless `limited`.
    """
    angles, rows = extents.shape[:2]
    lines, tasks = angles * rows, fastest.shape[0]
    packed = pack(terms)
    for task in numba.prange(tasks):
        here = unpack(packed)
        rates = _Rates(decays, gains, damping, ahead)
        found = np.zeros((len(decays), fields.shape[3]))
        peaks = rows_at(found, parts[:-1], 0)
        for line in range(task * lines // tasks, (task + 1) * lines // tasks):
            a, j = line // rows, line % rows
            first = extents[a, j, 0]
            width = extents[a, j, 1] - first
            if width > 0:
                row = (a + GHOSTS) * fields.shape[2] + j + GHOSTS
                held: tuple[int, ...] = axpy(parts, fields.shape[1] * fields.shape[2], row)
                following = add(held, 1)
                held_angle = _held_angle(here, a, angles)
                piece = block_size(len(parts))
                for start in range(first, first + width, piece):
                    prefetch_block(rows_at(fields, following, start + GHOSTS), piece)
                    drive = drive_at(here, forces, (j, rows, start), a % distinct * rows + j)
                    cells = rows_at(fields, held, start + GHOSTS)
                    left = min(piece, first + width - start)
                    # One loop for both: to compile it twice would take longer than most runs.
                    if limited:
                        _relax_row(cells, drive, held_angle, rates, limits, left, peaks)
                    else:
                        _relax_row(cells, drive, held_angle, rates, None, left, peaks)
        for d in range(found.shape[0]):
            fastest[task, d] = found[d].max()


def _relaxed(
    fields: Floats,
    extents: Extents,
    terms: CellTerms,
    forces: AngleForces | None,
    change: Kick,
    limits: Limits | None,
) -> Steps:
    momenta = fields.shape[0] - 1
    ahead = np.zeros(momenta)
    if limits is not None:
        ahead[: limits.distances.size] = limits.distances if limits.ahead is None else limits.ahead
    fastest = np.zeros((min(extents.shape[0] * extents.shape[1], _TASKS), momenta))
    with one_by_one():
        _relax(
            fields,
            extents,
            terms,
            forces or NoForces(),
            _distinct_angles(forces),
            tuple(range(fields.shape[0])),
            (change.decay, change.decay, change.spin_decay)[:momenta],
            (change.gain, change.gain, change.spin_gain)[:momenta],
            (terms.damping, terms.damping, terms.angular_damping)[:momenta],
            tuple(ahead.tolist()),
            (0.0, False) if limits is None else (limits.sound, limits.damped),
            limits is not None,
            fastest,
        )
    if limits is None:
        return math.inf, math.inf
    pairs = zip(limits.distances, fastest.max(axis=0), strict=False)
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
