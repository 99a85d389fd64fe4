"""FORCE (first-order centred), the flux of the paper; Toro, Riemann solvers, 3rd ed., section 7.4.2.

    F_FORCE = (F_LF + F_R)/2
    F_LF    = (F(U_L) + F(U_R))/2 - h/(2 dt) (U_R - U_L)
    F_R     = F(U*),   U* = (U_L + U_R)/2 - dt/(2 h) (F(U_R) - F(U_L))

with the physical flux of physics/closure.py. Where a velocity carries all of a flux, F(U) = v U,

    dt/h F_FORCE = w_L U_L + w_R U_R       c = dt/(2 h)
    w_L =  1/4 + c v_L/2 + c v* (1/2 + c v_L)
    w_R = -1/4 + c v_R/2 + c v* (1/2 - c v_R)

alike for all fields; pressure adds to the momentum along the direction only. Stable for a CFL number
up to 1; the density stays positive there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.instructions import fused
from ellipsoid_coupling.schemes.fluxes.contract import (
    DENSITY,
    VACUUM,
    Inverse,
    Span,
    register_flux,
    run_of,
)

Floats = NDArray[np.float64]

ORDER = 1


class Force(NamedTuple):
    """FORCE for the closure with this pressure coefficient."""

    pressure: float
    vacuum: float = VACUUM


def force_outflow(
    flux: Force,
    fields: Floats,
    span: Span,
    inverse: Inverse,
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
    weight_l, weight_r, pressed = work[0], work[1], down[0]
    for i in range(width):
        thin, thick = density_l[i], density_r[i]
        slow, fast = momentum_l[i], momentum_r[i]
        v_l = slow * inverse.here[i]
        v_r = fast * inverse.above[i]
        middle_density = 0.5 * (thin + thick) - half * (fast - slow)
        rise = fast * v_r - slow * v_l + pressure * (thick - thin)
        middle_momentum = 0.5 * (slow + fast) - half * rise
        middle_v = half * middle_momentum / middle_density if middle_density > vacuum else 0.0
        part_l, part_r = half * v_l, half * v_r
        weight_l[i] = fused(middle_v, 0.5 + part_l, fused(0.5, part_l, 0.25))
        weight_r[i] = fused(middle_v, 0.5 - part_r, fused(0.5, part_r, -0.25))
        pressed[i] = (half * pressure) * (
            0.5 * (thin + thick) + middle_density - middle_v * (thick - thin)
        )
    for k in range(fields.shape[0]):
        lefts = run_of(fields, k, start, width)
        rights = run_of(fields, k, start + stride, width)
        through = up[k]
        for i in range(width):
            through[i] = fused(weight_l[i], lefts[i], weight_r[i] * rights[i])
        if k == normal and pressure > 0.0:
            for i in range(width):
                through[i] += pressed[i]


register_flux(Force, force_outflow, faces=True)
