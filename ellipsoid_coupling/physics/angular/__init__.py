"""Angular potentials V2(theta): records whose formulas are chosen by type, one file a kind."""

from ellipsoid_coupling.physics.angular.axis import Axis
from ellipsoid_coupling.physics.angular.formulas import (
    angular_energy,
    is_polar,
    outer_torque,
    outer_torque_slope,
    register,
)
from ellipsoid_coupling.physics.angular.sine import Sine

__all__ = [
    "Axis",
    "Sine",
    "angular_energy",
    "is_polar",
    "outer_torque",
    "outer_torque_slope",
    "register",
]
