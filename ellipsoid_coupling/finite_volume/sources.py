"""Sources of the cell equations: what changes while mass stands still.

All particles of a cell share v, omega and the angle, so its sources are those of one particle,

    v' = F - Gamma v,                         F     = gamma u - grad V1 + force/m
    omega' = F_bar - Gamma_bar omega,         F_bar = gamma_bar g - dV2/dtheta + torque/I_c
    phi' = omega                              where the angle is carried

whatever the closure. F and F_bar depend on place and angle, not on velocities: the exact solution and an
implicit Euler step are both a kick, v becomes decay v + gain F, and so is the drift velocity F/Gamma.
Only a carried angle makes the implicit step of the torque an equation: see `implicit_turn.py`.

One pass over memory does several things to a cell, block by block so that each finds it in cache:

    evaluate F and F_bar    kick v and omega    turn phi    raise the peaks that bound the next step
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import (
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
from ellipsoid_coupling.compiled.loops import (
    block_size,
    chunk,
    over_row,
    prefetch_block,
    round_up_to_vectors,
)
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.compiled.threads import single_task_chunks
from ellipsoid_coupling.finite_volume.cell_acceleration import (
    AnyForces,
    CellTerms,
    Drive,
    NoForces,
    drive_at,
    driven,
)
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.kick import Kick
from ellipsoid_coupling.finite_volume.q_grid import FULL_TURN, Extents
from ellipsoid_coupling.finite_volume.step_limits import CellwiseLimit, ExtremesLimit, reached
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.interaction.q_grid import AngleForces
from ellipsoid_coupling.physics.angular import outer_torque
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.scenes.kinds import Record

Floats = NDArray[np.float64]
Limit = CellwiseLimit | ExtremesLimit

# Cells of a block where the drift is kept: a row of most grids. Shorter ones cost calls, 60 ns each;
# 128 and 256 take 15 to 25 % longer on 1600 x 1600 cells.
_LONG_BLOCK = 1024
# So many tasks at most share the rows, each with peaks of its own, and rows that each has at least.
_TASKS, _LEAST_ROWS = 64, 8


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
    further : tuple of int
        The components that are none of these; the pressure may depend on them.
    """

    fields: Floats
    extents: Extents
    drift: Floats
    rates: tuple[int, ...]
    moving: tuple[int, ...]
    angle: tuple[int, ...]
    spin: tuple[int, ...]
    further: tuple[int, ...] = ()


class Acceleration(NamedTuple):
    """What F and F_bar are evaluated from.

    forces : of interaction and walls, not yet divided by mass and inertia; `planes` planes have their
    own, which the others share. vacuum : up to this density there is no drift.
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


class Work(NamedTuple):
    """What a pass does to each cell, in this order, beside evaluating the drift where it is given.

    change, kicks : kick v and omega, or not. time : phi becomes phi + time omega; where it is 0, nothing
    turns. limits : raise the peaks that bound the next step.
    """

    change: Kick
    kicks: bool
    time: float
    limits: bool


class Evaluation(NamedTuple):
    """What F and F_bar of a run of cells are evaluated from.

    angles : the carried one, or none; it is added to `plane_angle`. vacuum : up to this density there is
    no drift.
    """

    angles: Rows
    plane_angle: float
    drive: Drive
    angular: Record | None
    vacuum: float


@inline_kernel
def _evaluate(i: int, given: Evaluation, cells: Rows, drift: Rows) -> None:
    """F_x, F_y and, where something turns, F_bar of cell i."""
    cell = load(cells, i)
    # Vacuum has no angle; what comes out for it is not used.
    # Of the plane, or carried: the other one is 0, or no number.
    angle = given.plane_angle + total(div(load(given.angles, i), cell[0]))
    double, outer = cos_sin(2.0 * angle), outer_torque(given.angular, angle)
    rates = driven(given.drive, i, double, outer, cell[3:])
    # Chosen, not branched over, so that the loop vectorises.
    store(drift, i, select(cell[0] <= given.vacuum, fill(0.0, rates), rates))


@inline_kernel
def _kick(i: int, cells: Rows, drift: Rows, change: Kick) -> None:
    """Rho v becomes decay rho v + rho gain F."""
    cell = load(cells, i)
    # v1 = decay v + gain F, times rho.
    gains = mul(scale(cell[0], change.gain), load(drift, i))
    store(cells[1:], i, add(mul(change.decay, cell[1:]), gains))


@inline_kernel
def _turn(i: int, angles: Rows, spins: Rows, time: float) -> None:
    """Rho phi becomes rho phi + time rho omega."""
    store(angles, i, axpy(time, load(spins, i), load(angles, i)))


@inline_kernel
def _raise_peaks(
    i: int, cells: Rows, further: Rows, drift: Rows, limit: Limit, peaks: Rows
) -> None:
    cell = load(cells, i)
    # Written so that NaN is no vacuum and shows.
    inverse = 0.0 if cell[0] <= 0.0 else 1.0 / cell[0]
    state = (cell[0], *load(further, i))
    found = reached(limit, inverse, cell[1:], load(drift, i), state)
    store(peaks, i, maximum(load(peaks, i), found))


@inline_kernel
def _evaluate_and_kick(i: int, given: Evaluation, cells: Rows, drift: Rows, change: Kick) -> None:
    """`_evaluate` and `_kick` of cell i, whose numbers stay in registers in between."""
    _evaluate(i, given, cells, drift)
    _kick(i, cells, drift, change)


@inline_kernel
def _evaluate_kick_and_raise(
    i: int,
    given: Evaluation,
    cells: Rows,
    drift: Rows,
    change: Kick,
    further: Rows,
    limit: Limit,
    peaks: Rows,
) -> None:
    """`_evaluate_and_kick`, and `_raise_peaks` by what it leaves."""
    _evaluate_and_kick(i, given, cells, drift, change)
    _raise_peaks(i, cells, further, drift, limit, peaks)


@kernel(noalias=True)
def _evaluate_and_kick_row(
    width: int, given: Evaluation, cells: Rows, drift: Rows, change: Kick
) -> None:
    over_row(width, _evaluate_and_kick, (given, cells, drift, change))


@kernel(noalias=True)
def _evaluate_kick_and_raise_row(
    width: int,
    given: Evaluation,
    cells: Rows,
    drift: Rows,
    change: Kick,
    further: Rows,
    limit: Limit,
    peaks: Rows,
) -> None:
    over_row(width, _evaluate_kick_and_raise, (given, cells, drift, change, further, limit, peaks))


@kernel(noalias=True)
def _kick_row(width: int, cells: Rows, drift: Rows, change: Kick) -> None:
    over_row(width, _kick, (cells, drift, change))


@kernel(noalias=True)
def _turn_row(width: int, angles: Rows, spins: Rows, time: float) -> None:
    over_row(width, _turn, (angles, spins, time))


@kernel(noalias=True)
def _raise_peaks_row(
    width: int, cells: Rows, further: Rows, drift: Rows, limit: Limit, peaks: Rows
) -> None:
    over_row(width, _raise_peaks, (cells, further, drift, limit, peaks))


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
    # None on an r-grid, whose angle has no ghosts.
    ghost_planes = (fields.shape[1] - planes) // 2
    row, every = (
        (a + ghost_planes) * fields.shape[2] + j + GHOSTS,
        fields.shape[1] * fields.shape[2],
    )
    # Rows are counted through all components, which are `every` rows apart.
    here = axpy(cells.moving, every, row)
    # The next row's block comes while this one is worked on. Where the drift is kept, rows are long
    # and hardware reads ahead well enough; what is asked for beside it only stalls.
    kept = cells.drift.shape[1] > 0
    if not kept:
        prefetch_block(rows_at(fields, add(here, 1), start + GHOSTS), width)
    moving = rows_at(fields, here, start + GHOSTS)
    angles = rows_at(fields, axpy(cells.angle, every, row), start + GHOSTS)
    further = rows_at(fields, axpy(cells.further, every, row), start + GHOSTS)
    # A drift that is not kept lives in cache only.
    drift = rows_at(scratch, cells.rates, 0)
    if kept:
        drift = rows_at(cells.drift, axpy(cells.rates, planes * rows, a * rows + j), start)
    if force is not None:
        # The interaction is pi-periodic: theta and theta + pi have the same forces.
        drive = drive_at(force.terms, force.forces, (j, rows, start), a % force.planes * rows + j)
        angular, plane_angle = force.terms.angular, FULL_TURN * a / planes
        given = Evaluation(angles, plane_angle, drive, angular, force.vacuum)
        if work.limits:
            _evaluate_kick_and_raise_row(
                width, given, moving, drift, work.change, further, limit, peaks
            )
        else:
            _evaluate_and_kick_row(width, given, moving, drift, work.change)
    elif work.kicks:
        _kick_row(width, moving, drift, work.change)
    if work.time != 0.0:
        spins = rows_at(fields, axpy(cells.spin, every, row), start + GHOSTS)
        _turn_row(width, angles, spins, work.time)
    # With a force it has been done in the first loop.
    if work.limits and force is None:
        _raise_peaks_row(width, moving, further, drift, limit, peaks)


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
    block = _LONG_BLOCK if cells.drift.shape[1] > 0 else block_size(cells.fields.shape[0])
    # Memory of short rows, or of none, is soon cleared.
    block = min(block, round_up_to_vectors(cells.fields.shape[3]))
    # A peak a column: one number for all would wait for each comparison.
    found = np.zeros((len(limit.peaks), block if work.limits else 0))
    # A block of the drift where it is not kept, which so never leaves the cache.
    scratch = np.empty((len(cells.rates), block))
    peaks = rows_at(found, limit.peaks, 0)
    first, end = chunk(task, largest.shape[0], planes * rows)
    for line in range(first, end):
        a, j = line // rows, line % rows
        stop = cells.extents[a, j, 1]
        for start in range(cells.extents[a, j, 0], stop, block):
            width = min(block, stop - start)
            _treat_block((a, j, start), width, cells, force, work, limit, scratch, peaks)
    if work.limits:
        for k in range(found.shape[0]):
            # Each task has a row of its own; the largest of all does not depend on who was first.
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
    if not work.kicks:
        # One loop for passes that kick and that do not: v becomes v.
        ones = fill(1.0, work.change.decay)
        work = work._replace(change=Kick(ones, fill(0.0, ones)))
    lines = cells.extents.shape[0] * cells.extents.shape[1]
    largest = np.zeros((min(-(-lines // _LEAST_ROWS), _TASKS), len(limit.peaks)))
    with single_task_chunks():
        _treat(largest.shape[0], (cells, force, work, limit, largest))
    return np.asarray(largest.max(axis=0))
