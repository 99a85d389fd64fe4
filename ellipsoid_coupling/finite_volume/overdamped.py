"""How the diffusive limit `eq:difflimit` is stepped: fields that move at the drift's own speed.

Where damping rules, a particle has no velocity of its own; drag and drift balance at every moment:

    v = sigma_1 F           omega = sigma_2 F_bar          sigma = 1/Gamma = 2/(2 gamma + A^2)

Both splittings write these into the fields' momenta and spin (`settle`) and let the transport of
the rho-equation carry mass and angle with them. Between directions the mass keeps the velocity that
it started with, so that a flight along x and then y is the same straight way as both at once.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.compiled.parallel_arguments import pack, unpack
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms, angular_rate
from ellipsoid_coupling.finite_volume.fluxes import Force
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.sources import (
    ANGLE,
    MOMENTUM_X,
    RHO,
    SPIN,
    extremes,
    turn,
)
from ellipsoid_coupling.finite_volume.splitting import (
    LARGEST_TURN,
    SplitEquation,
    flight,
    largest_turn,
)
from ellipsoid_coupling.stepping.step_control import CFL as CFL_NUMBER
from ellipsoid_coupling.stepping.step_control import ROTATION

Floats = NDArray[np.float64]

# Heun's corrector may move mass by this part of a cell and turn it by this part of a radian; more
# means that the drift changes within a step by as much as it is.
_LARGEST_CORRECTION = 0.25
_NEWTON_STEPS = 4


@parallel_kernel
def settle(
    fields: Floats, drift: Floats, sigma: tuple[float, float], share: float, carried: float
) -> None:
    """Set every cell's momenta and spin to rho (share sigma F - carried v), v their old velocity.

    Parameters
    ----------
    fields : (5 or 3, ny + 4, nx + 4) float64
        Changed in place: momenta and spin.
    drift : (3 or 2, ny, nx)
        F_x, F_y, F_bar.
    sigma : (float, float)
        sigma_1, sigma_2.
    share, carried : float
        1 and 0 for the drift velocity; 1/2 and 1/2 for Heun's correction to a flight.
    """
    for j in numba.prange(drift.shape[1]):
        for i in range(drift.shape[2]):
            p, q = j + GHOSTS, i + GHOSTS
            rho = fields[RHO, p, q]
            for d in range(2):
                k = MOMENTUM_X + d
                speed = share * sigma[0] * drift[d, j, i]
                fields[k, p, q] = rho * speed - carried * fields[k, p, q]
            if fields.shape[0] == 5:
                speed = share * sigma[1] * drift[2, j, i]
                fields[SPIN, p, q] = rho * speed - carried * fields[SPIN, p, q]


@parallel_kernel
def turn_implicitly(
    fields: Floats, drift: Floats, terms: CellTerms, sigma: float, dt: float
) -> None:
    """One implicit Euler step of phi' = sigma_2 F_bar(phi), in place: the paper's treatment.

    The torque of the interaction is that of the old angle; fluid and V2 are taken at the new one,
    by Newton's iteration. Nothing is done where nothing turns.
    """
    if fields.shape[0] == 5:
        packed = pack(terms)
        for j in numba.prange(drift.shape[1]):
            here = unpack(packed)
            for i in range(drift.shape[2]):
                rho = fields[RHO, j + GHOSTS, i + GHOSTS]
                if rho > 0.0:
                    old = fields[ANGLE, j + GHOSTS, i + GHOSTS] / rho
                    new = _implicit_angle(old, drift[2, j, i], here, (j, i), sigma * dt)
                    fields[ANGLE, j + GHOSTS, i + GHOSTS] = rho * new


@kernel
def _implicit_angle(
    old: float, drift: float, terms: CellTerms, cell: tuple[int, int], factor: float
) -> float:
    """The angle phi = old + factor F_bar(phi), where factor = dt sigma_2."""
    j, i = cell
    old_rate, _ = angular_rate(terms.turning, terms.angular, j, i, old)
    steady = old + factor * (drift - old_rate)
    new = old + factor * drift
    for _ in range(_NEWTON_STEPS):
        rate, slope = angular_rate(terms.turning, terms.angular, j, i, new)
        new -= (new - steady - factor * rate) / (1.0 - factor * slope)
    return new


def mobilities(terms: CellTerms) -> tuple[float, float]:
    """sigma_1 and sigma_2; sigma_2 is 0 where nothing turns."""
    spin = 1.0 / terms.angular_damping if terms.angular_damping > 0.0 else 0.0
    return 1.0 / terms.damping, spin


def _flight_time(fields: Floats, distance: float, turn: float) -> tuple[float, int]:
    """The dt in which nothing flies further than `distance` or turns by more than `turn`."""
    speed, spin = extremes(fields, None)[:2]
    return min(
        (distance / speed if speed > 0.0 else np.inf, CFL_NUMBER),
        (turn / spin if spin > 0.0 else np.inf, ROTATION),
    )


class _Creeping:
    """What both schemes share: velocities follow from the drift at once."""

    order: int
    found = None

    def start(self, equation: SplitEquation) -> None:
        """Set the drift and the velocity that follows from it."""
        equation.evaluate_drift()
        settle(equation.fields, equation.drift, mobilities(equation.terms), 1.0, 0.0)

    def restore(self, equation: SplitEquation) -> None:
        """Nothing is kept."""

    def largest_step(self, equation: SplitEquation, cfl: float) -> tuple[float, int]:
        """From the fastest and the fastest turning cell."""
        turn = largest_turn(equation) if self.order > 1 else LARGEST_TURN
        return _flight_time(equation.fields, cfl * equation.cell, turn)


class CreepingEuler(_Creeping):
    """Scheme `paper`: FORCE in x, FORCE in y, implicit Euler for the angle; first order."""

    order = 1
    refuses = False

    def __init__(self) -> None:
        self._flux = Force(0.0)

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Always accepted: transport uses the velocities that the step was chosen for."""
        del count
        fields, sigma = equation.fields, mobilities(equation.terms)
        equation.transport(self._flux, dt, x_first=True)
        equation.evaluate_drift()
        turn_implicitly(fields, equation.drift, equation.terms, sigma[1], dt)
        settle(fields, equation.drift, sigma, 1.0, 0.0)
        return True


class CreepingHeun(_Creeping):
    """Scheme `accurate`: Heun's rule along the particles' ways; second order.

    A flight at the starting drift velocity, carried along with the mass, is followed by a short one
    that makes up for its change on the way,

        r_{n+1} = r_n + dt v_n + dt/2 (v* - v_n),        v* = sigma F at the first flight's end

    and the same for the angle. Both are ballistic, hence exact for the piecewise linear state.
    """

    order = 2
    refuses = True

    def step(self, equation: SplitEquation, dt: float, count: int) -> bool:
        """Refused if the correction is not small. Directions take turns (`count`)."""
        fields, sigma = equation.fields, mobilities(equation.terms)
        x_first = count % 2 == 0
        self._fly(equation, dt, x_first)
        equation.evaluate_drift()
        settle(fields, equation.drift, sigma, 0.5, 0.5)
        speed, spin = extremes(fields, None)[:2]
        if not max(speed / equation.cell, spin) * dt <= _LARGEST_CORRECTION:
            return False
        self._fly(equation, dt, not x_first)
        equation.evaluate_drift()
        settle(fields, equation.drift, sigma, 1.0, 0.0)
        return True

    def _fly(self, equation: SplitEquation, dt: float, x_first: bool) -> None:
        turn(equation.fields, dt)
        equation.transport(flight(equation, dt), dt, x_first)
