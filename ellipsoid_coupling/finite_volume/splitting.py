"""How transport and sources of a cell equation follow one another within a step.

A splitting is one step of an equation on an r-grid, which offers its fields and three operations
(`SplitEquation`). It declares its order, and whether it may refuse a step that turns out too long, so
that the caller can repeat it with a smaller one.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.fluxes import Ballistic, Force
from ellipsoid_coupling.finite_volume.fluxes.ballistic import bends_of_step, smooth_part
from ellipsoid_coupling.finite_volume.sources import (
    ANGLE,
    Extremes,
    Kick,
    exact_kick,
    extremes,
    kick,
    kick_anew,
    step_implicitly,
    turn,
)
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.stepping.step_control import (
    CFL_LIMIT,
    FORCE_LIMIT,
    ROTATION_LIMIT,
    looking_ahead,
)

Floats = NDArray[np.float64]

# A step that turns a cell by more than this (radian) does not resolve the torque.
LARGEST_TURN = 0.5
# Grids of more cells than this, along the longer side, take shorter steps where turning limits them.
_COARSE = 128


class SplitEquation(Protocol):
    """What a splitting steps."""

    fields: Floats
    drift: Floats
    terms: CellTerms

    def transport(self, flux: Ballistic | Force, dt: float, x_first: bool) -> None:
        """Move all fields along x and then y for dt, or along y and then x."""
        ...

    def forces(self) -> Forces | None:
        """Interaction and walls at the present fields; None without interaction."""
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

    @property
    def found(self) -> Extremes | None:
        """What fields and drift are at most after the last step; None where it does not look."""
        ...

    def start(self, equation: SplitEquation) -> None:
        """Set the drift, and whatever else follows from the fields; they are at the start."""
        ...

    def restore(self, equation: SplitEquation) -> None:
        """Set whatever follows from fields and drift, which have been restored."""
        ...

    def largest_step(self, equation: SplitEquation, cfl: float) -> tuple[float, int]:
        """The step that the CFL number allows now, and its reason."""
        ...

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Step by dt in place; False (fields half-changed) if that was too long."""
        ...


def _step_for(rate: float, acceleration: float, distance: float, ahead: float) -> float:
    """The dt in which nothing goes further than `distance`; infinite where nothing moves.

    With ahead = distance it solves dt (rate + acceleration dt) = distance; a longer one gives a shorter
    dt, see `looking_ahead`.
    """
    root = rate + np.sqrt(rate * rate + 4.0 * acceleration * ahead)
    # Not a number stays what it is, so that the caller notices.
    return float(2.0 * distance / root) if root != 0.0 else np.inf


def _cfl_step(
    equation: SplitEquation, found: Extremes, distance: float, ahead: float
) -> tuple[float, int]:
    """As long as nothing flies further than `distance`."""
    speed, force = found.speed, found.force
    dt = _longest(speed, force, equation.terms.damping, distance, ahead)
    return dt, CFL_LIMIT if dt * speed >= 0.5 * distance else FORCE_LIMIT


def _longest(rate: float, force: float, damping: float, distance: float, ahead: float) -> float:
    """The dt in which nothing at this rate, driven by this force, goes further than `distance`.

    Rates grow by the force, but with damping Gamma never beyond force/Gamma: the better of the two
    bounds counts, so that stiff drag costs no steps.
    """
    terminal = max(rate, force / damping) if damping > 0.0 else np.inf
    free = _step_for(rate, force, distance, ahead)
    return max(free, _step_for(terminal, 0.0, distance, distance))


def largest_turn(equation: SplitEquation) -> float:
    """How far a cell may turn in a step (radian): less on finer grids, so that the order holds."""
    return float(LARGEST_TURN * min(1.0, _COARSE / max(equation.drift.shape[1:])))


def flight(equation: SplitEquation, dt: float) -> Ballistic:
    """Ballistic transport of v_x, v_y and, where it turns, phi and omega."""
    part = smooth_part(max(equation.drift.shape[1:]))
    density, angle, speed = bends_of_step(part, equation.cell, dt)
    turning = (angle, bends_of_step(part, 1.0, dt).speed)
    carried = (speed, speed, *turning) if equation.fields.shape[0] > ANGLE else (speed, speed)
    return Ballistic((density, *carried))


class GodunovSplitting:
    """Scheme `paper`: FORCE in x, FORCE in y, implicit Euler for the sources; first order."""

    order = 1
    refuses = False
    found = None

    def __init__(self, pressure: float) -> None:
        self._flux = Force(pressure)

    def start(self, equation: SplitEquation) -> None:
        """Set the drift."""
        equation.evaluate_drift()

    def restore(self, equation: SplitEquation) -> None:
        """Nothing is kept."""

    def largest_step(self, equation: SplitEquation, cfl: float) -> tuple[float, int]:
        """From the fastest cell; from rest, as far as the drift leads."""
        found = extremes(equation.fields, equation.drift)
        distance = cfl * equation.cell
        if found.speed > 0.0:
            return _step_for(found.speed, 0.0, distance, distance), CFL_LIMIT
        return _cfl_step(equation, found, distance, distance)

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Always accepted: transport uses the velocities that the step was chosen for."""
        del count
        equation.transport(self._flux, dt, x_first=True)
        equation.evaluate_drift()
        step_implicitly(equation.fields, equation.drift, equation.terms, dt)
        return True


class KickDriftKick:
    """Scheme `accurate`: exact kicks of half a step about a ballistic flight; second order."""

    order = 2
    refuses = False

    def __init__(self) -> None:
        self.found = Extremes(0.0, 0.0, 0.0, 0.0)

    def start(self, equation: SplitEquation) -> None:
        """The drift, and what the first step follows from; later ones find it in their last kick."""
        self._kick_anew(equation, Kick(1.0, 0.0, 1.0, 0.0))

    def restore(self, equation: SplitEquation) -> None:
        """As at the start: velocities change after the drift is set, place and angle do not."""
        self.start(equation)

    def _kick_anew(self, equation: SplitEquation, change: Kick) -> None:
        fields, terms, drift = equation.fields, equation.terms, equation.drift
        self.found = kick_anew(fields, terms, equation.forces(), drift, change)

    def largest_step(self, equation: SplitEquation, cfl: float) -> tuple[float, int]:
        """From the fastest and the fastest turning cell."""
        found, damping = self.found, equation.terms.angular_damping
        distance, turn = cfl * equation.cell, largest_turn(equation)
        ahead = max(distance, looking_ahead(equation.cell, max(equation.drift.shape[1:])))
        turning = _longest(found.spin, found.torque, damping, turn, LARGEST_TURN)
        return min(_cfl_step(equation, found, distance, ahead), (turning, ROTATION_LIMIT))

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Directions change order from step to step (`count`), so that neither is preferred.

        The allowed step counts the acceleration within it in, and flights empty no cell.
        """
        fields, drift = equation.fields, equation.drift
        change, x_first = exact_kick(equation.terms, 0.5 * dt), count % 2 == 0
        flux = flight(equation, dt)
        kick(fields, drift, change, 0.5 * dt)
        equation.transport(flux, dt, x_first)
        turn(fields, 0.5 * dt)
        self._kick_anew(equation, change)
        return True
