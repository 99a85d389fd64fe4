"""The pair potential of two ellipses, `eq:interaction` with its matrix reduced by hand.

With delta = rbar - r, Delta = theta - thetabar, S = l^2 + d^2, c2 = cos 2 theta, s2 = sin 2 theta:

    kappa = 1 / (1 - lambda^2 (1 + cos 2 Delta)/2)         cos 2 Delta = c2 c2b + s2 s2b
    M     = delta - lambda/2 [[c2 + c2b, s2 + s2b], [s2 + s2b, -(c2 + c2b)]] delta
    s     = kappa (delta . M) / S
    U     = eps0 sqrt(kappa) exp(-s/(1-s))   for s < 1,  else 0

    grad_r U  = 2 kappa M U / (S (1-s)^2)
    dU/dtheta = U [ kappa_theta/(2 kappa) - s_theta/(1-s)^2 ]

No matrix inverse and no trigonometric call is left per pair: cos and sin of 2 theta belong to the
particle. As the width goes to 0, kappa of parallel particles grows like (length/width)^2. Lengths
are in the scene's unit, U in that of eps0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.compiled.intrinsics import fma
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.physics.elementary import exp_of_negative

# exp(-s/(1-s)) is below 1e-300 beyond this s, so clamping changes nothing and spares a branch.
LARGEST_S = 0.9985


class PotentialShape(NamedTuple):
    """What the potential needs to know of the particles' size.

    Attributes
    ----------
    shape_factor : float
        lambda = (l^2 - d^2)/(l^2 + d^2), Jeffery's as well.
    size : float
        S = l^2 + d^2 with l = 2L and d = 2D.
    reach : float
        U vanishes beyond this distance of the centres, whatever the angles: sqrt(2) l.
    bluntness : float
        1 - lambda = 2 d^2/S to all digits, of which a needle's lambda has none left.
    """

    shape_factor: float
    size: float
    reach: float
    bluntness: float


def potential_shape(length: float, width: float) -> PotentialShape:
    """The potential's constants for particles of `length` L and `width` D (L >= D > 0)."""
    long_axis, short_axis = 2.0 * length, 2.0 * width
    size = long_axis**2 + short_axis**2
    shape_factor = (long_axis**2 - short_axis**2) / size
    bluntness = 2.0 * short_axis**2 / size
    return PotentialShape(shape_factor, size, math.sqrt(2.0) * long_axis, bluntness)


@inline_kernel
def pair_terms(
    dx: float, dy: float, c2: float, s2: float, c2b: float, s2b: float, shape: PotentialShape
) -> tuple[float, float, float, float, float]:
    """U/eps0 of a pair and its derivatives for both particles, `eq:interaction`.

    With q = delta . M and D = S/kappa: 1/(1-s) = D/(D - q) and s/(1-s) = q/(D - q), so that one
    division, by D (D - q), does for all.

    Parameters
    ----------
    dx, dy : float
        delta = rbar - r.
    c2, s2, c2b, s2b : float
        cos and sin of 2 theta and of 2 thetabar.
    shape : PotentialShape
        The particles' constants.

    Returns
    -------
    (U, dU/dx, dU/dy, dU/dtheta, dU/dthetabar), all over eps0; the gradient is that of the first
    particle, the second one's is its opposite.
    """
    factor, size = shape.shape_factor, shape.size
    # 1 - lambda^2 cos^2 Delta and delta - lambda (...), where parallel needles leave no digit, as
    # sums: (1 - lambda)(1 + lambda) + lambda^2 sin^2 Delta, (1 - lambda) delta + lambda (delta - ...).
    blunt, half = shape.bluntness, 0.5 * factor
    c, s = c2 + c2b, s2 + s2b
    mx = fma(blunt, dx, factor * fma(-0.5, fma(c, dx, s * dy), dx))
    my = fma(blunt, dy, factor * fma(-0.5, fma(s, dx, -c * dy), dy))
    askew = fma(c2 - c2b, c2 - c2b, (s2 - s2b) * (s2 - s2b))
    inverse_kappa = fma(half * half, askew, blunt * (1.0 + factor))
    d = size * inverse_kappa
    # Rounding in cos and sin may leave a needle's s below 0.
    q = max(fma(dx, mx, dy * my), 0.0)
    inside = 1.0 if q < LARGEST_S * d else 0.0
    q = min(q, LARGEST_S * d)
    rest = d - q
    once = 1.0 / (inverse_kappa * rest)
    kappa = rest * once
    over = inverse_kappa * once
    potential = inside * math.sqrt(inverse_kappa) * kappa * exp_of_negative(-q * over)
    # 1/(S (1-s)^2) = d/(S rest^2), and kappa d/S = 1.
    steep = d * over * over
    slope = 2.0 * potential * steep
    # kappa_theta/kappa = -kappa lambda^2 sin 2 Delta; s_theta has a part of kappa and one of M.
    turning = -kappa * factor * factor * fma(s2, c2b, -c2 * s2b) * potential * fma(-q, steep, 0.5)
    product, difference = dx * dy, 0.5 * fma(dx, dx, -dy * dy)
    arm = slope * factor
    torque = fma(arm, fma(c2, product, -s2 * difference), turning)
    torque_bar = fma(arm, fma(c2b, product, -s2b * difference), -turning)
    return potential, slope * mx, slope * my, torque, torque_bar


@inline_kernel
def pair_potential(
    dx: float, dy: float, c2: float, s2: float, c2b: float, s2b: float, shape: PotentialShape
) -> tuple[float, float, float, float]:
    """(U, dU/dx, dU/dy, dU/dtheta) of `pair_terms`: what the first particle feels."""
    potential, slope_x, slope_y, torque, _ = pair_terms(dx, dy, c2, s2, c2b, s2b, shape)
    return potential, slope_x, slope_y, torque
