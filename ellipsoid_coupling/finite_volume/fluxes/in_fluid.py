"""Transport of particles that follow a fluid without sources: an even density of them stays even.

Cells know the fluid through its velocities U at their faces, whose differences vanish in sum over a cell's
faces and which are 0 in walls, stairs included. A part f of a cell's velocity counts as the fluid's (0
without drag, 1 where drag is so strong that velocities are the fluid's; see `CellFields.follows`), the
rest w as the particles' own,

    v(face) = f U(face) + w(face),        w = v - f (U_low + U_high)/2, limited slopes

Along the first direction of a step the fluid compresses a cell to the volume 1 - c dU, along the second
one it gives that back. So along the second one the densities q = rho/J per fluid are reconstructed, not
rho, and what flies through a face is the part c v/J of the cell, J = 1 + f c dU, with its own dU:

    first     sigma = c v                        J = 1
    second    sigma = c v/J                      J = 1 + f c dU

For f = 0 both are the plain fluxes, whose sigma is c v/(1 + c dv): the particles' own flight. In between,
their mean with the weights f and 1 - f: all differ by O(dt^2) for f = O(dt), so the order stays.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values, scale
from ellipsoid_coupling.compiled.intrinsics import fma
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.rows import element, map_fields
from ellipsoid_coupling.finite_volume.fluxes.ballistic import (
    DENSITY_LIMIT,
    TWELFTH,
    advected_outflow,
    advected_slope,
    limited,
)
from ellipsoid_coupling.finite_volume.fluxes.contract import (
    ALONG,
    DENSITY,
    VACUUM,
    Stencil,
    register_face_flux,
    register_flux,
)
from ellipsoid_coupling.finite_volume.fluxes.force import Force, force_flux
from ellipsoid_coupling.physics.closure import Pressure

Floats = NDArray[np.float64]


class FluidMotion(NamedTuple):
    """The fluid along the direction that is swept.

    Attributes
    ----------
    lower, upper : (cells,) float64
        Its velocity at the lower and the upper face of each cell, flat like the swept lines.
    follows : float
        f, between 0 and 1.
    second : float
        1 along the second direction of a step, else 0.
    """

    lower: Floats
    upper: Floats
    follows: float
    second: float


class BallisticInFluid(NamedTuple):
    """`Ballistic` in a fluid."""

    bends: Values
    fluid: FluidMotion
    largest_part: float = 1.0
    vacuum: float = VACUUM


class ForceInFluid(NamedTuple):
    """`Force` in a fluid."""

    pressure: Pressure
    fluid: FluidMotion
    vacuum: float = VACUUM


class _Around(NamedTuple):
    """The fluid in one cell: f U at its lower and its upper face, their mean, and J."""

    lower: float
    upper: float
    mean: float
    volume: float


@inline_kernel
def _around(fluid: FluidMotion, cell: int, ratio: float) -> _Around:
    lower = fluid.follows * element(fluid.lower, cell)
    upper = fluid.follows * element(fluid.upper, cell)
    # A step that empties more than a cell is refused elsewhere; here it must not divide by 0.
    volume = max(fma(fluid.second * ratio, upper - lower, 1.0), 0.1)
    return _Around(lower, upper, 0.5 * (lower + upper), volume)


@inline_kernel
def _slope_of(
    cells: tuple[float, float, float], inverse: tuple[float, float, float], bend: float
) -> float:
    """The limited slope of an advected quantity of three cells; see `advected_slope`."""
    return advected_slope(cells[0], cells[1], cells[2], inverse[0] == 0.0, inverse[2] == 0.0, bend)


@inline_kernel
def ballistic_outflow_in_fluid(
    flux: BallisticInFluid, stencil: Stencil, ratio: float
) -> tuple[Values, Values]:
    """Ballistic transport of one cell; see the module and `ballistic.ballistic_outflow`."""
    below, here, above, inverse = stencil.below, stencil.here, stencil.above, stencil.inverse
    cell, stride, fluid = stencil.cell, stencil.stride, flux.fluid
    low = _around(fluid, cell - stride, ratio)
    own = _around(fluid, cell, ratio)
    high = _around(fluid, cell + stride, ratio)
    # Densities per fluid.
    density = here[DENSITY] / own.volume
    before, after = below[DENSITY] / low.volume, above[DENSITY] / high.volume
    slope = limited(density - before, after - density, DENSITY_LIMIT, flux.bends[0] * density)
    twelfth = TWELFTH * slope
    # 1/q = J/rho.
    centre = twelfth * inverse[1] * own.volume
    # Each cell against its own fluid: what is left has the slope that is limited.
    w = here[ALONG] * inverse[1] - own.mean
    others = below[ALONG] * inverse[0] - low.mean, w, above[ALONG] * inverse[2] - high.mean
    dw = _slope_of(others, inverse, flux.bends[1])
    # Across a cell v changes by the particles' own slope and by the fluid's.
    stretch = max(fma(ratio, dw + (own.upper - own.lower), 1.0), 0.1)
    # The mean of own flight, c v/(1 + c dv), and of the fluid's, c v/J.
    part = ratio * ((1.0 - fluid.follows) / stretch + fluid.follows / own.volume)
    # At a face the fluid's velocity is known; only w is taken there by its slope.
    upper = min(max(part * (own.upper + fma(dw, 0.5 - centre, w)), 0.0), flux.largest_part)
    lower = min(max(-part * (own.lower + fma(dw, -0.5 - centre, w)), 0.0), flux.largest_part)
    # No cell gives more than it holds.
    lower = min(lower, 1.0 - upper)
    middle_up, middle_down = fma(-0.5, upper, 0.5), fma(-0.5, lower, 0.5)
    # From densities per fluid back to contents.
    up = own.volume * upper * fma(slope, middle_up, density)
    down = own.volume * lower * fma(-slope, middle_down, density)
    cubes = own.volume * twelfth
    # As in `ballistic`: the strip's centre against the centre of mass, and sigma^3/12.
    arm_up = fma(cubes, upper * upper * upper, up * (middle_up - centre))
    arm_down = fma(cubes, lower * lower * lower, -down * (middle_down + centre))
    advected_up, advected_down = map_fields(
        advected_outflow,
        ((up, down), (arm_up, arm_down), inverse),
        (below[1:], here[1:], above[1:], flux.bends[1:]),
    )
    return (up, *advected_up), (down, *advected_down)


@inline_kernel
def _per_fluid(cell: Values, inverse: float, around: _Around, face: float) -> Values:
    """A cell's contents per fluid, its velocity taken at a face where the fluid's is `face`."""
    contents = scale(1.0 / around.volume, cell)
    # The fluid's mean velocity in the cell is replaced by that at the face.
    velocity = cell[ALONG] * inverse - around.mean + face
    return (contents[DENSITY], contents[DENSITY] * velocity, *contents[2:])


@inline_kernel
def force_flux_in_fluid(flux: ForceInFluid, stencil: Stencil, ratio: float) -> Values:
    """FORCE between `below` and `here`; see the module and `force.force_flux`."""
    low = _around(flux.fluid, stencil.cell - stencil.stride, ratio)
    own = _around(flux.fluid, stencil.cell, ratio)
    below = _per_fluid(stencil.below, stencil.inverse[0], low, low.upper)
    here = _per_fluid(stencil.here, stencil.inverse[1], own, own.lower)
    inverse = (
        stencil.inverse[0] * low.volume,
        stencil.inverse[1] * own.volume,
        stencil.inverse[2],
    )
    # A flux of faces does not look at `above`, which may stay as it is.
    seen = Stencil(below, here, stencil.above, inverse, stencil.cell, stencil.stride)
    return force_flux(Force(flux.pressure, flux.vacuum), seen, ratio)


register_flux(BallisticInFluid, ballistic_outflow_in_fluid)
register_face_flux(ForceInFluid, force_flux_in_fluid)
