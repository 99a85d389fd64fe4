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

from ellipsoid_coupling.compiled.jit import apart_kernel, inline_kernel, kernel
from ellipsoid_coupling.compiled.rows import Rows, load, map_fields, rows_at, store
from ellipsoid_coupling.flow.field import FlowArrays, nearest, sample_flow
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.external import harmonic_force, sine_torque
from ellipsoid_coupling.physics.jeffery import jeffery

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]
Rim = tuple[float, float, float, float]


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
    rim : (x_low, x_high, y_low, y_high) or None
        The flow's rectangle, where particles can leave it: a place beyond feels the fluid at the
        nearest point.
    """

    flow: FlowArrays | None
    drag: float
    angular_drag: float | None
    shape_factor: float
    pairs: Pairs | None
    stiffness: float | None
    amplitude: float | None
    rim: Rim | None = None


@kernel
def set_axes(place: Floats, axis: Floats, part: tuple[int, int]) -> None:
    """Cos and sin of 2 theta (2, N) of the particles part[0] .. part[1] - 1.

    Where nothing turns only circles interact: any axis does.
    """
    first, end = part
    cosine, sine = axis[0, first:end], axis[1, first:end]
    if place.shape[0] == 3:
        angle = place[2, first:end]
        for i in range(end - first):
            cosine[i], sine[i] = cos_sin(2.0 * angle[i])
    else:
        cosine[:], sine[:] = 1.0, 0.0


@apart_kernel
def _set_fluid_rows(
    flow: FlowArrays,
    drags: tuple[float, float],
    shape_factor: float,
    place: Rows,
    axis: Rows,
    force: Rows,
    count: int,
    rim: Rim | None,
) -> int:
    """Overwrite the forces of some particles with the fluid's; `axis` is () where nothing turns."""
    outside = 0
    # Not by whole vectors: under an `if`, LLVM does not gather the mask, and goes one by one.
    for i in range(count):
        here = load(place, i)
        x, y = nearest(rim, here[0], here[1])
        ux, uy, dux_dx, dux_dy, duy_dx, inside = sample_flow(flow, x, y)
        outside += not inside
        turned = load(axis, i)
        gradient = dux_dx, dux_dy, duy_dx
        rates = map_fields(
            _fluid_torque, (drags[1], gradient, shape_factor), (turned[:1], turned[1:])
        )
        store(force, i, (drags[0] * ux, drags[0] * uy, *rates))
    return outside


@inline_kernel
def _fluid_torque(
    angular_drag: float,
    gradient: tuple[float, float, float],
    shape_factor: float,
    c2: float,
    s2: float,
) -> float:
    """gamma_bar g."""
    dux_dx, dux_dy, duy_dx = gradient
    return angular_drag * jeffery(c2, s2, dux_dx, dux_dy, duy_dx, -dux_dx, shape_factor)


@kernel
def _set_fluid(
    flow: FlowArrays | None,
    drift: Drift,
    angular_drag: float | None,
    place: Floats,
    axis: Floats,
    force: Floats,
    part: tuple[int, int],
) -> int:
    """Overwrite the forces with the fluid's; returns how many particles lie outside the flow."""
    first, end = part
    if flow is None:
        force[:, first:end] = 0.0
        return 0
    at, count = rows_at(place, (0, 1), first), end - first
    if angular_drag is None:
        drags = drift.drag, 0.0
        return _set_fluid_rows(
            flow, drags, 0.0, at, (), rows_at(force, (0, 1), first), count, drift.rim
        )
    return _set_fluid_rows(
        flow,
        (drift.drag, angular_drag),
        drift.shape_factor,
        at,
        rows_at(axis, (0, 1), first),
        rows_at(force, (0, 1, 2), first),
        count,
        drift.rim,
    )


@kernel
def _add_pairs(
    pairs: Pairs | None, place: Floats, axis: Floats, force: Floats, frozen: Flags | None
) -> None:
    if pairs is not None:
        _add_moving_pairs(pairs, place, axis, force, frozen)


@kernel
def _add_moving_pairs(
    pairs: Pairs, place: Floats, axis: Floats, force: Floats, frozen: Flags | None
) -> None:
    """The pairs of those that move; most often that is all."""
    if frozen is None:
        add_pair_forces(place, axis, pairs, force)
    else:
        moving = np.flatnonzero(frozen == 0)
        if moving.size == frozen.size:
            add_pair_forces(place, axis, pairs, force)
        elif moving.size > 0:
            some = np.zeros((force.shape[0], moving.size))
            add_pair_forces(place[:, moving], axis[:, moving], pairs, some)
            for d in range(force.shape[0]):
                for m in range(moving.size):
                    force[d, moving[m]] += some[d, m]


@kernel
def still_frozen(frozen: Flags | None, force: Floats) -> None:
    """Set the forces (D, N) of frozen particles to 0."""
    if frozen is not None:
        for d in range(force.shape[0]):
            for i in range(force.shape[1]):
                force[d, i] = force[d, i] if frozen[i] == 0 else 0.0


@kernel
def _add_outer_force(
    stiffness: float | None, place: Floats, force: Floats, part: tuple[int, int]
) -> None:
    if stiffness is not None:
        first, end = part
        x, y, force_x, force_y = (
            place[0, first:end],
            place[1, first:end],
            force[0, first:end],
            force[1, first:end],
        )
        for i in range(end - first):
            fx, fy = harmonic_force(x[i], y[i], stiffness)
            force_x[i] += fx
            force_y[i] += fy


@kernel
def _add_outer_torque(
    amplitude: float | None, place: Floats, force: Floats, part: tuple[int, int]
) -> None:
    if amplitude is not None:
        first, end = part
        angle, torque = place[2, first:end], force[2, first:end]
        for i in range(end - first):
            torque[i] += sine_torque(angle[i], amplitude)


@kernel
def own_forces(
    drift: Drift, place: Floats, axis: Floats, force: Floats, part: tuple[int, int]
) -> int:
    """`particle_forces` of the particles part[0] .. part[1] - 1, without the pairs.

    axis : (2, N), that of `set_axes`.
    """
    outside = _set_fluid(drift.flow, drift, drift.angular_drag, place, axis, force, part)
    _add_outer_force(drift.stiffness, place, force, part)
    _add_outer_torque(drift.amplitude, place, force, part)
    return outside


@kernel
def particle_forces(drift: Drift, place: Floats, force: Floats, frozen: Flags | None = None) -> int:
    """Set the drift of all particles of one realisation.

    Parameters
    ----------
    drift : Drift
    place : (D, N) float64
        x, y and, where something turns, the angle.
    force : (D, N)
        Overwritten, per mass and per inertia.
    frozen : (N,) uint8 or None
        1 for particles that feel nothing and act on nobody; None where there are none.

    Returns
    -------
    int
        How many particles lie outside the flow; with a `rim`, in a solid.
    """
    axis = np.empty((2, place.shape[1]))
    all_of_them = 0, place.shape[1]
    set_axes(place, axis, all_of_them)
    outside = own_forces(drift, place, axis, force, all_of_them)
    _add_pairs(drift.pairs, place, axis, force, frozen)
    still_frozen(frozen, force)
    return outside
