"""The outer potentials: V1(r) = stiffness |r|^2 / 2 and V2(theta) = amplitude sin(theta).

A new one is added here, as a kernel beside these, and named in the scene's `[outer_potential]`.
"""

from __future__ import annotations

from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.physics.elementary import cos_sin


@inline_kernel
def harmonic_force(x: float, y: float, stiffness: float) -> tuple[float, float]:
    """-grad V1 of V1(r) = stiffness |r|^2 / 2."""
    return -stiffness * x, -stiffness * y


@inline_kernel
def sine_torque(angle: float, amplitude: float) -> float:
    """-dV2/dtheta of V2(theta) = amplitude sin(theta)."""
    cosine, _ = cos_sin(angle)
    return -amplitude * cosine
