"""Steps of particles off the walls of a box: which ones may come to a wall, and where they bounce to.

Each coordinate by itself, between its two walls (`bounces.fly`). Who may come to one is flagged in a loop
that vectorises; all others keep the plain formula.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.reflection import reflect
from ellipsoid_coupling.particles.bounces import Flight, fly
from ellipsoid_coupling.particles.flags import flagged
from ellipsoid_coupling.particles.linear import LinearStep, linear_step, noise_of
from ellipsoid_coupling.particles.state import BlockStep

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]
Indices = NDArray[np.int64]


class Bounces(NamedTuple):
    """Where one coordinate of some particles bounces to: indices (m,); position and velocity (m, 2)."""

    which: Indices
    values: Floats


@kernel(noalias=True)
def _flag(
    step: BlockStep, later: Floats, d: int, linear: LinearStep, walls: Floats, flags: Flags
) -> None:
    """Flag those that may come to a wall if the force (D, B) becomes `later`, and what is no number."""
    state, k, low, high = step.state, step.k, walls[0], walls[1]
    for i in range(flags.size):
        position, force = state.position[k, d, i], state.force[k, d, i]
        # A bound: a particle that it takes in needlessly is flown without a bounce.
        way = linear.position_velocity * abs(state.velocity[k, d, i])
        way += linear.position_force * abs(force) + linear.position_missed * abs(
            later[d, i] - force
        )
        way += abs(noise_of(step.noise, d, step.rates, linear, i)[0])
        # `and` would branch. Comparisons are false for NaN, so that it is flagged.
        flags[i] = not ((low + way <= position) & (position <= high - way))


@kernel
def _may_bounce(
    step: BlockStep, later: Floats, d: int, linear: LinearStep, walls: Floats
) -> Indices:
    """The particles (m,) that `_flag` flags."""
    flags = np.empty(step.state.position.shape[2], np.uint8)
    _flag(step, later, d, linear, walls, flags)
    return flagged(flags)


@kernel
def _flight(step: BlockStep, later: float, d: int, linear: LinearStep, i: int) -> Flight:
    """The path of a coordinate in a step, at whose end the force is `later`."""
    state, k, dt = step.state, step.k, step.dt
    force = state.force[k, d, i]
    # The noise of the whole step is spread evenly over it: how it came about is not known.
    moved = noise_of(step.noise, d, step.rates, linear, i)[0] / dt
    slope, damping = (later - force) / dt, step.rates.damping[d]
    return Flight(state.position[k, d, i], state.velocity[k, d, i], force, slope, moved, damping)


@kernel
def predict_in_box(box: Floats | None, step: BlockStep) -> None:
    """Predict anew what may come to a wall."""
    if box is not None:
        force = step.state.force[step.k]
        for d in range(2):
            linear = linear_step(step.rates.damping[d], step.rates.amplitude[d], step.dt)
            for i in _may_bounce(step, force, d, linear, box[d]):
                flight = _flight(step, force[d, i], d, linear, i)
                step.trial.position[d, i] = fly(flight, step.dt, box[d, 0], box[d, 1])[0]


@kernel
def bounces_in_box(
    box: Floats | None, step: BlockStep, d: int, linear: LinearStep
) -> Bounces | None:
    """Where those end that may come to a wall in the step which its trial predicts."""
    if box is None:
        return None
    # The angle has no walls; indices of one type in either case.
    nobody = np.empty(0, np.int64)
    which = _may_bounce(step, step.trial.force, d, linear, box[d]) if d < 2 else nobody
    values = np.empty((which.size, 2))
    for m in range(which.size):
        values[m, 0], values[m, 1] = _bounced(step, d, linear, box[d], which[m])
    return Bounces(which, values)


@kernel
def _bounced(
    step: BlockStep, d: int, linear: LinearStep, walls: Floats, i: int
) -> tuple[float, float]:
    """Position and velocity of a coordinate that may come to a wall; by the plain formula if not."""
    low, high, later = walls[0], walls[1], step.trial.force[d, i]
    flight = _flight(step, later, d, linear, i)
    kicked = noise_of(step.noise, d, step.rates, linear, i)[1]
    end, speed, sign, bounces = fly(flight, step.dt, low, high)
    if bounces == 0:
        change = later - flight.force
        # Flights take all of the change, the plain formula a part c of it: who is flagged
        # needlessly must end as if it had not been.
        end = step.trial.position[d, i] + linear.position_change * change
        speed = linear.decay * flight.velocity
        speed += linear.velocity_force * flight.force + linear.velocity_change * change
    # A bounce turns round the velocity's noise of the step as well: it keeps its law. A plain end may be
    # just outside, since it has a part of the change only.
    position, turned = reflect(end, low, high)
    return position, turned * (speed + sign * kicked)


@kernel
def settle_in_box(box: Floats | None, bounces: Bounces | None, step: BlockStep, d: int) -> None:
    """Put one coordinate where it bounces to, and all others within the walls by rounding."""
    if box is not None and bounces is not None and d < 2:
        position, velocity = step.state.position[step.k, d], step.state.velocity[step.k, d]
        low, high = box[d]
        for i in range(position.size):
            position[i] = min(max(position[i], low), high)
        # After the others: these rows are overwritten, whatever the plain formula has made of them.
        for m in range(bounces.which.size):
            position[bounces.which[m]] = bounces.values[m, 0]
            velocity[bounces.which[m]] = bounces.values[m, 1]
