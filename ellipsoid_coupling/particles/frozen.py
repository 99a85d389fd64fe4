"""Particles that leave the flow's mesh are frozen: at rest where they left it, acting on nobody.

Beyond an outlet, or in a solid, the fluid is not known. After each step the straight way from the old
position to the new one, before that is wrapped, is followed in steps of half a cell. At the first point
outside the mesh the particle stays: its velocity, force and noise are set to 0, so that every scheme leaves
it there, and forces leave it out. So it is where nothing is known of the flow's outline but its mesh; else
particles end at patches (`fates`). Scenes whose flow cannot be left compile none of this.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.flow.field import FlowArrays, in_mesh
from ellipsoid_coupling.geometry.edge_grid import EdgeGrid
from ellipsoid_coupling.geometry.wrapping import wrap
from ellipsoid_coupling.particles.state import Limits, ParticleState

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]

# Fewer could jump over the corner of a solid.
_STEPS_PER_CELL = 2.0
# A bound for particles that cross the whole mesh in one step: this many times its cells.
_MOST_STEPS = 4


@kernel
def frozen_row(frozen: Flags | None, k: int) -> Flags | None:
    """The flags (N,) of realisation k; None where the flow cannot be left."""
    if frozen is None:
        return None
    row: Flags = frozen[k]
    return row


@kernel
def positions_before(bounded: FlowArrays | EdgeGrid | None, position: Floats) -> Floats | None:
    """A copy of x and y (2, N) before a step; None where nothing looks at the way from there."""
    if bounded is None:
        return None
    # A copy, since steps move particles in place.
    return position[:2].copy()


@kernel
def freeze(state: ParticleState, k: int, limits: Limits, before: Floats | None) -> None:
    """Freeze the particles of realisation k whose step from `before` has left the mesh, in place."""
    _freeze(state.frozen, limits.mesh, limits.periods, before, state, k)


@kernel
def _freeze(
    frozen: Flags | None,
    mesh: FlowArrays | None,
    periods: Floats | None,
    before: Floats | None,
    state: ParticleState,
    k: int,
) -> None:
    # Arguments, since numba leaves out what stands behind `is not None` for these only.
    if frozen is not None and mesh is not None and before is not None:
        position, velocity, force = state.position[k], state.velocity[k], state.force[k]
        for i in range(position.shape[1]):
            # Frozen ones are not followed: they lie outside already, and stay.
            if frozen[k, i] == 0:
                start, end = (before[0, i], before[1, i]), (position[0, i], position[1, i])
                leaves, x, y = first_outside(mesh, start, end, periods)
                if leaves:
                    frozen[k, i] = 1
                    position[0, i], position[1, i] = x, y
                    velocity[:, i] = 0.0
                    force[:, i] = 0.0
                    _clear_noise(state.noise, k, i)


@kernel
def _clear_noise(noise: Floats | None, k: int, i: int) -> None:
    if noise is not None:
        # Numbers that are drawn already would move it in the steps to come.
        noise[k, :, :, i] = 0.0


@kernel
def _is_inside(mesh: FlowArrays, periods: Floats | None, x: float, y: float) -> bool:
    """Whether a position, or its image in the domain, lies in the mesh."""
    if periods is not None:
        x, y = wrap(x, periods[0, 0], periods[0, 1]), wrap(y, periods[1, 0], periods[1, 1])
    inside: bool = in_mesh(mesh, x, y)
    return inside


@kernel
def first_outside(
    mesh: FlowArrays,
    start: tuple[float, float],
    end: tuple[float, float],
    periods: Floats | None = None,
) -> tuple[bool, float, float]:
    """Whether the straight way leaves the mesh, and its first point outside, or else its end.

    It may cross periodic sides, as often as it likes.

    A position that is not finite counts as inside: the steppers report it as a failure of their own.
    """
    dx, dy = end[0] - start[0], end[1] - start[1]
    if not abs(dx) + abs(dy) < np.inf:
        return False, end[0], end[1]
    ny, nx = mesh.mask.shape
    way = _STEPS_PER_CELL * max(abs(dx) * mesh.inverse_dx, abs(dy) * mesh.inverse_dy)
    # Bounded as a floating point number: an integer may not hold the way of a run that blows up.
    parts = 1 + int(min(way, float(_MOST_STEPS * (nx + ny))))
    for j in range(1, parts):
        x, y = start[0] + dx * j / parts, start[1] + dy * j / parts
        if not _is_inside(mesh, periods, x, y):
            return True, x, y
    return not _is_inside(mesh, periods, end[0], end[1]), end[0], end[1]
