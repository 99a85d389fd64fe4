"""Velocity and gradient from the slopes of psi and, where a flow has sources, of chi.

    u = (d psi/dy, -d psi/dx) + (d chi/dx, d chi/dy)

Both have the same nodes. The coefficients of chi stand below those of psi in one array, so that whoever
keeps or blends coefficients need not know of them. A flow without sources has none, and kernels for it are
compiled without chi.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.dispatch import chosen_by_type, register_formula
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.rows import element

Array = NDArray[np.float64]
# f_x, f_y, f_xx, f_xy, f_yy
Slopes = tuple[float, float, float, float, float]
Pair = tuple[float, float]


class Chi(NamedTuple):
    """Of a flow with sources: the row of its coefficients at which those of chi begin."""

    row: int


@inline_kernel
def _row(
    c: Array, first: int, t: float, s: float, weights: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Value, slope and curvature along x (per cell) of four coefficients in a row; s = 1 - t."""
    c0, c1 = element(c, first), element(c, first + 1)
    c2, c3 = element(c, first + 2), element(c, first + 3)
    value = weights[0] * c0 + weights[1] * c1 + weights[2] * c2 + weights[3] * c3
    # Derivatives of a B-spline are B-splines of the differences: fewer operations, same rounding.
    d0, d1, d2 = c1 - c0, c2 - c1, c3 - c2
    slope = 0.5 * s * s * d0 + (0.5 + t * s) * d1 + 0.5 * t * t * d2
    curvature = s * (d1 - d0) + t * (d2 - d1)
    return value, slope, curvature


@inline_kernel
def slopes(c: Array, first: int, place: Pair, per: Pair) -> Slopes:
    """The slopes of a spline within one cell.

    first : the flat index of the cell's first coefficient
    place : where in the cell, from 0 to 1, along x and y
    per : cells per unit length, along x and y
    """
    t, r = place
    gx, gy = per
    s, q = 1.0 - t, 1.0 - r
    # Weights of the uniform cubic B-spline in x, the outer and the inner two.
    inner = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t), 2.0 / 3.0 - s * s * (1.0 - 0.5 * s)
    weights = s * s * s / 6.0, inner[0], inner[1], t * t * t / 6.0
    row = c.shape[1]
    v0, m0, k0 = _row(c, first, t, s, weights)
    v1, m1, k1 = _row(c, first + row, t, s, weights)
    v2, m2, k2 = _row(c, first + 2 * row, t, s, weights)
    v3, m3, k3 = _row(c, first + 3 * row, t, s, weights)
    w0, w3 = q * q * q / 6.0, r * r * r / 6.0
    w1, w2 = 2.0 / 3.0 - r * r * (1.0 - 0.5 * r), 2.0 / 3.0 - q * q * (1.0 - 0.5 * q)
    e0, e1, e2 = 0.5 * q * q, 0.5 + r * q, 0.5 * r * r
    f_x = gx * (w0 * m0 + w1 * m1 + w2 * m2 + w3 * m3)
    f_y = gy * (e0 * (v1 - v0) + e1 * (v2 - v1) + e2 * (v3 - v2))
    f_xx = gx * gx * (w0 * k0 + w1 * k1 + w2 * k2 + w3 * k3)
    f_xy = gx * gy * (e0 * (m1 - m0) + e1 * (m2 - m1) + e2 * (m3 - m2))
    f_yy = gy * gy * (q * (v2 - 2.0 * v1 + v0) + r * (v3 - 2.0 * v2 + v1))
    return f_x, f_y, f_xx, f_xy, f_yy


@chosen_by_type
def velocity_of(
    chi: Chi | None, psi: Slopes, c: Array, first: int, place: Pair, per: Pair
) -> Slopes:
    """(ux, uy, stretch, dux_dy, duy_dx) from the slopes of psi; the rest as `slopes`.

    The stretch (dux_dx - duy_dy)/2 is dux_dx where the flow has no sources; Jeffery's term takes no more.
    """
    raise NotImplementedError


@inline_kernel
def _of_psi(
    chi: None,  # noqa: ARG001 (of the contract, as all that follow but psi)
    psi: Slopes,
    c: Array,  # noqa: ARG001
    first: int,  # noqa: ARG001
    place: Pair,  # noqa: ARG001
    per: Pair,  # noqa: ARG001
) -> Slopes:
    psi_x, psi_y, psi_xx, psi_xy, psi_yy = psi
    return psi_y, -psi_x, psi_xy, psi_yy, -psi_xx


@inline_kernel
def _of_both(chi: Chi, psi: Slopes, c: Array, first: int, place: Pair, per: Pair) -> Slopes:
    psi_x, psi_y, psi_xx, psi_xy, psi_yy = psi
    chi_x, chi_y, chi_xx, chi_xy, chi_yy = slopes(c, first + chi.row * c.shape[1], place, per)
    return (
        psi_y + chi_x,
        chi_y - psi_x,
        psi_xy + 0.5 * (chi_xx - chi_yy),
        psi_yy + chi_xy,
        chi_xy - psi_xx,
    )


register_formula(velocity_of, type(None), _of_psi)
register_formula(velocity_of, Chi, _of_both)
