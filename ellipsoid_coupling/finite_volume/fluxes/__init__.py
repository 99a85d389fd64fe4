"""Numerical fluxes, one file each.

A flux is a NamedTuple (its parameters) and a formula of a cell and its neighbours, registered for that
type (`contract.py`): numba then compiles the sweep with that formula inlined, and caches it. To add one,
copy `force.py` (given at faces) or `ballistic.py` (given for cells) and give it a name that scenes can
choose it by (`registry.py`); or register it from outside of the package, as
tests/extension/test_flux.py does.
"""

from ellipsoid_coupling.finite_volume.fluxes.ballistic import Ballistic
from ellipsoid_coupling.finite_volume.fluxes.force import Force
from ellipsoid_coupling.finite_volume.fluxes.kinetic import Kinetic
from ellipsoid_coupling.finite_volume.fluxes.registry import (
    FluxMaker,
    Transported,
    flux_named,
    flux_names,
    register_flux_name,
)

AnyFlux = Ballistic | Force | Kinetic

__all__ = [
    "AnyFlux",
    "Ballistic",
    "FluxMaker",
    "Force",
    "Kinetic",
    "Transported",
    "flux_named",
    "flux_names",
    "register_flux_name",
]
