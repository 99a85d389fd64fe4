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

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.intrinsics import fused
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.rows import map_fields
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    ALONG,
    DENSITY,
    VACUUM,
    Stencil,
    register_face_flux,
)

ORDER = 1


class Force(NamedTuple):
    """FORCE for the closure with this pressure coefficient."""

    pressure: float
    vacuum: float = VACUUM


@inline_kernel
def _mixed(weight_l: float, weight_r: float, left: float, right: float) -> float:
    """w_L U_L + w_R U_R."""
    return fused(weight_l, left, weight_r * right)


@inline_kernel
def force_flux(flux: Force, stencil: Stencil, ratio: float) -> Values:
    """FORCE between `below` (left) and `here` (right); see contract.py."""
    left, right, half = stencil.below, stencil.here, 0.5 * ratio
    thin, thick = left[DENSITY], right[DENSITY]
    slow, fast = left[ALONG], right[ALONG]
    v_l, v_r = slow * stencil.inverse[0], fast * stencil.inverse[1]
    middle_density = 0.5 * (thin + thick) - half * (fast - slow)
    rise = fast * v_r - slow * v_l + flux.pressure * (thick - thin)
    middle_momentum = 0.5 * (slow + fast) - half * rise
    middle_v = half * middle_momentum / middle_density if middle_density > flux.vacuum else 0.0
    part_l, part_r = half * v_l, half * v_r
    weight_l = fused(middle_v, 0.5 + part_l, fused(0.5, part_l, 0.25))
    weight_r = fused(middle_v, 0.5 - part_r, fused(0.5, part_r, -0.25))
    carried: Values = map_fields(_mixed, (weight_l, weight_r), (left, right))
    pressed = (half * flux.pressure) * (
        0.5 * (thin + thick) + middle_density - middle_v * (thick - thin)
    )
    return (carried[DENSITY], carried[ALONG] + pressed, *carried[2:])


register_face_flux(Force, force_flux)
