"""Outer potentials V1(r): records whose formulas are chosen by type, one file a kind."""

from ellipsoid_coupling.physics.outer.formulas import outer_energy, outer_force, register
from ellipsoid_coupling.physics.outer.gravity import Gravity, scene_outer
from ellipsoid_coupling.physics.outer.harmonic import Harmonic

__all__ = ["Gravity", "Harmonic", "outer_energy", "outer_force", "register", "scene_outer"]
