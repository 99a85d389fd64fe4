"""Ballistic transport: the exact motion of a pressureless, piecewise linear state, second order.

Without pressure every particle of a mono-kinetic state flies on at its own velocity, so over a step

    what crosses the upper face = what lies within the distance that flies across it

With linear profiles in a cell (xi in [-1/2, 1/2], c = dt/h, face values at xi = 1/2)

    rho(xi) = rho + drho xi          a(xi) = a + da (xi - xi_c),   xi_c = drho/(12 rho)

where a stands for a velocity or any other advected quantity and xi_c is the centre of mass (so that the
cell's rho a is kept), the depth that empties through the upper face and what it holds are

    sigma = c v_face / (1 + c dv),   mass = sigma (rho + drho m),   m = 1/2 - sigma/2
    int rho a = mass a(m) + da drho sigma^3/12

Slopes are limited (factor 2 for the density, 3/2 for the advected quantities, since a face is up to
2/3 from the centre of mass), so every new value is a mean of old ones with positive weights: the
density stays positive up to the CFL number 1, vacuum included, and advected quantities stay within
their neighbours' range, but at smooth extrema, which are not flattened. A cell beside vacuum takes its
slope from its other neighbour. The splitting into directions is exact, since a particle's velocity
does not change in flight.

An extremum of an advected quantity counts as smooth where it bends by less than a bound. The bound does
not depend on the quantity's own size, so that neither the zero of an angle nor a moving frame matters:
`bends_of_step` takes the bend that misplaces mass by a small part of a cell in a step, or turns it by
that part of a radian. On fine grids the part falls like h^2, as the bends of smooth data do (Shu's TVB
limiter), and with it the overshoot at a kink.

After F. Bouchut, "On zero pressure gas dynamics", 1994, van Leer's slopes, 1977, and C.-W. Shu, "TVB
uniformly high-order schemes for conservation laws", 1987.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.intrinsics import fma
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.rows import map_fields
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    ALONG,
    DENSITY,
    VACUUM,
    Stencil,
    register_flux,
)

ORDER = 2

DENSITY_LIMIT = 2.0
ADVECTED_LIMIT = 1.5
# An extremum that bends by less than this part - of the density, of a cell in a step, of a radian - is
# smooth and not flattened. Flattening costs an order: without pressure an error of the velocity becomes
# its derivative in the density. Grids of more cells than `_COARSE` along the domain's longer side, or of
# more angles, take a smaller part: second derivatives count up to 200, in units of that side.
_SMOOTH = 0.05
_COARSE = 64
# A factor: in strict floating point a division by 12 stays one.
TWELFTH = 1.0 / 12.0


class Ballistic(NamedTuple):
    """Ballistic transport; `largest_part` of a cell may leave in a step.

    bends : (K,) the bend up to which an extremum is smooth: of the density, as a part of it, and of each
    advected quantity in the flux's order, the velocity along the sweep first.
    """

    bends: Values
    largest_part: float = 1.0
    vacuum: float = VACUUM


class StepBends(NamedTuple):
    """The bends that are smooth in a step: of densities, relative, of angles, and of all speeds."""

    density: float
    angle: float
    speed: float


def smooth_part(cells: int) -> float:
    """The small part on a grid with `cells` along its longer side."""
    return _SMOOTH * min(1.0, (_COARSE / cells) ** 2)


def bends_of_step(part: float, cell: float, dt: float) -> StepBends:
    """Bends that misplace mass by this part of a cell, of width `cell`, or turn it by that of a radian."""
    return StepBends(part, part, part * cell / dt)


@inline_kernel
def limited(low: float, high: float, factor: float, bend: float) -> float:
    """The centred slope, limited to `factor` times the smaller one-sided difference (van Leer).

    An extremum is flattened unless it is smooth: bent by at most `bend`.
    """
    centred = 0.5 * (low + high)
    bound = factor * min(abs(low), abs(high)) if low * high > 0.0 else 0.0
    bound = abs(centred) if abs(high - low) <= bend else bound
    return math.copysign(min(abs(centred), bound), centred)


@inline_kernel
def advected_slope(
    before: float, here: float, after: float, empty_before: bool, empty_after: bool, bend: float
) -> float:
    """The limited slope of a advected quantity; one-sided beside vacuum, zero between two vacuums."""
    low = here - before
    high = after - here
    low = high if empty_before else low
    high = low if empty_after else high
    return 0.0 if empty_before and empty_after else limited(low, high, ADVECTED_LIMIT, bend)


@inline_kernel
def advected_outflow(
    masses: tuple[float, float],
    arms: tuple[float, float],
    inverse: tuple[float, float, float],
    below: float,
    here: float,
    above: float,
    bend: float,
) -> tuple[float, float]:
    """What leaves a cell of a advected quantity, upwards and downwards.

    masses : of what leaves; arms : how much of the slope leaves with it.
    """
    value = here * inverse[1]
    change = advected_slope(
        below * inverse[0], value, above * inverse[2], inverse[0] == 0.0, inverse[2] == 0.0, bend
    )
    return fma(masses[0], value, change * arms[0]), fma(masses[1], value, change * arms[1])


@inline_kernel
def ballistic_outflow(flux: Ballistic, stencil: Stencil, ratio: float) -> tuple[Values, Values]:
    """Ballistic transport of one cell; see contract.py."""
    below, here, above, inverse = stencil.below, stencil.here, stencil.above, stencil.inverse
    density = here[DENSITY]
    low, high = density - below[DENSITY], above[DENSITY] - density
    slope = limited(low, high, DENSITY_LIMIT, flux.bends[0] * density)
    # Distance of the centre of mass from the centre, times the density.
    twelfth = TWELFTH * slope
    centre = twelfth * inverse[1]
    # 1/rho comes from the sweep, once a cell: three cells look at each.
    v = here[ALONG] * inverse[1]
    dv = advected_slope(
        below[ALONG] * inverse[0],
        v,
        above[ALONG] * inverse[2],
        inverse[0] == 0.0,
        inverse[2] == 0.0,
        flux.bends[1],
    )
    # 1 + c dv > 0 up to the CFL number 1; the bound is for states that the step control then refuses.
    stretch = ratio / max(fma(ratio, dv, 1.0), 0.1)
    upper = min(max(stretch * fma(dv, 0.5 - centre, v), 0.0), flux.largest_part)
    lower = min(max(-stretch * fma(dv, -0.5 - centre, v), 0.0), flux.largest_part)
    # No cell gives more than it holds, also where it empties through both faces.
    lower = min(lower, 1.0 - upper)
    middle_up, middle_down = fma(-0.5, upper, 0.5), fma(-0.5, lower, 0.5)
    up = upper * fma(slope, middle_up, density)
    down = lower * fma(-slope, middle_down, density)
    # The slope's part of what leaves: the strip's centre against the cell's centre of mass, and
    # sigma^3/12.
    arm_up = fma(twelfth, upper * upper * upper, up * (middle_up - centre))
    arm_down = fma(twelfth, lower * lower * lower, -down * (middle_down + centre))
    advected_up, advected_down = map_fields(
        advected_outflow,
        ((up, down), (arm_up, arm_down), inverse),
        (below[1:], here[1:], above[1:], flux.bends[1:]),
    )
    return (up, *advected_up), (down, *advected_down)


register_flux(Ballistic, ballistic_outflow)
