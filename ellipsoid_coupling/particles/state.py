"""The arrays that particle steppers work on; they belong to the model that made them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.flow.field import FlowArrays
from ellipsoid_coupling.geometry.edge_grid import EdgeGrid
from ellipsoid_coupling.geometry.reflection import reflect
from ellipsoid_coupling.geometry.wrapping import wrap
from ellipsoid_coupling.particles.births import Births
from ellipsoid_coupling.particles.extremes import largest_size
from ellipsoid_coupling.particles.fates import Fates
from ellipsoid_coupling.stepping.step_control import LARGEST_FORCE, LARGEST_TORQUE

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]

# Degrees of freedom, the second axis of the state; ANGLE is there only if something turns.
X, Y, ANGLE = range(3)


class ParticleState(NamedTuple):
    """All realisations (R) of all degrees of freedom (D = 3, or 2 where nothing turns).

    Attributes
    ----------
    position, velocity : (R, D, N) float64
        Positions and angle; velocities and angular velocity.
    force : (R, D, N)
        The drift at `position` without its linear part, per mass and per inertia.
    clock : (R, CLOCK_COLUMNS)
        See `stepping.step_control`.
    noise : (R, steps, components, N) or None
        Standard normal numbers; None without noise.
    frozen : (R, N) uint8 or None
        1 for particles that take no part: they have left the flow's mesh, have ended at a patch, or are not
        fed in yet; None where there are none of these.
    fates : Fates or None
        None where none can end at a patch.
    births : Births or None
        None where nothing is fed in.
    """

    position: Floats
    velocity: Floats
    force: Floats
    clock: Floats
    noise: Floats | None
    frozen: Flags | None = None
    fates: Fates | None = None
    births: Births | None = None


class Rates(NamedTuple):
    """The linear part of each degree of freedom: v' = -damping v + ... + amplitude dW/dt.

    Attributes
    ----------
    damping, amplitude : (D,) float64
        gamma + A^2/2 and A; gamma_bar + B^2/2 and B for the angle.
    first_noisy, last_noisy : int
        The noisy degrees of freedom are first_noisy .. last_noisy - 1.
    """

    damping: Floats
    amplitude: Floats
    first_noisy: int
    last_noisy: int


class Trial(NamedTuple):
    """Where a step leads to: arrays (K, D, B) of all blocks, or (D, B) of one.

    `position` is where a constant drift leads, within the walls; `force` is the drift there.
    """

    position: Floats
    force: Floats


class BlockStep(NamedTuple):
    """A step of block k of `state`, which leads to a trial.

    Attributes
    ----------
    state : ParticleState
    k : int
    noise : (components, B) float64 or None
        The step's normal numbers; None without noise.
    rates : Rates
    trial : Trial
        Of the block.
    dt : float
    """

    state: ParticleState
    k: int
    noise: Floats | None
    rates: Rates
    trial: Trial
    dt: float


class Contact(NamedTuple):
    """What bounds a step where particles may meet in it; see `particles.collisions`.

    Attributes
    ----------
    reach : float
        The pair potential vanishes beyond this distance of the centres.
    thickness : float
        Its reach on the short side.
    part : float
        The part of the thickness by which a pair within reach may move against one another in a step.
    lever : float
        The largest distance that a particle's rim moves in a turn of one radian; 0 for circles.
    pull : (3, D) float64
        The largest acceleration by one neighbour, by all of them and by ghosts, in units of `scale`.
    ghost_reach : float
        How far into the box the ghost particles of walls act; 0 without.
    height, heat, mass : float
        Of one neighbour's potential (0 without noise, where steps are repeated), the thermal energy, and
        a particle's mass.
    """

    reach: float
    thickness: float
    part: float
    lever: float
    pull: Floats
    ghost_reach: float
    height: float
    heat: float
    mass: float


class Limits(NamedTuple):
    """What bounds a step, the box that reflects, and the periods.

    Attributes
    ----------
    step : float
        The fixed step (leapfrog) or the first one (exponential).
    tolerance : float
        Error allowed a step, in units of `scale`.
    scale : (D,) float64
        The particle's length L for positions, 1 radian for the angle.
    box : (2, 2) float64 or None
        [[x_low, x_high], [y_low, y_high]] of the reflecting walls; None without any.
    mesh : FlowArrays or None
        The flow whose mesh particles can leave, see `frozen`; None where none can.
    contact : Contact or None
        None without interaction.
    periods : (2, 2) float64 or None
        The sides that are periodic, as those of `box`; None without any.
    edges : EdgeGrid or None
        The edges of the fluid; None where the box bounds it, and nothing else.
    """

    step: float
    tolerance: float
    scale: Floats
    box: Floats | None
    mesh: FlowArrays | None = None
    contact: Contact | None = None
    periods: Floats | None = None
    edges: EdgeGrid | None = None


@kernel
def realisation(state: ParticleState, k: int) -> ParticleState:
    """Realisation k alone, as views: the axis of realisations stays, with length 1."""
    # Slices keep the axis, so that one kernel serves one realisation and many.
    one = slice(k, k + 1)
    position, velocity, force, clock = state.position, state.velocity, state.force, state.clock
    return ParticleState(
        position[one],
        velocity[one],
        force[one],
        clock[one],
        _noise_of_one(state.noise, k),
        _frozen_of_one(state.frozen, k),
        _fates_of_one(state.fates, k),
        _births_of_one(state.births, k),
    )


@kernel
def _noise_of_one(noise: Floats | None, k: int) -> Floats | None:
    if noise is None:
        return noise  # a literal None would make the type of what is returned optional
    one: Floats = noise[k : k + 1]
    return one


@kernel
def _frozen_of_one(frozen: Flags | None, k: int) -> Flags | None:
    if frozen is None:
        return frozen
    one: Flags = frozen[k : k + 1]
    return one


@kernel
def _fates_of_one(fates: Fates | None, k: int) -> Fates | None:
    if fates is None:
        return fates
    return Fates(fates.code[k : k + 1], fates.time[k : k + 1])


@kernel
def _births_of_one(births: Births | None, k: int) -> Births | None:
    if births is None:
        return births
    one = slice(k, k + 1)
    return Births(
        births.first,
        births.born[one],
        births.time[one],
        births.position[one],
        births.velocity[one],
        births.force[one],
    )


@kernel
def noise_rows(noise: Floats | None, k: int, step: int) -> Floats | None:
    """The normal numbers (components, N) of one step of realisation k."""
    if noise is None:
        return None
    rows: Floats = noise[k, step]
    return rows


@kernel
def largest_forces(force: Floats) -> tuple[float, float]:
    """The largest |F_x| or |F_y| and |F_bar| of forces (D, N)."""
    # Where nothing turns there is no third row.
    torque = largest_size(force[ANGLE]) if force.shape[0] > ANGLE else 0.0
    return max(largest_size(force[X]), largest_size(force[Y])), torque


@kernel
def note_forces(clock: Floats, force: float, torque: float) -> None:
    """Keep the largest force and torque of all steps."""
    clock[LARGEST_FORCE] = max(clock[LARGEST_FORCE], force)
    clock[LARGEST_TORQUE] = max(clock[LARGEST_TORQUE], torque)


@kernel
def all_finite(position: Floats) -> bool:
    """Whether a (D, N) array holds neither NaN nor infinity."""
    bad = 0
    for d in range(position.shape[0]):
        for i in range(position.shape[1]):
            # 0 times infinity or NaN is NaN. A sum has no branch, so that the loop vectorises.
            bad += 0.0 * position[d, i] != 0.0
    return bad == 0


@kernel
def bounce(box: Floats | None, position: Floats, velocity: Floats) -> None:
    """Fold positions (D, N) back into the box, in place, and change the sign of the velocities there."""
    if box is not None:
        for d in range(2):
            for i in range(position.shape[1]):
                # Sides that do not reflect are infinitely far.
                position[d, i], sign = reflect(position[d, i], box[d, 0], box[d, 1])
                velocity[d, i] *= sign


@kernel
def wrap_positions(periods: Floats | None, position: Floats) -> None:
    """Shift positions (D, N) by whole periods into the domain, in place."""
    if periods is not None:
        for d in range(2):
            for i in range(position.shape[1]):
                # Along an axis that is not periodic the period is infinite, and nothing is shifted.
                position[d, i] = wrap(position[d, i], periods[d, 0], periods[d, 1])
