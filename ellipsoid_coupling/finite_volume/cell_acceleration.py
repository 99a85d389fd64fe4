"""What drives a cell: fluid, outer potentials, interaction and walls.

    F     = gamma u - grad V1 + force/m
    F_bar = gamma_bar g - dV2/dtheta + torque/I_c,    g = a + b sin 2 theta + c cos 2 theta

Each part is a row of no numbers where the scene does not have it, so that a loop over cells does not
have it either.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import (
    Values,
    add,
    axpy,
    fill,
    scale,
    total,
)
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.external import sine_torque

Floats = NDArray[np.float64]


class CellTerms(NamedTuple):
    """What drives a cell, made once; None where the scene does not have it.

    Attributes
    ----------
    steady : (2, ny, nx) float64 or None
        gamma u - grad V1.
    turning : (3, ny, nx) or None
        gamma_bar times the three coefficients of Jeffery's term g = a + b sin 2 phi + c cos 2 phi.
    amplitude : float or None
        Of V2.
    damping, angular_damping : float
        gamma + A^2/2, gamma_bar + B^2/2.
    inverse_mass, inverse_inertia : float
    """

    steady: Floats | None
    turning: Floats | None
    amplitude: float | None
    damping: float
    angular_damping: float
    inverse_mass: float
    inverse_inertia: float


class NoForces(NamedTuple):
    """Takes the place of forces where there is no interaction."""

    x: None = None
    y: None = None
    torque: None = None


@kernel
def angular_rate(
    turning: Floats | None, amplitude: float | None, j: int, i: int, angle: float
) -> tuple[float, float]:
    """gamma_bar g - dV2/dtheta and its derivative with respect to the angle."""
    rate, slope = 0.0, 0.0
    if turning is not None:
        c2, s2 = cos_sin(2.0 * angle)
        rate += turning[0, j, i] + turning[1, j, i] * s2 + turning[2, j, i] * c2
        slope += 2.0 * (turning[1, j, i] * c2 - turning[2, j, i] * s2)
    if amplitude is not None:
        rate += sine_torque(angle, amplitude)
        slope += amplitude * cos_sin(angle)[1]
    return rate, slope


class Drive(NamedTuple):
    """What drives a run of cells, rows of one or none each; see `drive_at`."""

    steady: tuple[Rows, Rows]
    force: tuple[Rows, Rows]
    torque: Rows
    turning: tuple[Rows, Rows, Rows]
    inverse_mass: float
    inverse_inertia: float


@inline_kernel
def drive_at(terms: CellTerms, forces: Any, place: tuple[int, int, int], force_row: int) -> Drive:
    """What drives the cells of row j of ny from column `first` on: place = (j, ny, first).

    forces : Forces, AngleForces or NoForces, whose row is `force_row`, counted through all angles.
    """
    j, ny, first = place
    row = (force_row,)
    return Drive(
        (rows_at(terms.steady, (j,), first), rows_at(terms.steady, (ny + j,), first)),
        (rows_at(forces.x, row, first), rows_at(forces.y, row, first)),
        rows_at(forces.torque, row, first),
        (
            rows_at(terms.turning, (j,), first),
            rows_at(terms.turning, (ny + j,), first),
            rows_at(terms.turning, (2 * ny + j,), first),
        ),
        terms.inverse_mass,
        terms.inverse_inertia,
    )


@kernel
def outer_torque(amplitude: float | None, angle: float) -> float:
    """-dV2/dtheta; 0 without V2."""
    return 0.0 if amplitude is None else sine_torque(angle, amplitude)


@inline_kernel
def driven(
    drive: Drive, i: int, double: tuple[float, float], outer: float, spins: Values
) -> Values:
    """F_x, F_y and, where there are `spins` (one or none), F_bar of cell i of a run.

    double : cos 2 theta and sin 2 theta; outer : -dV2/dtheta.
    """
    x = total(load(drive.steady[0], i) + scale(drive.inverse_mass, load(drive.force[0], i)))
    y = total(load(drive.steady[1], i) + scale(drive.inverse_mass, load(drive.force[1], i)))
    a, b, c = load(drive.turning[0], i), load(drive.turning[1], i), load(drive.turning[2], i)
    torque = scale(drive.inverse_inertia, load(drive.torque, i))
    c2, s2 = double
    turn = total(add(axpy(b, s2, a), scale(c2, c)) + torque) + outer
    return (x, y, *fill(turn, spins))
