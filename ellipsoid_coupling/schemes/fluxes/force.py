"""FORCE (first-order centred), the flux of the paper; Toro, Riemann solvers, 3rd ed., section 7.4.2.

    F_FORCE = (F_LF + F_R)/2
    F_LF    = (F(U_L) + F(U_R))/2 - h/(2 dt) (U_R - U_L)
    F_R     = F(U*),   U* = (U_L + U_R)/2 - dt/(2 h) (F(U_R) - F(U_L))

with the physical flux of physics/closure.py. Stable for a CFL number up to 1; the density stays
positive there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import inline_kernel
from ellipsoid_coupling.schemes.fluxes.contract import DENSITY, VACUUM, Span, register_flux

Floats = NDArray[np.float64]

ORDER = 1


class Force(NamedTuple):
    """FORCE for the closure with this pressure coefficient."""

    pressure: float
    vacuum: float = VACUUM


@inline_kernel
def _velocity(momentum: float, density: float, vacuum: float) -> float:
    return momentum / density if density > vacuum else 0.0


def force_outflow(
    flux: Force,
    fields: Floats,
    span: Span,
    ratio: float,
    up: Floats,
    down: Floats,
    work: Floats,
) -> None:
    """`outflow` by FORCE; see contract.py."""
    start, width, stride, normal = span
    pressure = flux.pressure
    for i in range(width):
        p = start + i
        q = p + stride
        density_l, density_r = fields[DENSITY, p], fields[DENSITY, q]
        momentum_l, momentum_r = fields[normal, p], fields[normal, q]
        v_l = _velocity(momentum_l, density_l, flux.vacuum)
        v_r = _velocity(momentum_r, density_r, flux.vacuum)
        middle_density = 0.5 * (density_l + density_r) - 0.5 * ratio * (momentum_r - momentum_l)
        rise = momentum_r * v_r - momentum_l * v_l + pressure * (density_r - density_l)
        middle_momentum = 0.5 * (momentum_l + momentum_r) - 0.5 * ratio * rise
        work[0, i] = v_l
        work[1, i] = v_r
        work[2, i] = _velocity(middle_momentum, middle_density, flux.vacuum)
        work[3, i] = pressure * (density_l + density_r)
        work[4, i] = pressure * middle_density
        work[5, i] = pressure * (density_r - density_l)
    for k in range(fields.shape[0]):
        pressed = 1.0 if k == normal else 0.0
        for i in range(width):
            left, right = fields[k, start + i], fields[k, start + i + stride]
            flux_l, flux_r = work[0, i] * left, work[1, i] * right
            friedrichs = 0.5 * (flux_l + flux_r + pressed * work[3, i]) - 0.5 / ratio * (
                right - left
            )
            rise = flux_r - flux_l + pressed * work[5, i]
            middle = 0.5 * (left + right) - 0.5 * ratio * rise
            richtmyer = work[2, i] * middle + pressed * work[4, i]
            up[k, i] = 0.5 * ratio * (friedrichs + richtmyer)
            down[k, i] = 0.0


register_flux(Force, force_outflow)
