"""The implicit Euler step of a carried angle, an equation for each cell, which Newton solves."""

from __future__ import annotations

import numba

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms, angular_rate
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.finite_volume.sources import Cells

# Newton's iteration for the angle converges quadratically from a guess that is dt^2 off.
_NEWTON_STEPS = 4


def turn_implicitly(cells: Cells, terms: CellTerms, gain: float, dt: float) -> None:
    """Turn phi by one implicit Euler step, in place; the paper's treatment, after an implicit kick.

        phi1 = phi + dt omega1,  omega1 = omega + gain (R(phi1) - R(phi))

    omega is what the kick made of the drift at the old angle. R are the torques that are known as
    functions of the angle, those of fluid and V2; the torque of the interaction is that of the old one.

    gain : of omega, that of the kick
    """
    _turn_rows(cells.extents.shape[1], (cells, terms, (gain, dt)))


@parallel_kernel
def _turn_rows(rows: int, arguments: tuple[Cells, CellTerms, tuple[float, float]]) -> None:
    packed = pack(arguments)
    for j in numba.prange(rows):
        cells, terms, step = unpack(packed)
        _turn_row(signed(j), cells, terms, step)


@kernel
def _turn_row(j: int, cells: Cells, terms: CellTerms, step: tuple[float, float]) -> None:
    fields, angle, spin = cells.fields, cells.angle[0], cells.spin[0]
    for i in range(fields.shape[3] - 2 * GHOSTS):
        # An r-grid has one plane, and no ghosts of the angle.
        p, q = j + GHOSTS, i + GHOSTS
        rho = fields[0, 0, p, q]
        if rho > 0.0:
            phi, omega = fields[angle, 0, p, q] / rho, fields[spin, 0, p, q] / rho
            new = _implicit_spin(phi, omega, terms, (j, i), step)
            fields[spin, 0, p, q] = rho * new
            # phi1 = phi + dt omega1, times rho.
            fields[angle, 0, p, q] += step[1] * rho * new


@kernel
def _implicit_spin(
    angle: float,
    spin: float,
    terms: CellTerms,
    cell: tuple[int, int],
    step: tuple[float, float],
) -> float:
    """Omega1 of one cell, for the step (gain, dt)."""
    j, i = cell
    gain, dt = step
    # In omega these torques count at the old angle already, by the kick: only their change is new.
    old, _ = angular_rate(terms.turning, terms.angular, j, i, angle)
    new = spin
    for _ in range(_NEWTON_STEPS):
        rate, slope = angular_rate(terms.turning, terms.angular, j, i, angle + dt * new)
        # The denominator is the derivative for omega1, by way of phi1.
        new -= (new - spin - gain * (rate - old)) / (1.0 - gain * dt * slope)
    return new
