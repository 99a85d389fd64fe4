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
from ellipsoid_coupling.schemes.fluxes.contract import DENSITY, VACUUM, Span, register_flux, run_of

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
    pressure, vacuum, half = flux.pressure, flux.vacuum, 0.5 * ratio
    density_l = run_of(fields, DENSITY, start, width)
    density_r = run_of(fields, DENSITY, start + stride, width)
    momentum_l = run_of(fields, normal, start, width)
    momentum_r = run_of(fields, normal, start + stride, width)
    for i in range(width):
        thin, thick = density_l[i], density_r[i]
        slow, fast = momentum_l[i], momentum_r[i]
        v_l = _velocity(slow, thin, vacuum)
        v_r = _velocity(fast, thick, vacuum)
        middle_density = 0.5 * (thin + thick) - half * (fast - slow)
        rise = fast * v_r - slow * v_l + pressure * (thick - thin)
        middle_momentum = 0.5 * (slow + fast) - half * rise
        work[0, i] = v_l
        work[1, i] = v_r
        work[2, i] = _velocity(middle_momentum, middle_density, vacuum)
        work[3, i] = pressure * (thin + thick)
        work[4, i] = pressure * middle_density
        work[5, i] = pressure * (thick - thin)
    for k in range(fields.shape[0]):
        pressed = 1.0 if k == normal else 0.0
        lefts = run_of(fields, k, start, width)
        rights = run_of(fields, k, start + stride, width)
        for i in range(width):
            left, right = lefts[i], rights[i]
            flux_l, flux_r = work[0, i] * left, work[1, i] * right
            friedrichs = 0.5 * (flux_l + flux_r + pressed * work[3, i]) - 0.5 / ratio * (
                right - left
            )
            rise = flux_r - flux_l + pressed * work[5, i]
            middle = 0.5 * (left + right) - half * rise
            richtmyer = work[2, i] * middle + pressed * work[4, i]
            up[k, i] = half * (friedrichs + richtmyer)
            down[k, i] = 0.0


register_flux(Force, force_outflow)
