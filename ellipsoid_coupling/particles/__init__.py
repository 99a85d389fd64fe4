"""Particles: their state, their steppers, the clocks that these run on, noise.

A stepper is one file with a `clocks.Scheme`; `SCHEMES` names them as the command line does.
"""

from __future__ import annotations

from ellipsoid_coupling.particles import exponential, leapfrog
from ellipsoid_coupling.particles.clocks import Scheme

SCHEMES: dict[str, Scheme] = {"paper": leapfrog.SCHEME, "accurate": exponential.SCHEME}
