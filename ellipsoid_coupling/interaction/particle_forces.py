"""The drift of `eq:micro` on particles: everything but the linear damping and the noise.

    F     = gamma u(r)           - grad V1(r)        - 1/(m N)   sum_j grad_r U
    F_bar = gamma_bar g(theta,u) - dV2/dtheta(theta) - 1/(I_c N) sum_j dU/dtheta

A scheme adds -(gamma + A^2/2) v and A dW itself, exactly or not. What acts on a particle by itself is
`physics.drift`; a term that is None is not compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import fill
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.physics.drift import External, Fluid, external_drift
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.scenes.kinds import Record

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]


class Drift(NamedTuple):
    """The terms of the drift.

    Attributes
    ----------
    external : External
        What acts on each particle by itself.
    pairs : Pairs or None
        Interaction with each other and, inside it, with the walls' ghost particles.
    """

    external: External
    pairs: Pairs | None = None


@kernel
def set_axes(position: Floats, axis: Floats, part: tuple[int, int]) -> None:
    """Cos and sin of 2 theta (2, N) of the particles part[0] .. part[1] - 1.

    Where nothing turns only circles interact: any axis does.
    """
    first, end = part
    cosine, sine = axis[0, first:end], axis[1, first:end]
    if position.shape[0] == 3:
        angle = position[2, first:end]
        for i in range(end - first):
            cosine[i], sine[i] = cos_sin(2.0 * angle[i])
    else:
        cosine[:], sine[:] = 1.0, 0.0


@kernel(noalias=True)
def _set_rows(
    fluid: Fluid | None,
    outer: Record | None,
    angular: Record | None,
    t: float,
    position: Rows,
    axis: Rows,
    force: Rows,
    count: int,
) -> None:
    """Overwrite the forces of `count` particles: two or, where something turns, three rows."""
    # Terms come as arguments, one by one: what is None is then left out by the compiler.
    for i in range(count):
        here = load(position, i)
        force_x, force_y, torque = external_drift(fluid, outer, angular, t, here, load(axis, i))
        store(force, i, (force_x, force_y, *fill(torque, here[2:])))


@kernel
def own_forces(
    drift: Drift, t: float, position: Floats, axis: Floats, force: Floats, part: tuple[int, int]
) -> None:
    """`particle_forces` of the particles part[0] .. part[1] - 1, without the pairs.

    axis : (2, N), that of `set_axes`.
    """
    first, count = part[0], part[1] - part[0]
    fluid, outer, angular = drift.external
    double = rows_at(axis, (0, 1), first)
    if position.shape[0] == 3:
        here, rates = rows_at(position, (0, 1, 2), first), rows_at(force, (0, 1, 2), first)
        _set_rows(fluid, outer, angular, t, here, double, rates, count)
    else:
        # Nothing turns, so that V2 turns nobody.
        at, pulls = rows_at(position, (0, 1), first), rows_at(force, (0, 1), first)
        _set_rows(fluid, outer, None, t, at, double, pulls, count)


@kernel
def _add_pairs(
    pairs: Pairs | None, position: Floats, axis: Floats, force: Floats, frozen: Flags | None
) -> None:
    # A function of its own: numba leaves out what stands behind `is not None` for arguments only.
    if pairs is not None:
        _add_moving_pairs(pairs, position, axis, force, frozen)


@kernel
def _add_moving_pairs(
    pairs: Pairs, position: Floats, axis: Floats, force: Floats, frozen: Flags | None
) -> None:
    """The pairs of those that move; most often that is all."""
    if frozen is None:
        add_pair_forces(position, axis, pairs, force)
    else:
        moving = np.flatnonzero(frozen == 0)
        if moving.size == frozen.size:
            add_pair_forces(position, axis, pairs, force)
        elif moving.size > 0:
            # Over a copy of those that move: frozen ones are neither targets nor sources.
            some = np.zeros((force.shape[0], moving.size))
            add_pair_forces(position[:, moving], axis[:, moving], pairs, some)
            for d in range(force.shape[0]):
                for m in range(moving.size):
                    force[d, moving[m]] += some[d, m]


@kernel
def still_frozen(frozen: Flags | None, force: Floats) -> None:
    """Set the forces (D, N) of frozen particles to 0."""
    if frozen is not None:
        for d in range(force.shape[0]):
            for i in range(force.shape[1]):
                # Chosen, not branched over, so that the loop vectorises.
                force[d, i] = force[d, i] if frozen[i] == 0 else 0.0


@kernel
def particle_forces(
    drift: Drift, t: float, position: Floats, force: Floats, frozen: Flags | None = None
) -> None:
    """Set the drift of all particles of one realisation at time t.

    Parameters
    ----------
    drift : Drift
    t : float
        The time of the evaluation, in the scene's unit.
    position : (D, N) float64
        x, y and, where something turns, the angle.
    force : (D, N)
        Overwritten, per mass and per inertia.
    frozen : (N,) uint8 or None
        1 for particles that feel nothing and act on nobody; None where there are none.
    """
    # Cosine and sine belong to the particle: no pair takes one.
    axis = np.empty((2, position.shape[1]))
    all_of_them = 0, position.shape[1]
    set_axes(position, axis, all_of_them)
    own_forces(drift, t, position, axis, force, all_of_them)
    _add_pairs(drift.pairs, position, axis, force, frozen)
    # Last, for fluid and potentials have pushed frozen ones as well.
    still_frozen(frozen, force)
