"""How the fluid turns an ellipse: Jeffery's term of `eq:micro`, linear in (1, sin 2 theta, cos 2 theta).

    g(theta, u) = 1/2 (d_x u_y - d_y u_x)
        + lambda [ 1/2 sin(2 theta) (d_y u_y - d_x u_x) + 1/2 cos(2 theta) (d_y u_x + d_x u_y) ]
                = a + b sin 2 theta + c cos 2 theta

The coefficients belong to a place: particles make them where they are, cells keep those of their centres.
"""

from __future__ import annotations

from ellipsoid_coupling.compiled.jit import inline_kernel

Coefficients = tuple[float, float, float]


@inline_kernel
def jeffery_coefficients(
    rate: float, stretch: float, dux_dy: float, duy_dx: float, shape_factor: float
) -> Coefficients:
    """(a, b, c) times `rate`, gamma_bar.

    Parameters
    ----------
    rate : float
        gamma_bar; 1 for g itself.
    stretch : float
        (d u_x/dx - d u_y/dy)/2, which is d u_x/dx in a flow without sources.
    dux_dy, duy_dx : float
        The rest of the velocity's gradient.
    shape_factor : float
        lambda; 0 for circles, which follow the rotation of the fluid.
    """
    rotation = 0.5 * (duy_dx - dux_dy)
    along_sine, along_cosine = -shape_factor * stretch, 0.5 * shape_factor * (dux_dy + duy_dx)
    return rate * rotation, rate * along_sine, rate * along_cosine


@inline_kernel
def jeffery_rate(c2: float, s2: float, a: float, b: float, c: float) -> float:
    """A + b sin 2 theta + c cos 2 theta."""
    return a + b * s2 + c * c2


@inline_kernel
def jeffery_slope(c2: float, s2: float, b: float, c: float) -> float:
    """The derivative of `jeffery_rate` with respect to theta."""
    return 2.0 * (b * c2 - c * s2)
