"""V2(theta) = -amplitude cos^2(theta - direction): a field that turns axes along itself, heads or tails."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.physics.angular.formulas import register
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.scenes.values import Positive


class Axis(NamedTuple):
    """V2(theta) = -amplitude cos^2(theta - direction), in 1/time^2; the direction in radian."""

    amplitude: Positive
    direction: float = 0.0


@inline_kernel
def _energy(potential: Axis, angle: float) -> float:
    cosine = cos_sin(angle - potential.direction)[0]
    return -potential.amplitude * cosine * cosine


@inline_kernel
def _torque(potential: Axis, angle: float) -> float:
    """-amplitude sin 2 (theta - direction)."""
    return -potential.amplitude * cos_sin(2.0 * (angle - potential.direction))[1]


@inline_kernel
def _slope(potential: Axis, angle: float) -> float:
    return -2.0 * potential.amplitude * cos_sin(2.0 * (angle - potential.direction))[0]


register(
    "axis",
    Axis,
    energy=_energy,
    torque=_torque,
    slope=_slope,
    text="V2 = -{amplitude:g} cos^2(theta - {direction:g})",
)
