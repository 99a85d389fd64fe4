"""Sources of the cell equations: what changes while mass stands still.

All particles of a cell share v, omega and the angle, so its sources are those of one particle,

    v' = F - Gamma v,                         F     = gamma u - grad V1 + force/m
    omega' = F_bar - Gamma_bar omega,         F_bar = gamma_bar g - dV2/dtheta + torque/I_c
    phi' = omega                              where the angle is carried

whatever the closure. F and F_bar depend on place and angle, not on velocities: the exact solution and an
implicit Euler step are both a kick, v becomes decay v + gain F, and so is the drift velocity F/Gamma.
Only a carried angle makes the implicit step of the torque an equation, which Newton solves.

One pass over memory does several things to a cell, block by block so that each finds it in cache:

    evaluate F and F_bar    kick v and omega    turn phi    raise the peaks that bound the next step
"""

from __future__ import annotations

import math
from typing import NamedTuple

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
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import block_size, chunk, over_row, prefetch_block
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.compiled.threads import single_task_chunks
from ellipsoid_coupling.finite_volume.cell_acceleration import (
    CellTerms,
    Drive,
    NoForces,
    angular_rate,
    drive_at,
    driven,
)
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.q_grid import FULL_TURN, Extents
from ellipsoid_coupling.finite_volume.step_limits import CellwiseLimit, ExtremesLimit, reached
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.interaction.q_grid import AngleForces
from ellipsoid_coupling.physics.angular import outer_torque
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.scenes.kinds import Record

Floats = NDArray[np.float64]
AnyForces = Forces | AngleForces | NoForces
Limit = CellwiseLimit | ExtremesLimit

# Newton's iteration for the angle converges quadratically from a guess that is dt^2 off.
_NEWTON_STEPS = 4
# So many tasks at most share the rows, each with peaks of its own.
_TASKS = 64


class Cells(NamedTuple):
    """The cells of an equation, as passes over them see these.

    Attributes
    ----------
    fields : (K, planes, ny + 4, nx + 4) float64
        Density and density times every other component; planes with the angle's ghosts, if it has any.
    extents : (na, ny, 2) int64
        First and end column of what every row holds.
    drift : (D, na or 0, ny, nx) float64
        F_x, F_y and, where something turns, F_bar of the present place and angle, in vacuum 0; no planes
        where it is not kept, but evaluated in each pass.
    rates : (D,) int
        0, 1, ..: the components of the drift.
    moving : (1 + D,) int
        The components that are density and momenta.
    angle, spin : (1,) or () int
        The components that are density times a carried angle, and times its rate.
    """

    fields: Floats
    extents: Extents
    drift: Floats
    rates: tuple[int, ...]
    moving: tuple[int, ...]
    angle: tuple[int, ...]
    spin: tuple[int, ...]


class Acceleration(NamedTuple):
    """What F and F_bar are evaluated from.

    Attributes
    ----------
    terms : CellTerms
    forces : Forces, AngleForces or NoForces
        Of interaction and walls, not yet divided by mass and inertia.
    planes : int
        So many planes have forces of their own, which the others share.
    vacuum : float
        Up to this density there is no drift; minus infinity for that of all cells.
    """

    terms: CellTerms
    forces: AnyForces
    planes: int
    vacuum: float


def acceleration(
    terms: CellTerms, forces: Forces | AngleForces | None, vacuum: float = 0.0
) -> Acceleration:
    """Of these terms and forces, None without interaction and walls."""
    planes = 1 if forces is None or forces.x.ndim < 3 else forces.x.shape[0]
    return Acceleration(terms, forces or NoForces(), planes, vacuum)


class Kick(NamedTuple):
    """V becomes decay v + gain F, each component with its own numbers, (2 or 3,)."""

    decay: Values
    gain: Values


def exact_kick(terms: CellTerms, dt: float, velocities: int) -> Kick:
    """The exact solution of v' = F - Gamma v over dt."""
    rates = dampings(terms, velocities)
    return Kick(
        tuple(math.exp(-rate * dt) for rate in rates), tuple(exact_gain(rate, dt) for rate in rates)
    )


def implicit_kick(terms: CellTerms, dt: float, velocities: int) -> Kick:
    """An implicit Euler step of it, v1 = (v + dt F)/(1 + dt Gamma); the paper's treatment."""
    decay = tuple(1.0 / (1.0 + dt * rate) for rate in dampings(terms, velocities))
    return Kick(decay, tuple(dt * one for one in decay))


def drift_velocity(terms: CellTerms, velocities: int) -> Kick:
    """V = F/Gamma, whatever it was; 0 of what nothing damps, which then has no such limit."""
    rates = dampings(terms, velocities)
    return Kick(fill(0.0, rates), tuple(1.0 / rate if rate > 0.0 else 0.0 for rate in rates))


def dampings(terms: CellTerms, velocities: int) -> Values:
    """Gamma, Gamma and, of three velocities, Gamma_bar."""
    return (terms.damping, terms.damping, terms.angular_damping)[:velocities]


def exact_gain(rate: float, dt: float) -> float:
    """The integral of exp(-rate s) over a step."""
    return -math.expm1(-rate * dt) / rate if rate else dt


class Work(NamedTuple):
    """What a pass does to each cell, in this order, beside evaluating the drift where it is given.

    Attributes
    ----------
    change : Kick
    kicks : bool
        Whether v and omega are kicked.
    time : float
        Phi becomes phi + time omega; where it is 0, nothing turns.
    limits : bool
        Whether peaks are raised.
    """

    change: Kick
    kicks: bool
    time: float
    limits: bool


@inline_kernel
def _evaluate(
    i: int,
    cells: Rows,
    angles: Rows,
    plane_angle: float,
    drive: Drive,
    angular: Record | None,
    vacuum: float,
    drift: Rows,
) -> None:
    """F_x, F_y and, where something turns, F_bar of cell i."""
    cell = load(cells, i)
    # Vacuum has no angle; what comes out for it is not used.
    angle = plane_angle + total(div(load(angles, i), cell[0]))
    double, outer = cos_sin(2.0 * angle), outer_torque(angular, angle)
    rates = driven(drive, i, double, outer, cell[3:])
    store(drift, i, select(cell[0] <= vacuum, fill(0.0, rates), rates))


@inline_kernel
def _kick(i: int, cells: Rows, drift: Rows, change: Kick) -> None:
    """Rho v becomes decay rho v + rho gain F."""
    cell = load(cells, i)
    gains = mul(scale(cell[0], change.gain), load(drift, i))
    store(cells[1:], i, add(mul(change.decay, cell[1:]), gains))


@inline_kernel
def _turn(i: int, angles: Rows, spins: Rows, time: float) -> None:
    """Rho phi becomes rho phi + time rho omega."""
    store(angles, i, axpy(time, load(spins, i), load(angles, i)))


@inline_kernel
def _raise_peaks(i: int, cells: Rows, drift: Rows, limit: Limit, peaks: Rows) -> None:
    cell = load(cells, i)
    # Written so that NaN is no vacuum and shows.
    inverse = 0.0 if cell[0] <= 0.0 else 1.0 / cell[0]
    found = reached(limit, inverse, cell[1:], load(drift, i))
    store(peaks, i, maximum(load(peaks, i), found))


@kernel(noalias=True)
def _evaluate_row(
    width: int,
    cells: Rows,
    angles: Rows,
    plane_angle: float,
    drive: Drive,
    angular: Record | None,
    vacuum: float,
    drift: Rows,
) -> None:
    over_row(width, _evaluate, (cells, angles, plane_angle, drive, angular, vacuum, drift))


@kernel(noalias=True)
def _kick_row(width: int, cells: Rows, drift: Rows, change: Kick) -> None:
    over_row(width, _kick, (cells, drift, change))


@kernel(noalias=True)
def _turn_row(width: int, angles: Rows, spins: Rows, time: float) -> None:
    over_row(width, _turn, (angles, spins, time))


@kernel(noalias=True)
def _raise_peaks_row(width: int, cells: Rows, drift: Rows, limit: Limit, peaks: Rows) -> None:
    over_row(width, _raise_peaks, (cells, drift, limit, peaks))


@kernel(noalias=True)
def _treat_block(
    place: tuple[int, int, int],
    width: int,
    cells: Cells,
    force: Acceleration | None,
    work: Work,
    limit: Limit,
    scratch: Floats,
    peaks: Rows,
) -> None:
    """All of a pass for `width` cells of plane a, row j, from column `start` on: place = (a, j, start).

    Each stage is a kernel of its own, so that its arguments are known to be apart and its loop
    vectorises. A block stays in cache from one to the next.
    """
    a, j, start = place
    fields, (planes, rows) = cells.fields, cells.extents.shape[:2]
    ghost_planes = (fields.shape[1] - planes) // 2
    row, every = (
        (a + ghost_planes) * fields.shape[2] + j + GHOSTS,
        fields.shape[1] * fields.shape[2],
    )
    here = axpy(cells.moving, every, row)
    # The next row's block comes while this one is worked on.
    prefetch_block(rows_at(fields, add(here, 1), start + GHOSTS), width)
    moving = rows_at(fields, here, start + GHOSTS)
    angles = rows_at(fields, axpy(cells.angle, every, row), start + GHOSTS)
    # A drift that is not kept lives in cache only.
    drift = rows_at(scratch, cells.rates, 0)
    if cells.drift.shape[1] > 0:
        drift = rows_at(cells.drift, axpy(cells.rates, planes * rows, a * rows + j), start)
    if force is not None:
        drive = drive_at(force.terms, force.forces, (j, rows, start), a % force.planes * rows + j)
        angular, plane_angle = force.terms.angular, FULL_TURN * a / planes
        _evaluate_row(width, moving, angles, plane_angle, drive, angular, force.vacuum, drift)
    if work.kicks:
        _kick_row(width, moving, drift, work.change)
    if work.time != 0.0:
        spins = rows_at(fields, axpy(cells.spin, every, row), start + GHOSTS)
        _turn_row(width, angles, spins, work.time)
    if work.limits:
        _raise_peaks_row(width, moving, drift, limit, peaks)


@kernel
def _treat_lines(
    task: int,
    cells: Cells,
    force: Acceleration | None,
    work: Work,
    limit: Limit,
    largest: Floats,
) -> None:
    """All of a pass for one task's share of the rows."""
    planes, rows = cells.extents.shape[:2]
    block = block_size(cells.fields.shape[0])
    found = np.zeros((len(limit.peaks), block))
    scratch = np.empty((len(cells.rates), block))
    peaks = rows_at(found, limit.peaks, 0)
    first, end = chunk(task, largest.shape[0], planes * rows)
    for line in range(first, end):
        a, j = line // rows, line % rows
        stop = cells.extents[a, j, 1]
        for start in range(cells.extents[a, j, 0], stop, block):
            width = min(block, stop - start)
            _treat_block((a, j, start), width, cells, force, work, limit, scratch, peaks)
    for k in range(found.shape[0]):
        largest[task, k] = found[k].max()


@parallel_kernel
def _treat(tasks: int, arguments: tuple[Cells, Acceleration | None, Work, Limit, Floats]) -> None:
    packed = pack(arguments)
    for task in numba.prange(tasks):
        cells, force, work, limit, largest = unpack(packed)
        _treat_lines(signed(task), cells, force, work, limit, largest)


def treat(cells: Cells, force: Acceleration | None, work: Work, limit: Limit) -> Floats:
    """One pass over all cells, in place; see the module.

    Parameters
    ----------
    cells : Cells
    force : Acceleration or None
        Evaluate the drift; None takes that which is kept.
    work : Work
    limit : CellwiseLimit or ExtremesLimit
        What peaks are raised to.

    Returns
    -------
    (peaks,) float64
        What the new velocities reach at most, for `limit.allowed`; 0 unless `work.limits`.
    """
    lines = cells.extents.shape[0] * cells.extents.shape[1]
    largest = np.zeros((min(lines, _TASKS), len(limit.peaks)))
    with single_task_chunks():
        _treat(largest.shape[0], (cells, force, work, limit, largest))
    return np.asarray(largest.max(axis=0))


@parallel_kernel
def turn_implicitly(cells: Cells, terms: CellTerms, gain: float, dt: float) -> None:
    """Turn phi by one implicit Euler step, in place; the paper's treatment, after an implicit kick.

        phi1 = phi + dt omega1,  omega1 = omega + gain (R(phi1) - R(phi))

    omega is what the kick, whose gain this is, made of the drift at the old angle. R are the torques that
    are known as functions of the angle, those of fluid and V2; the interaction's is that of the old one.
    """
    fields, angle, spin = cells.fields, cells.angle[0], cells.spin[0]
    rows, columns = cells.drift.shape[2:]
    packed = pack(terms)
    for j in numba.prange(rows):
        known = unpack(packed)
        for i in range(columns):
            p, q = j + GHOSTS, i + GHOSTS
            rho = fields[0, 0, p, q]
            if rho > 0.0:
                phi, omega = fields[angle, 0, p, q] / rho, fields[spin, 0, p, q] / rho
                new = _implicit_spin(phi, omega, known, (j, i), (gain, dt))
                fields[spin, 0, p, q] = rho * new
                fields[angle, 0, p, q] += dt * rho * new


@kernel
def _implicit_spin(
    angle: float,
    spin: float,
    terms: CellTerms,
    cell: tuple[int, int],
    step: tuple[float, float],
) -> float:
    """Omega1 of one cell, for the step (gain, dt)."""
    j, i = cell
    gain, dt = step
    old, _ = angular_rate(terms.turning, terms.angular, j, i, angle)
    new = spin
    for _ in range(_NEWTON_STEPS):
        rate, slope = angular_rate(terms.turning, terms.angular, j, i, angle + dt * new)
        new -= (new - spin - gain * (rate - old)) / (1.0 - gain * dt * slope)
    return new
