"""What every angular potential V2(theta) has: its value, torque and slope, and how one is added.

    class Axis(NamedTuple):
        amplitude: Positive
        direction: float = 0.0

    angular.register("axis", Axis, energy=..., torque=..., slope=..., text="V2 = ...")

makes ``[angular_potential] kind = "axis"``, ``amplitude = 2.0`` a potential of all models. V2 must be
periodic: angles are taken modulo 2 pi.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.scenes.kinds import ANGULAR_POTENTIALS, Record

# Angles in half a turn; no multiple of a fold that a potential is likely to have.
_ASKED = 37


@chosen_by_type
def angular_energy(potential: Record | None, angle: float) -> float:
    """V2 at an angle, per moment of inertia; 0 without a potential."""
    raise NotImplementedError


@chosen_by_type
def outer_torque(potential: Record | None, angle: float) -> float:
    """-dV2/dtheta at an angle, an angular acceleration; 0 without a potential."""
    raise NotImplementedError


@chosen_by_type
def outer_torque_slope(potential: Record | None, angle: float) -> float:
    """-d^2 V2/dtheta^2 at an angle, for implicit steps; 0 without a potential."""
    raise NotImplementedError


def is_polar(potential: Record | None) -> bool:
    """Whether V2 tells theta from theta + pi, so that the head of an axis differs from its tail.

    Asked of the formula itself, at some angles.
    """
    if potential is None:
        return False
    angles = [math.pi * part / _ASKED for part in range(_ASKED)]
    energies = [
        (angular_energy(potential, a), angular_energy(potential, a + math.pi)) for a in angles
    ]
    size = max(abs(value) for pair in energies for value in pair)
    return any(abs(one - other) > 1e-9 * size for one, other in energies)


@inline_kernel
def _nothing(potential: None, angle: float) -> float:  # noqa: ARG001
    return 0.0


register_formula(angular_energy, type(None), _nothing)
register_formula(outer_torque, type(None), _nothing)
register_formula(outer_torque_slope, type(None), _nothing)


def register(
    kind: str,
    record: type[NamedTuple],
    *,
    energy: Callable[..., float],
    torque: Callable[..., float],
    slope: Callable[..., float],
    text: str,
) -> None:
    """Add a kind of angular potential, for scene files and for all models.

    Parameters
    ----------
    kind : str
        Its name in `[angular_potential]`.
    record : a NamedTuple of numbers
        The other keys of the section; see `scenes.kinds.Kinds.register` for their bounds.
    energy, torque, slope : formulas that numba can compile, or inline kernels
        (potential, angle) -> V2, -dV2/dtheta and -d^2 V2/dtheta^2, per moment of inertia.
    text : str
        The formula for ``ellipsoid plan``, keys in braces: "V2 = {amplitude:g} sin(theta)".

    Raises
    ------
    ValueError
        For a kind or record that is registered already.
    TypeError
        For a formula with another number of arguments.
    """
    # The kind last: where a formula is refused, scenes do not know it.
    register_formula(angular_energy, record, energy)
    register_formula(outer_torque, record, torque)
    register_formula(outer_torque_slope, record, slope)
    ANGULAR_POTENTIALS.register(kind, record, text)
