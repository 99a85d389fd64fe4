"""Source and both stages of the well-balanced scheme, row by row; the scheme is `well_balanced.py`.

With the work g that the force does from cell centre to cell centre and a profile's logarithmic slope s,

    dt S = dt/h q_i (e^{g_up/2} - e^{-g_down/2}) c(s)/c(g)

The damping of the momentum m is integrated exactly (ETD2RK), z = Gamma dt:

    m1 = e^-z m + phi_1 dt R0         m2 = m1 + phi_2 dt (R1 - R0)

where R holds source and transport; everything else is the mean of old and twice stepped (Heun).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values, add, scale, select
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.compiled.loops import over_row
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.finite_volume.fluxes.contract import ALONG, DENSITY
from ellipsoid_coupling.finite_volume.fluxes.kinetic import Limits, face_ratios
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.kick import exact_gain
from ellipsoid_coupling.finite_volume.q_grid import Extents

Floats = NDArray[np.float64]


def exponential_weights(rate: float, dt: float) -> tuple[float, float, float]:
    """exp(-z), phi_1 and phi_2 at z = rate dt; 1, 1 and 1/2 at 0."""
    z = rate * dt
    # phi_1 = (1 - e^-z)/z.
    first = exact_gain(rate, dt) / dt
    # The quotient loses digits for small z, where two terms of the series are exact to 1e-9.
    second = (1.0 - first) / z if z > 1e-4 else 0.5 - z / 6.0
    return math.exp(-z), first, second


@inline_kernel
def _source(density: Values, up: Values, down: Values, limits: Limits) -> float:
    """H S of a cell.

    density : of its lower neighbour, its own, its upper neighbour's; up, down : tilt and rest of the
    work to the upper one and from the lower one.
    """
    # Ratios of the equilibrium's densities: upper face to centre, lower face to centre.
    rise, fall = up[0], 1.0 / down[0]
    top, bottom = face_ratios(density[0], density[1], density[2], rise, fall, limits)
    # Simpson's rule for the mean density of the profile over that of the equilibrium: c(s)/c(g).
    mean = (2.0 + 0.5 * (top + bottom)) / (2.0 + 0.5 * (rise + fall))
    # Both faces' pressures, and the rest of the work, which acts as a plain force.
    push = mean * (rise - fall) + 0.5 * (up[1] + down[1])
    return push * density[1]


class Forced(NamedTuple):
    """What the source of a run of cells follows from, rows; see `_source`."""

    density: Rows
    up: Rows
    down: Rows
    limits: Limits


@inline_kernel
def _forced(q: Floats, work: Floats, start: int, stride: int, limits: Limits) -> Forced:
    """Of the cells from `start` on of a flat density (1, cells), and the work (2, cells)."""
    own = rows_at(q, (0,), start)
    # `+` sets rows side by side.
    around = rows_at(q, (0,), start - stride) + own + rows_at(q, (0,), start + stride)
    return Forced(
        around, rows_at(work, (0, 1), start), rows_at(work, (0, 1), start - stride), limits
    )


@inline_kernel
def _source_at(forced: Forced, i: int) -> float:
    return _source(load(forced.density, i), load(forced.up, i), load(forced.down, i), forced.limits)


class Stage(NamedTuple):
    """What both stages of a step share: dt/h, and exp(-z), phi_1, phi_2 of `exponential_weights`."""

    ratio: float
    decay: float
    first: float
    second: float


@inline_kernel
def _push_cell(i: int, forced: Forced, before: Rows, moved: Rows, stage: Stage) -> None:
    m, now = load(before, i)[0], load(moved, i)[0]
    # dt R0: what transport has changed, and the source.
    push = now - m + stage.ratio * _source_at(forced, i)
    store(moved, i, (stage.decay * m + stage.first * push,))


@kernel(noalias=True)
def push_row(forced: Forced, before: Rows, moved: Rows, width: int, stage: Stage) -> None:
    """The first stage of a run, see `push`: its old momenta, and those that transport made of them."""
    over_row(width, _push_cell, (forced, before, moved, stage))


@inline_kernel
def _run(extents: Extents, task: int, padded: tuple[int, int]) -> tuple[int, int]:
    """Where the run of a row, counted through all angles, begins in flat fields, and its width."""
    rows = extents.shape[1]
    a, j = task // rows, task % rows
    # Extents count interior cells; flat fields have ghosts along every axis.
    row = ((a + GHOSTS) * padded[0] + j + GHOSTS) * padded[1] + GHOSTS
    return row + extents[a, j, 0], max(extents[a, j, 1] - extents[a, j, 0], 0)


@parallel_kernel
def push(
    fields: Floats,
    before: Floats,
    extents: Extents,
    work: Floats,
    limits: Limits,
    line: tuple[int, int],
    stage: Stage,
) -> None:
    """The first stage's momentum, m1 = e^-z m + phi_1 dt R, from what transport made of m.

    line : the component of the momentum, and the distance of neighbours in flat fields.
    """
    normal, stride = line
    padded = fields.shape[2], fields.shape[3]
    old, new = before.reshape(fields.shape[0], -1), fields.reshape(fields.shape[0], -1)
    for task in numba.prange(extents.shape[0] * extents.shape[1]):
        start, width = _run(extents, task, padded)
        forced = _forced(old, work, start, stride, limits)
        m, moved = rows_at(old, (normal,), start), rows_at(new, (normal,), start)
        push_row(forced, m, moved, width, stage)


@inline_kernel
def _combine_cell(
    i: int, forced: Forced, first_stage: Rows, old: Rows, new: Rows, stage: Stage
) -> None:
    before, after, m1 = load(old, i), load(new, i), load(first_stage, i)[0]
    # dt (R1 - R0): R1 from the second transport, R0 from what the first stage made of it.
    change = after[ALONG] - m1 + stage.ratio * _source_at(forced, i)
    change -= (m1 - stage.decay * before[ALONG]) / stage.first
    means = scale(0.5, add(before, after))
    # A mean of mass and vacuum never gets to 0 by itself, and its velocity is made of rounding.
    empty = means[DENSITY] <= forced.limits.vacuum
    # The momentum by ETD2RK, all else by Heun's mean.
    new_cell = (means[DENSITY], m1 + stage.second * change, *means[2:])
    store(new, i, select(empty, 0.0, new_cell))


@kernel(noalias=True)
def combine_row(
    forced: Forced, first_stage: Rows, old: Rows, new: Rows, width: int, stage: Stage
) -> None:
    """The second stage of a run, see `combine`: the momentum after the first one, old and new cells."""
    over_row(width, _combine_cell, (forced, first_stage, old, new, stage))


@parallel_kernel
def combine(
    states: tuple[Floats, Floats, Floats],
    extents: Extents,
    work: Floats,
    limits: Limits,
    components: tuple[int, ...],
    stride: int,
    stage: Stage,
) -> None:
    """The second stage: the mean of old and twice stepped, and m = m1 + phi_2 dt (R1 - R0).

    states : the fields, which are overwritten; those before the step; density and momentum after the
    first stage.
    components : density, momentum along the direction, and the others.
    """
    fields, before, middle = states
    padded = fields.shape[2], fields.shape[3]
    old, new = before.reshape(fields.shape[0], -1), fields.reshape(fields.shape[0], -1)
    # Density and momentum: all that the second stage needs of the first.
    half = middle.reshape(2, -1)
    for task in numba.prange(extents.shape[0] * extents.shape[1]):
        start, width = _run(extents, task, padded)
        forced = _forced(half, work, start, stride, limits)
        m1 = rows_at(half, (1,), start)
        olds, news = rows_at(old, components, start), rows_at(new, components, start)
        combine_row(forced, m1, olds, news, width, stage)
