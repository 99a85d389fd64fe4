"""Particles: their state, their steppers, the clocks that these run on, noise.

A stepper is one file with a `clocks.Stepper`; `STEPPERS` names them as the command line does.
"""

from __future__ import annotations

from ellipsoid_coupling.particles import exponential, leapfrog
from ellipsoid_coupling.particles.clocks import Stepper

STEPPERS: dict[str, Stepper] = {"paper": leapfrog.STEPPER, "accurate": exponential.STEPPER}
