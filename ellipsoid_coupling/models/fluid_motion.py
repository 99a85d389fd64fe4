"""How particles move that go with the fluid: at its velocity, and turning as Jeffery's term says."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.physics.jeffery import jeffery_coefficients, jeffery_rate
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]


def fluid_motion(scene: Scene, flow: FlowField, position: Floats) -> Floats:
    """Velocity and angular velocity (3, ...) of particles that go with the fluid, at its rim from outside.

    Without angular drag the fluid turns nothing: the angular velocity is 0.

    position : (3, ...) float64, x, y and the angle (radian)
    """
    x, y, angle = position
    particles, rates = scene.particles, scene.flow
    sample = flow.continued(x, y)
    if rates is None or rates.angular_drag == 0.0:
        spin = np.zeros_like(angle)
    else:
        shape_factor = potential_shape(particles.length, particles.width).shape_factor
        # The formulas are of numbers, and hold for arrays of them.
        coefficients: Any = plain(jeffery_coefficients)
        rate: Any = plain(jeffery_rate)
        turning = coefficients(1.0, sample.stretch, sample.dux_dy, sample.duy_dx, shape_factor)
        spin = rate(np.cos(2.0 * angle), np.sin(2.0 * angle), *turning)
    return np.stack(np.broadcast_arrays(sample.velocity_x, sample.velocity_y, spin))
