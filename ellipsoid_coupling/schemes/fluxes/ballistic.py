"""Ballistic transport: the exact motion of a pressureless, piecewise linear state, second order.

Without pressure every particle of a mono-kinetic state flies on at its own velocity, so over a step

    what crosses the upper face = what lies within the distance that flies across it

With linear profiles in a cell (xi in [-1/2, 1/2], c = dt/h, face values at xi = 1/2)

    rho(xi) = rho + drho xi          a(xi) = a + da (xi - xi_c),   xi_c = drho/(12 rho)

where a stands for a velocity or any other carried quantity and xi_c is the centre of mass (so that the
cell's rho a is kept), the depth that empties through the upper face and what it holds are

    sigma = c v_face / (1 + c dv),   mass = sigma (rho + drho m),   m = 1/2 - sigma/2
    int rho a = mass a(m) + da drho sigma^3/12

Slopes are limited (factor 2 for the density, 3/2 for the carried quantities, since a face is up to
2/3 from the centre of mass), so every new value is a mean of old ones with positive weights: the
density stays positive up to the CFL number 1, vacuum included, and carried quantities stay within
their neighbours' range (2 % beyond it at smooth extrema, which are not flattened). A cell beside
vacuum takes its slope from its other neighbour. The splitting into directions is exact, since a
particle's velocity does not change in flight.

After F. Bouchut, "On zero pressure gas dynamics", 1994, and van Leer's slopes, 1977.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.kernels import inline_kernel
from ellipsoid_coupling.schemes.fluxes.contract import (
    DENSITY,
    VACUUM,
    Inverse,
    Span,
    around,
    register_flux,
)

Floats = NDArray[np.float64]

ORDER = 2

_DENSITY_LIMIT = 2.0
_CARRIED_LIMIT = 1.5
# An extremum that bends by less than this part of the value is smooth, and kept. Flattening it would
# cost an order: without pressure an error of the velocity becomes its derivative in the density.
_SMOOTH = 0.05
# A factor: in strict floating point a division by 12 stays one.
_TWELFTH = 1.0 / 12.0


class Ballistic(NamedTuple):
    """Ballistic transport; `largest_part` of a cell may leave in a step."""

    largest_part: float = 1.0
    vacuum: float = VACUUM


@inline_kernel
def limited(low: float, high: float, factor: float, size: float) -> float:
    """The centred slope, limited to `factor` times the smaller one-sided difference (van Leer).

    An extremum is flattened unless it is smooth: bent by less than a small part of `size`.
    """
    centred = 0.5 * (low + high)
    bound = factor * min(abs(low), abs(high)) if low * high > 0.0 else 0.0
    bound = abs(centred) if abs(high - low) <= _SMOOTH * size else bound
    return math.copysign(min(abs(centred), bound), centred)


@inline_kernel
def _carried_slope(
    before: float, here: float, after: float, empty_before: bool, empty_after: bool
) -> float:
    """The limited slope of a carried quantity; one-sided beside vacuum, zero between two vacuums."""
    low = here - before
    high = after - here
    low = high if empty_before else low
    high = low if empty_after else high
    size = max(abs(before), abs(here), abs(after))
    return 0.0 if empty_before and empty_after else limited(low, high, _CARRIED_LIMIT, size)


def ballistic_outflow(
    flux: Ballistic,
    fields: Floats,
    span: Span,
    inverse: Inverse,
    ratio: float,
    up: Floats,
    down: Floats,
    work: Floats,
) -> None:
    """`outflow` by ballistic transport; see contract.py."""
    width, normal = span.width, span.normal
    densities, above_it, below_it = around(fields, DENSITY, span)
    momenta, momenta_above, momenta_below = around(fields, normal, span)
    for i in range(width):
        before, here, after = below_it[i], densities[i], above_it[i]
        slope = limited(here - before, after - here, _DENSITY_LIMIT, here)
        own = inverse.here[i]
        twelfth = _TWELFTH * slope
        centre = twelfth * own
        v = momenta[i] * own
        dv = _carried_slope(
            momenta_below[i] * inverse.below[i],
            v,
            momenta_above[i] * inverse.above[i],
            inverse.below[i] == 0.0,
            inverse.above[i] == 0.0,
        )
        stretch = 1.0 / max(1.0 + ratio * dv, 0.1)
        above = min(max(ratio * (v + dv * (0.5 - centre)) * stretch, 0.0), flux.largest_part)
        below = min(max(-ratio * (v - dv * (0.5 + centre)) * stretch, 0.0), flux.largest_part)
        below = min(below, 1.0 - above)
        work[0, i] = above
        work[1, i] = below
        work[2, i] = twelfth
        up[DENSITY, i] = above * (here + slope * (0.5 - 0.5 * above))
        down[DENSITY, i] = below * (here - slope * (0.5 - 0.5 * below))
    for k in range(1, fields.shape[0]):
        contents, contents_above, contents_below = around(fields, k, span)
        for i in range(width):
            value = contents[i] * inverse.here[i]
            change = _carried_slope(
                contents_below[i] * inverse.below[i],
                value,
                contents_above[i] * inverse.above[i],
                inverse.below[i] == 0.0,
                inverse.above[i] == 0.0,
            )
            above, below, twelfth = work[0, i], work[1, i], work[2, i]
            centre = twelfth * inverse.here[i]
            bend = change * twelfth
            up[k, i] = (
                up[DENSITY, i] * (value + change * (0.5 - 0.5 * above - centre)) + bend * above**3
            )
            down[k, i] = (
                down[DENSITY, i] * (value - change * (0.5 - 0.5 * below + centre)) + bend * below**3
            )


register_flux(Ballistic, ballistic_outflow)
