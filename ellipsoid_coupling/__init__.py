"""Ellipsoidal particles in an OpenFOAM flow: from particles to mean-field equations.

import ellipsoid_coupling as ec

scene = ec.load_scene("cavity")
result = ec.simulate(scene, model="rho_mono_kinetic")
result.density(cells=30)
result.angle_distribution(bins=60)
"""

from ellipsoid_coupling.errors import EllipsoidError, InputError, RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, builtin_scenes, load_scene
from ellipsoid_coupling.simulate import simulate

__version__ = "0.1.0"

__all__ = [
    "EllipsoidError",
    "FlowField",
    "InputError",
    "Result",
    "RunError",
    "Scene",
    "builtin_scenes",
    "load_scene",
    "simulate",
]
