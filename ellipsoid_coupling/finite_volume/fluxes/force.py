"""FORCE (first-order centred), the flux of the paper; Toro, Riemann solvers, 3rd ed., section 7.4.2.

    F_FORCE = (F_LF + F_R)/2
    F_LF    = (F(U_L) + F(U_R))/2 - h/(2 dt) (U_R - U_L)
    F_R     = F(U*),   U* = (U_L + U_R)/2 - dt/(2 h) (F(U_R) - F(U_L))

with the physical flux of physics/closure.py and its pressure P(U). Where a velocity carries all of a
flux, F(U) = v U,

    dt/h F_FORCE = w_L U_L + w_R U_R       c = dt/(2 h)
    w_L =  1/4 + c v_L/2 + c v* (1/2 + c v_L)
    w_R = -1/4 + c v_R/2 + c v* (1/2 - c v_R)

alike for all fields; pressure adds to the momentum along the direction only,

    dt/(2 h) ((P_L + P_R)/2 + P(U*) - v* (P_R - P_L))

Stable for a CFL number
up to 1; the density stays positive there.
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values, add, fused_axpy, scale, sub
from ellipsoid_coupling.compiled.intrinsics import fma
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    ALONG,
    DENSITY,
    VACUUM,
    Stencil,
    register_face_flux,
)
from ellipsoid_coupling.physics.closure import Pressure, cell_pressure

ORDER = 1


class Force(NamedTuple):
    """FORCE for the closure with this pressure."""

    pressure: Pressure
    vacuum: float = VACUUM


@inline_kernel
def force_flux(flux: Force, stencil: Stencil, ratio: float) -> Values:
    """FORCE between `below` (left) and `here` (right); see contract.py."""
    left, right, half = stencil.below, stencil.here, 0.5 * ratio
    rho_l, rho_r = left[DENSITY], right[DENSITY]
    m_l, m_r = left[ALONG], right[ALONG]
    v_l, v_r = m_l * stencil.inverse[0], m_r * stencil.inverse[1]
    push_l, push_r = cell_pressure(flux.pressure, left), cell_pressure(flux.pressure, right)
    middle_density = 0.5 * (rho_l + rho_r) - half * (m_r - m_l)
    # F of the momentum is m v + P.
    rise = m_r * v_r - m_l * v_l + (push_r - push_l)
    middle_momentum = 0.5 * (m_l + m_r) - half * rise
    # Beside vacuum U* may be empty; it has no velocity then.
    middle_v = half * middle_momentum / middle_density if middle_density > flux.vacuum else 0.0
    # U* of all else is there for pressures that ask for it.
    rises = sub(scale(v_r, right[2:]), scale(v_l, left[2:]))
    means = scale(0.5, add(left[2:], right[2:]))
    middle = (middle_density, middle_momentum, *sub(means, scale(half, rises)))
    # c v_L and c v_R; `middle_v` is c v* already.
    part_l, part_r = half * v_l, half * v_r
    weight_l = fma(middle_v, 0.5 + part_l, fma(0.5, part_l, 0.25))
    weight_r = fma(middle_v, 0.5 - part_r, fma(0.5, part_r, -0.25))
    # Alike for all components: w_L U_L + w_R U_R.
    advected = fused_axpy(weight_l, left, scale(weight_r, right))
    mean_push = 0.5 * (push_l + push_r) + cell_pressure(flux.pressure, middle)
    pressure_part = half * (mean_push - middle_v * (push_r - push_l))
    return (advected[DENSITY], advected[ALONG] + pressure_part, *advected[2:])


register_face_flux(Force, force_flux)
