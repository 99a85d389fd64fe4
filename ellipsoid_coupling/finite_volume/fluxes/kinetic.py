"""Kinetic flux for the Maxwellian closure: particles fly through a face from both sides, second order.

Particles at a point have a unit Gaussian of velocities w about the mean v, so the fluxes upwards and
downwards through a face are half-moments of it (KFVS):

    G(v) = int_{w>0} w   M(w - v) dw = v P(v) + p(v)         mass
    H(v) = int_{w>0} w^2 M(w - v) dw = v G(v) + P(v)         momentum along the direction
    G(v) a                                                   anything else that is advected

p the unit Gaussian's density and P its integral. Both sums are exact, G(v) - G(-v) = v and
H(v) + H(-v) = 1 + v^2, so the flux is consistent. Every cell gives, no cell can give all that it
holds: the density stays positive, and no velocity is made of rounding.

The state at a face is that of an exponential profile on top of the local equilibrium,

    ln q(x) = ln q_i + work of the force from x_i to x + slope xi

with a limited slope: q = exp(-V) at rest has the slope 0 in every cell and one value on both sides
of each face (with the source of `well_balanced.py` it stays to rounding), and a Gaussian that is on its
way to the middle of a harmonic V has one slope everywhere: nothing diffuses numerically.
Well-balanced after Audusse, Bouchut, Bristeau, Klein and Perthame, 2004; the kinetic flux after
Mandal and Deshpande, 1994.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.rows import element, map_fields
from ellipsoid_coupling.finite_volume.fluxes.ballistic import limited
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    ALONG,
    DENSITY,
    VACUUM,
    Stencil,
    register_flux,
)
from ellipsoid_coupling.physics.elementary import exp_of_negative

Floats = NDArray[np.float64]

ORDER = 2

# A steeper profile within a cell, from centre to face, is not believed.
_STEEPEST = 2.0
_ADVECTED_LIMIT = 1.0
# Of a cell's content, the part that may leave in a step. If all of it left, the rest would be momentum and
# a mass of rounding: the velocity there, and soon everywhere, would be made of rounding.
_LARGEST_PART = 1.0 - 2.0**-10
# How fast the flux damps the momentum of a cell against its neighbours', H'(0) - (-H'(0)) = 4 p(0):
# this takes the place of the speed of sound, 1, in the CFL number.
SIGNAL = 4.0 / math.sqrt(2.0 * math.pi)
_INVERSE_ROOT = 1.0 / math.sqrt(2.0 * math.pi)
# Beyond it, p(v) below 1e-87 is nothing; still smaller numbers would be slow ones (subnormal).
_FASTEST = 20.0


class Limits(NamedTuple):
    """The bounds of smooth and of empty, see `Kinetic`."""

    smooth: float
    vacuum: float


class Kinetic(NamedTuple):
    """The kinetic flux in a field of force.

    Attributes
    ----------
    tilt : (cells,) float64
        exp(work/2) of the force from a cell's centre to the next one's, flat like the fields: the
        ratio of the equilibrium's densities at the face between and at the centre.
    smooth : float
        Neighbouring slopes that differ by less are those of a smooth profile, at an extremum as well: of
        ln q, and of velocities in units of the thermal one, in any moving frame alike. It falls with the
        cell width (`ballistic.smooth_part`), and so does what the head of a rarefaction overshoots by.
    vacuum : float
    """

    tilt: Floats
    smooth: float
    vacuum: float = VACUUM


@inline_kernel
def _half_moments(v: float) -> tuple[float, float]:
    """G(v) and H(v); P by Abramowitz and Stegun 26.2.17, to 8e-8.

    Its last coefficient is adjusted in the tenth digit, so that P(0) = 1/2 to rounding.
    """
    size = min(abs(v), _FASTEST)
    # The series needs t >= 0: it is evaluated for |v|, and the other half follows from the exact
    # sums.
    p = _INVERSE_ROOT * exp_of_negative(-0.5 * size * size)
    t = 1.0 / (1.0 + 0.2316419 * size)
    series = 1.781477937 + t * (-1.821255978 + t * 1.3302744303155003)
    tail = p * t * (0.319381530 + t * (-0.356563782 + t * series))
    # The half-moments against the mean flow are small; those along it follow from the exact sums.
    against = max(p - size * tail, 0.0)
    mass = against + max(v, 0.0)
    below = max(tail - size * against, 0.0)
    momentum = below if v < 0.0 else 1.0 + v * v - below
    return mass, momentum


@inline_kernel
def face_ratios(
    before: float, here: float, after: float, rise: float, fall: float, limits: Limits
) -> tuple[float, float]:
    """The densities at the upper and the lower face over that of the centre.

    `rise` and `fall` are those of the equilibrium through the centre. On top comes exp(+-slope/2): the
    mean of the logarithmic slopes to both neighbours, limited to twice the smaller one; 0 beside vacuum
    and at extrema, unless they are smooth.

    Elsewhere than in smooth profiles neither face leaves the range from the centre to its neighbour. An
    equilibrium is far from that bound, its faces are the geometric means. But mass that drag carries along
    is in none: its profile does not follow the work of the drag, which would throw its head ahead.
    """
    filled = min(before, here, after) > limits.vacuum
    low = here * fall * fall / before if filled else 1.0
    high = after / (rise * rise * here) if filled else 1.0
    # exp of half the mean slope, half a cell: the fourth root of the product of both ratios.
    mean = math.sqrt(math.sqrt(low * high))
    rising = min(min(low, high), min(mean, _STEEPEST))
    falling = max(max(low, high), max(mean, 1.0 / _STEEPEST))
    limited_one = rising if min(low, high) > 1.0 else falling if max(low, high) < 1.0 else 1.0
    smooth = filled and abs(high - low) <= limits.smooth * low
    inverse = 1.0 / here if here > limits.vacuum else 0.0
    upper, lower = after * inverse, before * inverse
    least = max(min(1.0, upper) / rise, fall / max(1.0, lower))
    most = min(max(1.0, upper) / rise, fall / min(1.0, lower))
    # Both faces cannot have it where the work differs much from face to face: then they share, as a mirror
    # image would.
    bounded = max(min(limited_one, most), least) if least <= most else math.sqrt(least * most)
    factor = mean if smooth else bounded
    return factor * rise, fall / factor


@inline_kernel
def _slope(before: float, here: float, after: float, filled: bool, smooth: float) -> float:
    """The limited slope of a advected quantity; none beside vacuum, where it has no value."""
    return limited(here - before, after - here, _ADVECTED_LIMIT, smooth) if filled else 0.0


@inline_kernel
def _advected_outflow(
    masses: tuple[float, float],
    centre: float,
    filled: bool,
    smooth: float,
    inverse: tuple[float, float, float],
    below: float,
    here: float,
    above: float,
) -> tuple[float, float]:
    """What leaves a cell of a advected quantity with these masses, upwards and downwards."""
    value = here * inverse[1]
    change = _slope(below * inverse[0], value, above * inverse[2], filled, smooth)
    return masses[0] * (value + change * (0.5 - centre)), masses[1] * (
        value - change * (0.5 + centre)
    )


@inline_kernel
def kinetic_outflow(flux: Kinetic, stencil: Stencil, ratio: float) -> tuple[Values, Values]:
    """The kinetic flux of one cell; see contract.py."""
    below, here, above, inverse = stencil.below, stencil.here, stencil.above, stencil.inverse
    density = here[DENSITY]
    rise = element(flux.tilt, stencil.cell)
    fall = 1.0 / element(flux.tilt, stencil.cell - stencil.stride)
    at_top, at_bottom = face_ratios(
        below[DENSITY], density, above[DENSITY], rise, fall, Limits(flux.smooth, flux.vacuum)
    )
    filled = min(below[DENSITY], density, above[DENSITY]) > flux.vacuum
    v = here[ALONG] * inverse[1]
    dv = _slope(below[ALONG] * inverse[0], v, above[ALONG] * inverse[2], filled, flux.smooth)
    # The centre of mass of an exponential profile, to second order.
    centre = (at_top - at_bottom) / 12.0
    mass_up, momentum_up = _half_moments(v + dv * (0.5 - centre))
    mass_down, momentum_down = _half_moments(-v + dv * (0.5 + centre))
    upper, lower = ratio * density * at_top, ratio * density * at_bottom
    # Both outflows are cut alike where they would take nearly all of the cell.
    leaving, most = upper * mass_up + lower * mass_down, _LARGEST_PART * density
    share = most / leaving if leaving > most else 1.0
    up, down = share * upper * mass_up, share * lower * mass_down
    advected_up, advected_down = map_fields(
        _advected_outflow,
        ((up, down), centre, filled, flux.smooth, inverse),
        (below[2:], here[2:], above[2:]),
    )
    along_up, along_down = share * upper * momentum_up, -share * lower * momentum_down
    return (up, along_up, *advected_up), (down, along_down, *advected_down)


register_flux(Kinetic, kinetic_outflow)
