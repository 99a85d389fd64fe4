"""The drift of `eq:micro` on particles: everything but the linear damping and the noise.

    F     = gamma u(r)           - grad V1(r)        - 1/(m N)   sum_j grad_r U
    F_bar = gamma_bar g(theta,u) - dV2/dtheta(theta) - 1/(I_c N) sum_j dU/dtheta

A scheme adds -(gamma + A^2/2) v and A dW itself, exactly or not. A term that is None in `Drift` is
not compiled: numba prunes what stands behind ``if term is not None``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.field import FlowArrays, sample_flow
from ellipsoid_coupling.interaction.pairs import Pairs, add_pair_forces
from ellipsoid_coupling.kernels import kernel
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.external import harmonic_force, sine_torque
from ellipsoid_coupling.physics.jeffery import jeffery

Floats = NDArray[np.float64]


class Drift(NamedTuple):
    """The terms of the drift; None where the scene does not have one.

    Attributes
    ----------
    flow : FlowArrays or None
    drag : float
        gamma; 0 without a fluid.
    angular_drag : float or None
        gamma_bar; None where nothing turns.
    shape_factor : float
        lambda of Jeffery's term.
    pairs : Pairs or None
        Interaction with each other and, inside it, with the walls' ghost particles.
    stiffness, amplitude : float or None
        Of V1 and V2.
    """

    flow: FlowArrays | None
    drag: float
    angular_drag: float | None
    shape_factor: float
    pairs: Pairs | None
    stiffness: float | None
    amplitude: float | None


@kernel
def set_axes(place: Floats, axis: Floats) -> None:
    """Cos and sin of 2 theta (2, N); where nothing turns only circles interact: any axis does."""
    if place.shape[0] == 3:
        cosine, sine, angle = axis[0], axis[1], place[2]
        for i in range(angle.size):
            cosine[i], sine[i] = cos_sin(2.0 * angle[i])
    else:
        axis[0], axis[1] = 1.0, 0.0


@kernel
def _set_fluid_torque(
    angular_drag: float | None,
    torque_at: tuple[Floats, int],
    axis: tuple[float, float],
    gradient: tuple[float, float, float],
    shape_factor: float,
) -> None:
    if angular_drag is not None:
        force, i = torque_at
        dux_dx, dux_dy, duy_dx = gradient
        force[2, i] = angular_drag * jeffery(
            axis[0], axis[1], dux_dx, dux_dy, duy_dx, -dux_dx, shape_factor
        )


@kernel
def _set_fluid_forces(
    flow: FlowArrays | None, drift: Drift, place: Floats, axis: Floats, force: Floats
) -> int:
    """Overwrite the forces with the fluid's; returns how many particles lie outside the flow."""
    if flow is None:
        force[:] = 0.0
        return 0
    outside = 0
    for i in range(place.shape[1]):
        ux, uy, dux_dx, dux_dy, duy_dx, inside = sample_flow(flow, place[0, i], place[1, i])
        outside += not inside
        force[0, i] = drift.drag * ux
        force[1, i] = drift.drag * uy
        _set_fluid_torque(
            drift.angular_drag,
            (force, i),
            (axis[0, i], axis[1, i]),
            (dux_dx, dux_dy, duy_dx),
            drift.shape_factor,
        )
    return outside


@kernel
def _add_pairs(pairs: Pairs | None, place: Floats, axis: Floats, force: Floats) -> None:
    if pairs is not None:
        add_pair_forces(place, axis, pairs, force)


@kernel
def _add_outer_force(stiffness: float | None, place: Floats, force: Floats) -> None:
    if stiffness is not None:
        for i in range(place.shape[1]):
            fx, fy = harmonic_force(place[0, i], place[1, i], stiffness)
            force[0, i] += fx
            force[1, i] += fy


@kernel
def _add_outer_torque(amplitude: float | None, place: Floats, force: Floats) -> None:
    if amplitude is not None:
        for i in range(place.shape[1]):
            force[2, i] += sine_torque(place[2, i], amplitude)


@kernel
def own_forces(drift: Drift, place: Floats, axis: Floats, force: Floats) -> int:
    """`particle_forces` without the pairs; axis (2, N) is that of `set_axes`."""
    outside = _set_fluid_forces(drift.flow, drift, place, axis, force)
    _add_outer_force(drift.stiffness, place, force)
    _add_outer_torque(drift.amplitude, place, force)
    return outside


@kernel
def particle_forces(drift: Drift, place: Floats, force: Floats) -> int:
    """Set the drift of all particles of one realisation.

    Parameters
    ----------
    drift : Drift
    place : (D, N) float64
        x, y and, where something turns, the angle.
    force : (D, N)
        Overwritten, per mass and per inertia.

    Returns
    -------
    int
        How many particles lie outside the flow.
    """
    axis = np.empty((2, place.shape[1]))
    set_axes(place, axis)
    outside = own_forces(drift, place, axis, force)
    _add_pairs(drift.pairs, place, axis, force)
    return outside
