"""Steps of particles off the edges of the fluid: which ones may meet an edge, and where they end then.

All particles take the plain formula, and one look-up tells nearly all that they meet no edge, in loops
that vectorise (`edge_grid.leaves_support`). Of the few that are left the edges about them are looked at
(`may_meet_edge`), and who may still come to one is followed along its path (`paths.follow`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.geometry.edge_grid import EdgeGrid, Way, leaves_support, may_meet_edge
from ellipsoid_coupling.geometry.fate_codes import FIRST_PATCH, INSIDE
from ellipsoid_coupling.particles.births import Births
from ellipsoid_coupling.particles.fates import Fates, takes_part
from ellipsoid_coupling.particles.flags import flagged
from ellipsoid_coupling.particles.linear import LinearStep, linear_step, noise_of
from ellipsoid_coupling.particles.path_parts import Path
from ellipsoid_coupling.particles.paths import End, edge_normal, follow
from ellipsoid_coupling.particles.state import BlockStep, Limits, ParticleState

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]
Indices = NDArray[np.int64]

# Of a path: no force, no noise. As a normal: no wall.
NOWHERE = (0.0, 0.0)


class Ends(NamedTuple):
    """Where the paths of some particles lead: indices (m,); and position, velocity, time, edge (m, 6)."""

    which: Indices
    values: Floats


@inline_kernel
def _way(step: BlockStep, later: Floats, linear: LinearStep, i: int) -> Way:
    """Bounds the way of a particle in a step in which the force becomes `later` (D, B)."""
    velocity, force, k = step.state.velocity, step.state.force, step.k
    # t phi1, t^2 phi2 and t^3 phi3 all rise with t, whatever the damping: that makes it a bound. The change
    # counts in full, as it does in `_path`.
    by_velocity, by_force, missed = (
        linear.position_velocity,
        linear.position_force,
        linear.position_missed,
    )
    change_x, change_y = later[0, i] - force[k, 0, i], later[1, i] - force[k, 1, i]
    return Way(
        (by_velocity * velocity[k, 0, i], by_velocity * velocity[k, 1, i]),
        (by_force * force[k, 0, i], by_force * force[k, 1, i]),
        (missed * change_x, missed * change_y),
        (
            noise_of(step.noise, 0, step.rates, linear, i)[0],
            noise_of(step.noise, 1, step.rates, linear, i)[0],
        ),
    )


@kernel(noalias=True)
def _flag(
    edges: EdgeGrid, step: BlockStep, later: Floats, linear: LinearStep, flags: Flags
) -> None:
    """Flag those that may come to an edge, as far as one look-up tells."""
    position, k = step.state.position, step.k
    for i in range(flags.size):
        way = _way(step, later, linear, i)
        flags[i] = leaves_support(edges, position[k, 0, i], position[k, 1, i], way)


@kernel
def _may_meet(edges: EdgeGrid, step: BlockStep, later: Floats, linear: LinearStep) -> Indices:
    """The particles (m,) that may come to an edge within a step, in which the force becomes `later`.

    Not those whose way is not a number: the steppers report these themselves.
    """
    state, k = step.state, step.k
    flags = np.empty(state.position.shape[2], np.uint8)
    _flag(edges, step, later, linear, flags)
    which, count = flagged(flags), 0
    for i in which:
        # `count` never passes the index that is read, so that the list is shortened in place.
        if takes_part(state.frozen, k, i):
            x, y = state.position[k, 0, i], state.position[k, 1, i]
            if may_meet_edge(edges, x, y, _way(step, later, linear, i)):
                which[count] = i
                count += 1
    return which[:count]


@kernel
def _path(step: BlockStep, later: Floats, linear: LinearStep, i: int) -> Path:
    """The path of a particle in a step in which the force becomes `later` (D, B)."""
    k, dt = step.k, step.dt
    position, velocity, force = step.state.position, step.state.velocity, step.state.force
    # R_n and W_n of either direction: the first moves the particle, the second is added at the end.
    right, across = noise_of(step.noise, 0, step.rates, linear, i)
    up, along = noise_of(step.noise, 1, step.rates, linear, i)
    return Path(
        (position[k, 0, i], position[k, 1, i]),
        (velocity[k, 0, i], velocity[k, 1, i]),
        (force[k, 0, i], force[k, 1, i]),
        ((later[0, i] - force[k, 0, i]) / dt, (later[1, i] - force[k, 1, i]) / dt),
        # The noise of the whole step is spread evenly over it: how it came about is not known.
        (right / dt, up / dt),
        (across, along),
        # x and y have one Gamma: a path has one damping.
        step.rates.damping[0],
    )


@kernel
def predict_at_edges(edges: EdgeGrid | None, step: BlockStep) -> None:
    """Predict anew what may come to an edge: a position in the fluid, or where it would end."""
    if edges is not None:
        linear = linear_step(step.rates.damping[0], step.rates.amplitude[0], step.dt)
        force, position = step.state.force[step.k], step.trial.position
        # A prediction takes a constant drift: the force at the end is that at the start.
        for i in _may_meet(edges, step, force, linear):
            path = _path(step, force, linear, i)
            position[0, i], position[1, i] = follow(edges, path, step.dt).position


@kernel
def _scheme_path(path: Path, linear: LinearStep, dt: float, normal: tuple[float, float]) -> Path:
    """The path to where the plain formula leads, which takes a part of the change only; see `exponential`.

    All of the change is taken along `normal`, that of a wall which is met, or NOWHERE.
    """
    # The c of `exponential`: less than 1 with noise, 0 where nothing damps.
    part = linear.position_change / linear.position_missed
    (sx, sy), (kx, ky) = path.slope, path.kick
    across = normal[0] * sx + normal[1] * sy
    left_x = (1.0 - part) * (sx - across * normal[0])
    left_y = (1.0 - part) * (sy - across * normal[1])
    # Only the position takes a part of the change; the velocity gets what the slope has lost of it.
    slope = sx - left_x, sy - left_y
    kick = kx + linear.velocity_change * dt * left_x, ky + linear.velocity_change * dt * left_y
    return Path(path.position, path.velocity, path.force, slope, path.noise, kick, path.damping)


@kernel
def _corrected(edges: EdgeGrid, path: Path, linear: LinearStep, dt: float) -> End:
    """Where a path leads that may come to an edge; along the edge, or without one, as the plain formula."""
    end = follow(edges, path, dt)
    # Between edges of two directions no normal holds for all of the way: the first path stays.
    if linear.position_change != linear.position_missed and not end.corner:
        normal = edge_normal(edges, end.first) if end.first >= 0 else NOWHERE
        end = follow(edges, _scheme_path(path, linear, dt, normal), dt)
    return end


@kernel
def _kept(values: Floats, end: End) -> None:
    values[0], values[1] = end.position
    values[2], values[3] = end.velocity
    values[4], values[5] = end.time, end.edge


@kernel
def ends_at_edges(edges: EdgeGrid | None, step: BlockStep) -> Ends | None:
    """Where the paths lead that may come to an edge in the step that its trial predicts."""
    if edges is None:
        return None
    linear = linear_step(step.rates.damping[0], step.rates.amplitude[0], step.dt)
    later = step.trial.force
    which = _may_meet(edges, step, later, linear)
    values = np.empty((which.size, 6))
    for m in range(which.size):
        path = _path(step, later, linear, which[m])
        _kept(values[m], _corrected(edges, path, linear, step.dt))
    return Ends(which, values)


@kernel
def settle(
    edges: EdgeGrid | None, ends: Ends | None, state: ParticleState, k: int, t: float
) -> None:
    """Put particles of block k where their paths lead, from the time t on; some of them for ever."""
    if edges is not None and ends is not None:
        position, velocity = state.position[k], state.velocity[k]
        for m in range(ends.which.size):
            i, values = ends.which[m], ends.values[m]
            position[0, i], position[1, i] = values[0], values[1]
            velocity[0, i], velocity[1, i] = values[2], values[3]
            # A double holds any number of an edge exactly.
            edge = int(values[5])
            if edge >= 0:
                end_particle(
                    state.fates, state.frozen, state, (k, i), edges.patches[edge], t + values[4]
                )


@kernel
def end_particle(
    fates: Fates | None,
    frozen: Flags | None,
    state: ParticleState,
    where: tuple[int, int],
    patch: int,
    t: float,
) -> None:
    """Particle i of block k, where = (k, i), stays for ever where it is."""
    # Arguments, since numba leaves out what stands behind `is not None` for these only.
    if fates is not None and frozen is not None:
        k, i = where
        fates.code[k, i], fates.time[k, i] = FIRST_PATCH + patch, t
        frozen[k, i] = 1
        # The rate of the angle too: what holds a particle turns it no more.
        state.velocity[k, :, i] = 0.0
        state.force[k, :, i] = 0.0
        _clear_noise(state.noise, k, i)


@kernel
def _clear_noise(noise: Floats | None, k: int, i: int) -> None:
    if noise is not None:
        # Numbers that are drawn already would move it in the steps to come.
        noise[k, :, :, i] = 0.0


@inline_kernel
def _straight(before: Floats, position: Floats, i: int) -> Way:
    """The straight way from positions (2, B) to others (D, B)."""
    moved = position[0, i] - before[0, i], position[1, i] - before[1, i]
    return Way(moved, NOWHERE, NOWHERE, NOWHERE)


@kernel(noalias=True)
def _flag_straight(edges: EdgeGrid, before: Floats, position: Floats, flags: Flags) -> None:
    """As `_flag`."""
    for i in range(flags.size):
        way = _straight(before, position, i)
        flags[i] = leaves_support(edges, before[0, i], before[1, i], way)


@kernel
def straight_at_edges(
    edges: EdgeGrid | None,
    state: ParticleState,
    k: int,
    before: Floats | None,
    times: tuple[float, float],
) -> None:
    """Bounce particles of block k off edges on their straight ways from `before`, or end them, in place.

    before : (2, N), the positions at the start of the step; times : when that was, and the step's length.
    """
    if edges is not None and before is not None:
        t, dt = times
        position, velocity = state.position[k], state.velocity[k]
        # Written anew for each of the few that are left.
        flags, values = np.empty(position.shape[1], np.uint8), np.empty((1, 6))
        _flag_straight(edges, before, position, flags)
        for i in flagged(flags):
            way, (x, y) = _straight(before, position, i), (before[0, i], before[1, i])
            if takes_part(state.frozen, k, i) and may_meet_edge(edges, x, y, way):
                speed = way.velocity[0] / dt, way.velocity[1] / dt
                # What the velocity has besides that of the way is turned round with it.
                rest = velocity[0, i] - speed[0], velocity[1, i] - speed[1]
                # Leapfrog flies straight at the velocity that it has made: there is no damping on the way.
                path = Path((x, y), speed, NOWHERE, NOWHERE, NOWHERE, rest, 0.0)
                _kept(values[0], follow(edges, path, dt))
                settle(edges, Ends(np.full(1, i), values), state, k, t)


@kernel
def feed(state: ParticleState, k: int, limits: Limits, t: float) -> None:
    """Let live the slots of block k whose time has come by t, the end of a step; see `births`."""
    _feed(state.births, limits.edges, state.fates, state.frozen, state, (k, t))


@kernel
def _feed(
    births: Births | None,
    edges: EdgeGrid | None,
    fates: Fates | None,
    frozen: Flags | None,
    state: ParticleState,
    at: tuple[int, float],
) -> None:
    if births is not None and edges is not None and fates is not None and frozen is not None:
        k, t = at
        slots = births.time.shape[1]
        # Times ascend, so that those whose time has come are the next ones.
        while births.born[k] < slots and births.time[k, births.born[k]] <= t:
            j = births.born[k]
            births.born[k] += 1
            i = births.first + j
            fates.code[k, i], frozen[k, i] = INSIDE, 0
            _place_newborn(births, edges, state, (k, j), t - births.time[k, j])
        # Noise alone moves a slot that is not born yet. It is not cleared, for the slot needs it later.
        _hold_unborn(state.noise, births, state, k)


@kernel
def _place_newborn(
    births: Births, edges: EdgeGrid, state: ParticleState, where: tuple[int, int], age: float
) -> None:
    """Slot j of block k, where = (k, j), as old as `age`."""
    k, j = where
    i = births.first + j
    born, moving = births.position[k, :, j], births.velocity[k, :, j]
    state.velocity[k, :, i], state.force[k, :, i] = moving, births.force[k, :, j]
    for d in range(2, born.size):
        # The angle meets no edge.
        state.position[k, d, i] = born[d] + age * moving[d]
    path = Path((born[0], born[1]), (moving[0], moving[1]), NOWHERE, NOWHERE, NOWHERE, NOWHERE, 0.0)
    values = np.empty((1, 6))
    # Since its birth it may have come to a wall beside the inlet, or have left again.
    _kept(values[0], follow(edges, path, age))
    settle(edges, Ends(np.full(1, i), values), state, k, births.time[k, j])


@kernel
def _hold_unborn(noise: Floats | None, births: Births, state: ParticleState, k: int) -> None:
    """Slots draw their noise before they are born, so that it begins with their first whole step."""
    if noise is not None:
        for j in range(births.born[k], births.time.shape[1]):
            i = births.first + j
            state.position[k, :, i] = births.position[k, :, j]
            state.velocity[k, :, i] = 0.0
