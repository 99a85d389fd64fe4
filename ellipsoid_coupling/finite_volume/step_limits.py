"""How long a step may be: so short that no cell's mass moves further than it may, nor turns too far.

There are two bounds, because the cells' angle makes the difference:

    cell by cell     each cell's own speed and acceleration, |F - Gamma v|; a sharp bound, wherever the
                     angle is an axis
    by extremes      the fastest cell and the strongest force anywhere, as if they met; coarser and
                     cheaper (no root a cell), and what limits a step can be told: CFL number, force or
                     rotation. The carried angle has no cells to cross: a step is bounded by how far it
                     turns, in radian, which falls with the grid so that the order holds

A bound has a formula for a cell, `reached`, chosen by its type; sources raise peaks to it while they have
the cell at hand. `allowed` makes a step of what all cells have reached.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.rows import map_fields
from ellipsoid_coupling.physics.closure import Pressure, cell_sound
from ellipsoid_coupling.stepping.step_control import CFL_LIMIT, FORCE_LIMIT, ROTATION_LIMIT

Floats = NDArray[np.float64]
# A step and its reason, see `stepping.step_control`.
Allowed = tuple[float, int]
# The step that flights in space and that turning allow.
Steps = tuple[float, float]

# A step that turns a cell by more than this (radian) does not resolve the torque.
LARGEST_TURN = 0.5
# Grids of more cells than this, along the longer side, take shorter steps where turning limits them.
_COARSE = 128


@chosen_by_type
def reached(
    limit: CellwiseLimit | ExtremesLimit,
    inverse: float,
    momenta: Values,
    drift: Values,
    state: Values,
) -> Values:
    """What bounds the step in a cell, (`limit.peaks`,); infinite if not finite, 0 in vacuum.

    Parameters
    ----------
    inverse : float
        1/rho, 0 in vacuum.
    momenta, drift : (2 or 3,)
        Rho v and rho omega; F_x, F_y and F_bar.
    state : (1 + further components,)
        The density, and what the pressure may depend on besides.
    """
    raise NotImplementedError


class CellwiseLimit(NamedTuple):
    """The bound cell by cell; what is reached is distance/dt along each axis.

    Attributes
    ----------
    peaks : (D,) int
        0, 1, ..: what is reached, for each of D velocities.
    distances : (D,)
        How far mass may move along x, y and the angle; 0 along what is no axis.
    damping : (D,)
        Gamma, Gamma and Gamma_bar.
    ahead : (D,)
        Over which accelerations count, at least `distances`; see `step_control.looking_ahead`.
    sound : float
        Speed of signals, which adds to the velocities.
    damped : bool
        Damping is solved exactly, so that no velocity passes F/Gamma within a step.
    pressure : float or record
        Its speed of sound adds to the velocities, too; see `physics.closure`.
    """

    peaks: tuple[int, ...]
    distances: Values
    damping: Values
    ahead: Values
    sound: float = 0.0
    damped: bool = False
    pressure: Pressure = 0.0

    def steps(self, peaks: Floats) -> Steps:
        """The steps that space and the angle allow; infinite where nothing moves, 0 if not finite."""
        pairs = list(zip(self.distances, peaks.tolist(), strict=True))
        longest = [far / speed if speed > 0.0 else math.inf for far, speed in pairs if far > 0.0]
        # x and y, and the angle if there is any.
        return min(longest[:2]), min(longest[2:], default=math.inf)

    def allowed(self, peaks: Floats) -> Allowed:
        """The shorter of both steps, and what it is limited by."""
        return shorter(self.steps(peaks))


def shorter(steps: Steps) -> Allowed:
    """The shorter step of space and the angle, and what it is limited by."""
    return min((steps[0], CFL_LIMIT), (steps[1], ROTATION_LIMIT))


@inline_kernel
def _needed(
    inverse: float,
    sound: float,
    damped: bool,
    carried: float,
    pull: float,
    rate: float,
    ahead: float,
) -> float:
    """Distance/dt for the largest dt of a cell; infinite if not finite, 0 in vacuum.

    dt (|v| + sound + |F - Gamma v| dt/2) = distance, so that with s = |v| + sound, a = |F - Gamma v|

        distance/dt = (s + sqrt(s^2 + 2 a distance))/2

    with `ahead` under the root instead of the distance, which it may exceed; or s + a/Gamma, where
    damping holds velocities and that is less.
    """
    v = carried * inverse
    change, speed = abs(pull - rate * v), abs(v) + sound
    free = 0.5 * (speed + math.sqrt(speed * speed + 2.0 * change * ahead))
    holds = damped and rate > 0.0
    # The same for all cells, so that no cell waits for a division.
    stay = 1.0 / rate if holds else 0.0
    held = speed + change * stay if holds else np.inf
    # Comparisons that are false for NaN.
    freely = free <= held
    needed = free if freely else held
    known = needed < np.inf
    needed = needed if known else np.inf
    return 0.0 if inverse == 0.0 else needed


@inline_kernel
def _needed_of_cell(
    limit: CellwiseLimit, inverse: float, momenta: Values, drift: Values, state: Values
) -> Values:
    shared = inverse, limit.sound + cell_sound(limit.pressure, state), limit.damped
    found: Values = map_fields(_needed, shared, (momenta, drift, limit.damping, limit.ahead))
    return found


class Extremes(NamedTuple):
    """The largest |v_x| or |v_y|, |omega|, |F_x| or |F_y| and |F_bar|; infinite if not finite."""

    speed: float
    spin: float
    force: float
    torque: float


class ExtremesLimit(NamedTuple):
    """The bound by extremes; what is reached are speed, force and, where something turns, spin and torque.

    Attributes
    ----------
    peaks : (2 or 4,) int
        0, 1, ..
    distance : float
        How far mass may fly.
    ahead : float
        Over which forces count, at least `distance`; see `step_control.looking_ahead`.
    turn : float
        How far a cell may turn, radian; infinite where turning is solved implicitly.
    damping : (float, float)
        Gamma and Gamma_bar, which bound rates by force/Gamma.
    driven : bool
        Whether forces change the velocities before mass flies; else they count from rest only.
    """

    peaks: tuple[int, ...]
    distance: float
    ahead: float
    turn: float
    damping: tuple[float, float]
    driven: bool

    def allowed(self, peaks: Floats) -> Allowed:
        """The shorter of the steps that flight and turning allow, and what it is limited by."""
        found = extremes_of(peaks)
        force = found.force if self.driven or found.speed == 0.0 else 0.0
        torque = found.torque if self.driven else 0.0
        flight = _longest(found.speed, force, self.damping[0], self.distance, self.ahead)
        # Half of the way or more at the present speed: it is the speed that limits.
        reason = CFL_LIMIT if flight * found.speed >= 0.5 * self.distance else FORCE_LIMIT
        if math.isinf(self.turn):
            return flight, reason
        turning = _longest(found.spin, torque, self.damping[1], self.turn, LARGEST_TURN)
        return min((flight, reason), (turning, ROTATION_LIMIT))


def extremes_of(peaks: Floats) -> Extremes:
    """Speed, force and, where something turns, spin and torque, (2 or 4,), by their names."""
    # Where nothing turns there are two peaks.
    speed, force, spin, torque = (*peaks.tolist(), 0.0, 0.0)[:4]
    return Extremes(speed, spin, force, torque)


@inline_kernel
def _size(weight: float, value: float) -> float:
    """Magnitude of a rate or of a momentum; infinite if not finite."""
    size = abs(value * weight)
    # A comparison that is false for NaN.
    known = size < np.inf
    return size if known else np.inf


@inline_kernel
def _sizes_of_cell(
    limit: ExtremesLimit,  # noqa: ARG001 (the formula is chosen by it)
    inverse: float,
    momenta: Values,
    drift: Values,
    state: Values,  # noqa: ARG001 (of the contract)
) -> Values:
    rates = map_fields(_size, (inverse,), (momenta,))
    forces = map_fields(_size, (1.0,), (drift,))
    # Both components by themselves: no root a cell.
    return (max(rates[0], rates[1]), max(forces[0], forces[1]), *rates[2:], *forces[2:])


register_formula(reached, CellwiseLimit, _needed_of_cell)
register_formula(reached, ExtremesLimit, _sizes_of_cell)


def _step_for(rate: float, acceleration: float, distance: float, ahead: float) -> float:
    """The dt in which nothing goes further than `distance`; infinite where nothing moves.

    With ahead = distance it solves dt (rate + acceleration dt) = distance; a longer one gives a shorter
    dt, see `looking_ahead`.
    """
    root = rate + float(np.sqrt(rate * rate + 4.0 * acceleration * ahead))
    # Not a number stays what it is, so that the caller notices.
    return 2.0 * distance / root if root != 0.0 else math.inf


def _longest(rate: float, force: float, damping: float, distance: float, ahead: float) -> float:
    """The dt in which nothing at this rate, driven by this force, goes further than `distance`.

    Rates grow by the force, but with damping Gamma never beyond force/Gamma: the better of the two
    bounds counts, so that stiff drag costs no steps.
    """
    terminal = max(rate, force / damping) if damping > 0.0 else math.inf
    free = _step_for(rate, force, distance, ahead)
    return max(free, _step_for(terminal, 0.0, distance, distance))


def largest_turn(cells: int) -> float:
    """How far a cell may turn in a step (radian), by the number of cells along the longer side."""
    return LARGEST_TURN * min(1.0, _COARSE / cells)
