"""V1(r) = stiffness |r|^2 / 2."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.physics.outer.formulas import register
from ellipsoid_coupling.scenes.values import Positive


class Harmonic(NamedTuple):
    """V1(r) = stiffness |r|^2 / 2, in 1/time^2."""

    stiffness: Positive


@inline_kernel
def _energy(potential: Harmonic, x: float, y: float) -> float:
    return 0.5 * potential.stiffness * (y * y + x * x)


@inline_kernel
def _force(potential: Harmonic, x: float, y: float) -> tuple[float, float]:
    return -potential.stiffness * x, -potential.stiffness * y


register("harmonic", Harmonic, energy=_energy, force=_force, text="V1 = {stiffness:g} r^2/2")
