"""The drift of `eq:micro` at one place and angle: all of it but the other particles.

    F     = gamma u(t, r)           - grad V1(r) + g
    F_bar = gamma_bar g(theta, u)   - dV2/dtheta(theta)

Particles evaluate it in their loop, cells once at their centres. The interaction is added by those who
know the others (`interaction`), per mass and per inertia.

Drag enters twice, and both halves belong together: gamma u comes from here, -gamma v from the exact
linear part of a scheme, which has the rates gamma + A^2/2 (`models.from_scene.scene_rates`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import total
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.flow.field import FlowArrays, nearest
from ellipsoid_coupling.flow.interval import Interval, sample_at
from ellipsoid_coupling.physics.angular import outer_torque
from ellipsoid_coupling.physics.jeffery import Coefficients, jeffery_coefficients, jeffery_rate
from ellipsoid_coupling.physics.outer import outer_force
from ellipsoid_coupling.scenes.kinds import Record

Rectangle = tuple[float, float, float, float]

EVERYWHERE: Rectangle = (-math.inf, math.inf, -math.inf, math.inf)


class Fluid(NamedTuple):
    """What the fluid does to a particle.

    Attributes
    ----------
    flow : FlowArrays or Interval
        The same at all times, or linear in time.
    drag, angular_drag : float
        gamma and gamma_bar.
    shape_factor : float
        lambda of Jeffery's term.
    rim : (x_low, x_high, y_low, y_high)
        A place beyond feels the fluid at the nearest point of this rectangle: the flow's, where
        particles can leave it, else infinite.
    """

    flow: FlowArrays | Interval
    drag: float
    angular_drag: float
    shape_factor: float
    rim: Rectangle = EVERYWHERE


class External(NamedTuple):
    """The terms that act on a particle by itself; None where the scene does not have one.

    Attributes
    ----------
    fluid : Fluid or None
    outer, angular : record or None
        V1 and V2, see `physics.outer` and `physics.angular`; gravity is a part of V1, -g . r.
    """

    fluid: Fluid | None = None
    outer: Record | None = None
    angular: Record | None = None


@inline_kernel
def external_terms(
    fluid: Fluid | None,
    outer: Record | None,
    t: float,
    x: float,
    y: float,
) -> tuple[float, float, Coefficients]:
    """What does not depend on the angle, at time t: F_x, F_y, and gamma_bar (a, b, c) of Jeffery's term.

    The compiler leaves out what stands behind an argument that is None, if its caller got it as an
    argument, too.
    """
    force_x, force_y, turning = 0.0, 0.0, (0.0, 0.0, 0.0)
    if fluid is not None:
        near_x, near_y = nearest(fluid.rim, x, y)
        ux, uy, stretch, dux_dy, duy_dx, _ = sample_at(fluid.flow, t, near_x, near_y)
        force_x, force_y = fluid.drag * ux, fluid.drag * uy
        turning = jeffery_coefficients(
            fluid.angular_drag, stretch, dux_dy, duy_dx, fluid.shape_factor
        )
    if outer is not None:
        pull_x, pull_y = outer_force(outer, x, y)
        force_x, force_y = force_x + pull_x, force_y + pull_y
    return force_x, force_y, turning


@inline_kernel
def external_drift(
    fluid: Fluid | None,
    outer: Record | None,
    angular: Record | None,
    t: float,
    place: tuple[float, ...],
    axis: tuple[float, ...],
) -> tuple[float, float, float]:
    """(F_x, F_y, F_bar) at time t.

    place : (x, y, theta), or (x, y) where nothing turns, of which V2 alone takes theta.
    axis : (cos 2 theta, sin 2 theta).
    """
    force_x, force_y, turning = external_terms(fluid, outer, t, place[0], place[1])
    torque = 0.0
    if fluid is not None:
        torque = jeffery_rate(axis[0], axis[1], turning[0], turning[1], turning[2])
    if angular is not None:
        torque = torque + outer_torque(angular, total(place[2:]))
    return force_x, force_y, torque
