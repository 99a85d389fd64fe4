"""Particle steppers, one file each; `SCHEMES` names them as the command line does.

A stepper is a module with a function ``advance(state, drift, rates, limits, until, steps)`` that
moves every realisation by at most `steps` steps and never beyond `until`, and the numbers of
Gaussian components that it wants a step, ``NOISE_PER_STEP`` a degree of freedom.
"""

from __future__ import annotations

from types import ModuleType

from ellipsoid_coupling.particles import exponential, leapfrog

SCHEMES: dict[str, ModuleType] = {"paper": leapfrog, "accurate": exponential}
