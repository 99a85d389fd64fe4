"""Numerical fluxes, one file each.

A flux is a NamedTuple (its parameters) and an overload of `outflow` for that type: numba then compiles
the sweep with that flux inlined, and caches it. To add one, copy `force.py` and name it where a model
chooses its scheme.
"""

from ellipsoid_coupling.schemes.fluxes.ballistic import Ballistic
from ellipsoid_coupling.schemes.fluxes.force import Force
from ellipsoid_coupling.schemes.fluxes.kinetic import Kinetic

AnyFlux = Ballistic | Force | Kinetic

__all__ = ["AnyFlux", "Ballistic", "Force", "Kinetic"]
