"""The drift of `eq:micro` in cells: `physics.drift` at their centres, interaction and walls.

    F     = gamma u - grad V1 + force/m
    F_bar = gamma_bar g - dV2/dtheta + torque/I_c,    g = a + b sin 2 theta + c cos 2 theta

What does not depend on the angle is tabulated once (`cell_tables`). A missing term is an empty tuple of
rows; the compiler removes it from the loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import (
    Values,
    fill,
    scale,
    total,
)
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.compiled.rows import Rows, load, map_fields, rows_at
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.interaction.q_grid import AngleForces
from ellipsoid_coupling.physics.angular import outer_torque, outer_torque_slope
from ellipsoid_coupling.physics.drift import External, Fluid, external_terms
from ellipsoid_coupling.physics.elementary import cos_sin
from ellipsoid_coupling.physics.jeffery import jeffery_rate, jeffery_slope
from ellipsoid_coupling.scenes.kinds import Record

Floats = NDArray[np.float64]


class CellTerms(NamedTuple):
    """What drives a cell, made once; None where the scene does not have it.

    Attributes
    ----------
    steady : (2, ny, nx) float64 or None
        gamma u - grad V1.
    turning : (3, ny, nx) or None
        gamma_bar times the three coefficients of Jeffery's term g = a + b sin 2 phi + c cos 2 phi.
    angular : record or None
        V2, see `physics.angular`.
    damping, angular_damping : float
        gamma + A^2/2, gamma_bar + B^2/2.
    inverse_mass, inverse_inertia : float
    in_fluid : bool
        Whether a fluid drags along what is in the cells.
    """

    steady: Floats | None
    turning: Floats | None
    angular: Record | None
    damping: float
    angular_damping: float
    inverse_mass: float
    inverse_inertia: float
    in_fluid: bool = False


class NoForces(NamedTuple):
    """Takes the place of forces where there is no interaction."""

    x: None = None
    y: None = None
    torque: None = None


@kernel
def _set_tables(
    fluid: Fluid | None,
    outer: Record | None,
    t: float,
    x: Floats,
    y: Floats,
    steady: Floats,
    turning: Floats,
) -> None:
    for j in range(y.size):
        for i in range(x.size):
            force_x, force_y, coefficients = external_terms(fluid, outer, t, x[i], y[j])
            steady[0, j, i], steady[1, j, i] = force_x, force_y
            # Coefficients and not g itself: a cell's angle changes, its place does not.
            for k in range(3):
                turning[k, j, i] = coefficients[k]


def cell_tables(external: External, t: float, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """The drift at the centres x (nx,) and y (ny,) of cells at time t, whatever their angle.

    Returns
    -------
    steady : (2, ny, nx) float64
        gamma u - grad V1.
    turning : (3, ny, nx)
        gamma_bar (a, b, c) of Jeffery's term.
    """
    steady, turning = np.empty((2, y.size, x.size)), np.empty((3, y.size, x.size))
    _set_tables(external.fluid, external.outer, t, x, y, steady, turning)
    return steady, turning


@kernel
def angular_rate(
    turning: Floats | None, angular: Record | None, j: int, i: int, angle: float
) -> tuple[float, float]:
    """gamma_bar g - dV2/dtheta and its derivative with respect to the angle."""
    rate, slope = outer_torque(angular, angle), outer_torque_slope(angular, angle)
    if turning is not None:
        c2, s2 = cos_sin(2.0 * angle)
        # gamma_bar is in the coefficients already. The slope is for Newton's method, see `implicit_turn`.
        a, b, c = turning[0, j, i], turning[1, j, i], turning[2, j, i]
        rate += jeffery_rate(c2, s2, a, b, c)
        slope += jeffery_slope(c2, s2, b, c)
    return rate, slope


@kernel
def largest_outer_torque(angular: Record | None, angles: Floats) -> float:
    """The largest |dV2/dtheta| at some angles (n,); 0 without V2."""
    largest = 0.0
    for angle in angles:
        largest = max(largest, abs(outer_torque(angular, angle)))
    return largest


AnyForces = Forces | AngleForces | NoForces


class Drive(NamedTuple):
    """What drives a run of cells, rows of one or none each; see `drive_at`."""

    steady: tuple[Rows, Rows]
    force: tuple[Rows, Rows]
    torque: Rows
    turning: tuple[Rows, Rows, Rows]
    inverse_mass: float
    inverse_inertia: float


@inline_kernel
def drive_at(
    terms: CellTerms, forces: AnyForces, place: tuple[int, int, int], force_row: int
) -> Drive:
    """What drives the cells of row j of ny from column `first` on: place = (j, ny, first).

    forces : Forces, AngleForces or NoForces, whose row is `force_row`, counted through all angles.
    """
    # Tables are flat here: those of the second component begin `ny` rows further on.
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


@inline_kernel
def driven(
    drive: Drive, i: int, double: tuple[float, float], outer: float, spins: Values
) -> Values:
    """F_x, F_y and, where there are `spins` (one or none), F_bar of cell i of a run.

    double : cos 2 theta and sin 2 theta; outer : -dV2/dtheta.
    """
    # `+` sets tuples side by side and `total` adds up what they hold: one number, or none where the
    # scene has no such term. So a missing term costs no instruction, and not even a 0 is added.
    x = total(load(drive.steady[0], i) + scale(drive.inverse_mass, load(drive.force[0], i)))
    y = total(load(drive.steady[1], i) + scale(drive.inverse_mass, load(drive.force[1], i)))
    a, b, c = load(drive.turning[0], i), load(drive.turning[1], i), load(drive.turning[2], i)
    torque = scale(drive.inverse_inertia, load(drive.torque, i))
    # g = a + b sin 2 theta + c cos 2 theta, of no coefficients no number.
    turn = total(map_fields(jeffery_rate, double, (a, b, c)) + torque) + outer
    return (x, y, *fill(turn, spins))
