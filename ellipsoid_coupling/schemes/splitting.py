"""How transport and sources of a cell equation follow one another within a step.

A splitting is one step of an equation on an r-grid, which offers its fields and three operations
(`SplitEquation`). It declares its order, and whether it may refuse a step that turns out too long, so
that the caller can repeat it with a smaller one.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.schemes.fluxes import Ballistic, Force
from ellipsoid_coupling.schemes.sources import (
    CellTerms,
    kick_exactly,
    largest_drift,
    largest_rates,
    step_implicitly,
    turn,
)
from ellipsoid_coupling.schemes.step_control import CFL as CFL_NUMBER
from ellipsoid_coupling.schemes.step_control import FORCE, ROTATION

Floats = NDArray[np.float64]

# A step that turns a cell by more than this (radian) does not resolve the torque.
_LARGEST_TURN = 0.5


class SplitEquation(Protocol):
    """What a splitting steps."""

    fields: Floats
    drift: Floats
    terms: CellTerms

    def transport(self, flux: Ballistic | Force, axis: int, dt: float) -> None:
        """Move all fields along one axis (-1: x, -2: y) for dt."""
        ...

    def evaluate_drift(self) -> None:
        """Set `drift` from the present fields."""
        ...

    @property
    def cell(self) -> float:
        """The cell width h."""
        ...


class Splitting(Protocol):
    """One way to step a `SplitEquation`.

    `refuses` tells whether it may find a step too long that it has allowed itself.
    """

    order: int
    refuses: bool

    def largest_step(self, equation: SplitEquation, cfl: float) -> tuple[float, int]:
        """The step that the CFL number allows now, and its reason."""
        ...

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Step by dt in place; False (fields half-changed) if that was too long."""
        ...


def _step_for(rate: float, acceleration: float, distance: float) -> float:
    """The dt that solves dt (rate + acceleration dt) = distance; infinite where nothing moves."""
    root = rate + np.sqrt(rate * rate + 4.0 * acceleration * distance)
    # Not a number stays what it is, so that the caller notices.
    return float(2.0 * distance / root) if root != 0.0 else np.inf


def _cfl_step(equation: SplitEquation, speed: float, force: float, cfl: float) -> tuple[float, int]:
    """As long as nothing flies further than cfl cells; `speed` and `force` are the largest now."""
    distance = cfl * equation.cell
    dt = _longest(speed, force, equation.terms.damping, distance)
    return dt, CFL_NUMBER if dt * speed >= 0.5 * distance else FORCE


def _longest(rate: float, force: float, damping: float, distance: float) -> float:
    """The dt in which nothing at this rate, driven by this force, goes further than `distance`.

    Rates grow by the force, but with damping Gamma never beyond force/Gamma: the better of the two
    bounds counts, so that stiff drag costs no steps.
    """
    terminal = max(rate, force / damping) if damping > 0.0 else np.inf
    return max(_step_for(rate, force, distance), _step_for(terminal, 0.0, distance))


class GodunovSplitting:
    """Scheme `paper`: FORCE in x, FORCE in y, implicit Euler for the sources; first order."""

    order = 1
    refuses = False

    def __init__(self, pressure: float) -> None:
        self._flux = Force(pressure)

    def largest_step(self, equation: SplitEquation, cfl: float) -> tuple[float, int]:
        """From the fastest cell; from rest, as far as the drift leads."""
        speed, _ = largest_rates(equation.fields)
        distance = cfl * equation.cell
        if speed > 0.0:
            return _step_for(speed, 0.0, distance), CFL_NUMBER
        return _cfl_step(equation, speed, largest_drift(equation.drift)[0], cfl)

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Always accepted: transport uses the velocities that the step was chosen for."""
        del count
        for axis in (-1, -2):
            equation.transport(self._flux, axis, dt)
        equation.evaluate_drift()
        step_implicitly(equation.fields, equation.drift, equation.terms, dt)
        return True


class KickDriftKick:
    """Scheme `accurate`: exact kicks of half a step about a ballistic flight; second order."""

    order = 2
    refuses = False

    def __init__(self) -> None:
        self._flux = Ballistic()

    def largest_step(self, equation: SplitEquation, cfl: float) -> tuple[float, int]:
        """From the fastest and the fastest turning cell."""
        speed, spin = largest_rates(equation.fields)
        force, torque = largest_drift(equation.drift)
        turning = _longest(spin, torque, equation.terms.angular_damping, _LARGEST_TURN)
        return min(_cfl_step(equation, speed, force, cfl), (turning, ROTATION))

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Directions change order from step to step (`count`), so that neither is preferred.

        The allowed step counts the acceleration within it in, and flights empty no cell.
        """
        kick_exactly(equation.fields, equation.drift, equation.terms, 0.5 * dt, 0.5 * dt)
        for axis in (-1, -2) if count % 2 == 0 else (-2, -1):
            equation.transport(self._flux, axis, dt)
        turn(equation.fields, 0.5 * dt)
        equation.evaluate_drift()
        kick_exactly(equation.fields, equation.drift, equation.terms, 0.5 * dt, 0.0)
        return True
