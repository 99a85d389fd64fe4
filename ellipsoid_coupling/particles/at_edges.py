"""Steps of particles off the edges of the fluid: which ones may meet an edge, and where they end then.

All particles take the plain formula in a loop that vectorises. Those whose way may be longer than the
clearance about them, few as a rule, are then followed along their paths (`paths.follow`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.edge_grid import EdgeGrid, clearance_at, has_edge_within
from ellipsoid_coupling.geometry.fate_codes import FIRST_PATCH, INSIDE
from ellipsoid_coupling.particles.births import Births
from ellipsoid_coupling.particles.fates import Fates, takes_part
from ellipsoid_coupling.particles.linear import LinearStep, linear_step, noise_of
from ellipsoid_coupling.particles.paths import End, Path, edge_normal, follow
from ellipsoid_coupling.particles.state import Limits, ParticleState, Rates, Trial

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]
Indices = NDArray[np.int64]

NOWHERE = (0.0, 0.0)


class Ends(NamedTuple):
    """Where the paths of some particles lead: indices (m,); and place, velocity, time, edge (m, 6)."""

    which: Indices
    values: Floats


@kernel
def _size(vector: tuple[float, float]) -> float:
    return abs(vector[0]) + abs(vector[1])


@kernel
def _path(
    state: ParticleState,
    k: int,
    i: int,
    noise: Floats | None,
    rates: Rates,
    linear: LinearStep,
    dt: float,
) -> Path:
    """The path of a particle for a constant drift, with the noise of a step of dt."""
    place, velocity, force = state.place, state.velocity, state.force
    right, across = noise_of(noise, 0, rates, linear, i)
    up, along = noise_of(noise, 1, rates, linear, i)
    return Path(
        (place[k, 0, i], place[k, 1, i]),
        (velocity[k, 0, i], velocity[k, 1, i]),
        (force[k, 0, i], force[k, 1, i]),
        NOWHERE,
        # The noise of the whole step is spread evenly over it: how it came about is not known.
        (right / dt, up / dt),
        (across, along),
        rates.damping[0],
    )


@kernel
def _may_meet(
    edges: EdgeGrid,
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    linear: LinearStep,
    later: Floats,
) -> Indices:
    """The particles (m,) that may come to an edge within a step, in which the drift becomes `later`.

    Not those whose way is not a number: the steppers report these themselves.
    """
    x, y = state.place[k, 0], state.place[k, 1]
    u, v = state.velocity[k, 0], state.velocity[k, 1]
    pull_x, pull_y, later_x, later_y = state.force[k, 0], state.force[k, 1], later[0], later[1]
    which, count = np.empty(x.size, np.int64), 0
    for i in range(x.size):
        way = linear.place_velocity * (abs(u[i]) + abs(v[i]))
        way += linear.place_force * (abs(pull_x[i]) + abs(pull_y[i]))
        way += linear.place_missed * (abs(later_x[i] - pull_x[i]) + abs(later_y[i] - pull_y[i]))
        way += abs(noise_of(noise, 0, rates, linear, i)[0])
        way += abs(noise_of(noise, 1, rates, linear, i)[0])
        near = way > clearance_at(edges, x[i], y[i]) and takes_part(state.frozen, k, i)
        # The clearance is that of a cell; few of those that exceed it are as near as that to an edge.
        if near and has_edge_within(edges, x[i], y[i], way):
            which[count] = i
            count += 1
    return which[:count]


@kernel
def predict_at_edges(
    edges: EdgeGrid | None,
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    trial: Trial,
    dt: float,
) -> None:
    """Predict anew what may come to an edge: a place in the fluid, or where it would end."""
    if edges is not None:
        linear = linear_step(rates.damping[0], rates.amplitude[0], dt)
        for i in _may_meet(edges, state, k, noise, rates, linear, state.force[k]):
            end = follow(edges, _path(state, k, i, noise, rates, linear, dt), dt)
            trial.place[0, i], trial.place[1, i] = end.place


@kernel
def _changing(path: Path, state: ParticleState, k: int, i: int, trial: Trial, dt: float) -> Path:
    """The path with the change of the drift that a trial has found."""
    slope = (
        (trial.force[0, i] - state.force[k, 0, i]) / dt,
        (trial.force[1, i] - state.force[k, 1, i]) / dt,
    )
    return Path(path.place, path.velocity, path.force, slope, path.noise, path.kick, path.damping)


@kernel
def _scheme_path(path: Path, linear: LinearStep, dt: float, normal: tuple[float, float]) -> Path:
    """The path to where the plain formula leads, which takes a part of the change only; see `exponential`.

    All of the change is taken along `normal`, that of a wall which is met, or NOWHERE.
    """
    part = linear.place_change / linear.place_missed
    (sx, sy), (kx, ky) = path.slope, path.kick
    across = normal[0] * sx + normal[1] * sy
    left_x = (1.0 - part) * (sx - across * normal[0])
    left_y = (1.0 - part) * (sy - across * normal[1])
    slope = sx - left_x, sy - left_y
    kick = kx + linear.velocity_change * dt * left_x, ky + linear.velocity_change * dt * left_y
    return Path(path.place, path.velocity, path.force, slope, path.noise, kick, path.damping)


@kernel
def _corrected(edges: EdgeGrid, path: Path, linear: LinearStep, dt: float) -> End:
    """Where a path leads that may come to an edge; along the edge, or without one, as the plain formula."""
    end = follow(edges, path, dt)
    if linear.place_change != linear.place_missed and not end.corner:
        normal = edge_normal(edges, end.first) if end.first >= 0 else NOWHERE
        end = follow(edges, _scheme_path(path, linear, dt, normal), dt)
    return end


@kernel
def _kept(values: Floats, end: End) -> None:
    values[0], values[1] = end.place
    values[2], values[3] = end.velocity
    values[4], values[5] = end.time, end.edge


@kernel
def ends_at_edges(
    edges: EdgeGrid | None,
    state: ParticleState,
    k: int,
    noise: Floats | None,
    rates: Rates,
    trial: Trial,
    dt: float,
) -> Ends | None:
    """Where the paths lead that may come to an edge in the step that `trial` predicts."""
    if edges is None:
        return None
    linear = linear_step(rates.damping[0], rates.amplitude[0], dt)
    which = _may_meet(edges, state, k, noise, rates, linear, trial.force)
    values = np.empty((which.size, 6))
    for m in range(which.size):
        path = _path(state, k, which[m], noise, rates, linear, dt)
        path = _changing(path, state, k, which[m], trial, dt)
        _kept(values[m], _corrected(edges, path, linear, dt))
    return Ends(which, values)


@kernel
def settle(
    edges: EdgeGrid | None, ends: Ends | None, state: ParticleState, k: int, t: float
) -> None:
    """Put particles of block k where their paths lead, from the time t on; some of them for ever."""
    if edges is not None and ends is not None:
        place, velocity = state.place[k], state.velocity[k]
        for m in range(ends.which.size):
            i, values = ends.which[m], ends.values[m]
            place[0, i], place[1, i] = values[0], values[1]
            velocity[0, i], velocity[1, i] = values[2], values[3]
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
    if fates is not None and frozen is not None:
        k, i = where
        fates.code[k, i], fates.time[k, i] = FIRST_PATCH + patch, t
        frozen[k, i] = 1
        state.velocity[k, :, i] = 0.0
        state.force[k, :, i] = 0.0
        _clear_noise(state.noise, k, i)


@kernel
def _clear_noise(noise: Floats | None, k: int, i: int) -> None:
    if noise is not None:
        noise[k, :, :, i] = 0.0


@kernel
def straight_at_edges(
    edges: EdgeGrid | None,
    state: ParticleState,
    k: int,
    before: Floats | None,
    times: tuple[float, float],
) -> None:
    """Bounce particles of block k off edges on their straight ways from `before`, or end them, in place.

    before : (2, N), the places at the start of the step; times : when that was, and the step's length.
    """
    if edges is not None and before is not None:
        t, dt = times
        place, velocity = state.place[k], state.velocity[k]
        values = np.empty((1, 6))
        for i in range(place.shape[1]):
            x, y = before[0, i], before[1, i]
            way = place[0, i] - x, place[1, i] - y
            if takes_part(state.frozen, k, i) and _size(way) > clearance_at(edges, x, y):
                speed = way[0] / dt, way[1] / dt
                # What the velocity has besides that of the way is turned round with it.
                rest = velocity[0, i] - speed[0], velocity[1, i] - speed[1]
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
        while births.born[k] < slots and births.time[k, births.born[k]] <= t:
            j = births.born[k]
            births.born[k] += 1
            i = births.first + j
            fates.code[k, i], frozen[k, i] = INSIDE, 0
            _place_newborn(births, edges, state, (k, j), t - births.time[k, j])
        _hold_unborn(state.noise, births, state, k)


@kernel
def _place_newborn(
    births: Births, edges: EdgeGrid, state: ParticleState, where: tuple[int, int], age: float
) -> None:
    """Slot j of block k, where = (k, j), as old as `age`."""
    k, j = where
    i = births.first + j
    born, moving = births.place[k, :, j], births.velocity[k, :, j]
    state.velocity[k, :, i], state.force[k, :, i] = moving, births.force[k, :, j]
    for d in range(2, born.size):
        state.place[k, d, i] = born[d] + age * moving[d]
    path = Path((born[0], born[1]), (moving[0], moving[1]), NOWHERE, NOWHERE, NOWHERE, NOWHERE, 0.0)
    values = np.empty((1, 6))
    _kept(values[0], follow(edges, path, age))
    settle(edges, Ends(np.full(1, i), values), state, k, births.time[k, j])


@kernel
def _hold_unborn(noise: Floats | None, births: Births, state: ParticleState, k: int) -> None:
    """Slots draw their noise before they are born, so that it begins with their first whole step."""
    if noise is not None:
        for j in range(births.born[k], births.time.shape[1]):
            i = births.first + j
            state.place[k, :, i] = births.place[k, :, j]
            state.velocity[k, :, i] = 0.0
