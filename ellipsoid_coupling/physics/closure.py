"""Moment closures: what the velocities' spread adds to the momentum balance, and how one is added.

With n the direction of a flux and P the pressure,

    f_n(U)_k = v_n U_k + P(U) (k is the momentum in direction n)

`eq:macro_q_max` and `eq:macro_q_mono` differ by one number, P = number * density: mono-kinetic (all
particles at a point move alike) 0, pressureless Euler; Maxwellian (a unit Gaussian about the mean) 1,
isothermal Euler with sound speed 1. Any other pressure is a record and its formulas:

    class Adiabatic(NamedTuple): ...

    register_pressure(Adiabatic, pressure=..., sound_speed=...)

An equation of its own (of a temperature, say) is a further component of a `finite_volume.system.System`:
tests/extension/test_closure.py adds one.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.scenes.kinds import Record

PRESSURE: dict[str, float] = {"mono_kinetic": 0.0, "maxwellian": 1.0}

# A number times the density, or a record with formulas of its own.
Pressure = float | Record


@chosen_by_type
def cell_pressure(law: Pressure, state: Values) -> float:
    """P of a cell, from what it holds: the density first, further components last."""
    raise NotImplementedError


@chosen_by_type
def cell_sound(law: Pressure, state: Values) -> float:
    """How fast the pressure spreads a small disturbance of a cell; see `cell_pressure`."""
    raise NotImplementedError


@inline_kernel
def _of_density(law: float, state: Values) -> float:
    return law * state[0]


@inline_kernel
def _isothermal_sound(law: float, state: Values) -> float:  # noqa: ARG001
    return math.sqrt(law)


def register_pressure(
    record: type,
    *,
    pressure: Callable[..., float],
    sound_speed: Callable[..., float],
) -> None:
    """Add a pressure that a `System` may have.

    Parameters
    ----------
    record : a NamedTuple of numbers
        The law and its parameters; a System holds one of this type.
    pressure, sound_speed : formulas that numba can compile, or inline kernels
        (law, state) -> float, of a cell's contents (K,): the density is state[0], further components are
        the last ones, each times the density. Momenta lie between in an order that depends on the
        direction of a sweep. Both must bear an empty cell, all 0.

    Raises
    ------
    ValueError
        For a record that is registered already.
    """
    register_formula(cell_pressure, record, pressure)
    register_formula(cell_sound, record, sound_speed)


register_formula(cell_pressure, float, _of_density)
register_formula(cell_sound, float, _isothermal_sound)
