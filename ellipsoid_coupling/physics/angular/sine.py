"""V2(theta) = amplitude sin(theta), the paper's."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.physics.angular.formulas import register
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.scenes.values import Positive


class Sine(NamedTuple):
    """V2(theta) = amplitude sin(theta), in 1/time^2."""

    amplitude: Positive


@inline_kernel
def _energy(potential: Sine, angle: float) -> float:
    return potential.amplitude * cos_sin(angle)[1]


@inline_kernel
def _torque(potential: Sine, angle: float) -> float:
    return -potential.amplitude * cos_sin(angle)[0]


@inline_kernel
def _slope(potential: Sine, angle: float) -> float:
    return potential.amplitude * cos_sin(angle)[1]


register(
    "sine",
    Sine,
    energy=_energy,
    torque=_torque,
    slope=_slope,
    text="V2 = {amplitude:g} sin(theta)",
)
