"""How the fluid turns an ellipse: Jeffery's term of `eq:micro`."""

from __future__ import annotations

from ellipsoid_coupling.compiled.jit import inline_kernel


@inline_kernel
def jeffery(
    c2: float,
    s2: float,
    dux_dx: float,
    dux_dy: float,
    duy_dx: float,
    duy_dy: float,
    shape_factor: float,
) -> float:
    """The angular velocity at which the fluid turns an ellipse of angle theta.

        g(theta, u) = 1/2 (d_x u_y - d_y u_x)
            + lambda [ 1/2 sin(2 theta) (d_y u_y - d_x u_x) + 1/2 cos(2 theta) (d_y u_x + d_x u_y) ]

    Parameters
    ----------
    c2, s2 : float
        cos and sin of 2 theta.
    dux_dx, dux_dy, duy_dx, duy_dy : float
        The velocity's gradient.
    shape_factor : float
        lambda; 0 for circles, which follow the rotation of the fluid.
    """
    rotation = 0.5 * (duy_dx - dux_dy)
    strain = 0.5 * s2 * (duy_dy - dux_dx) + 0.5 * c2 * (dux_dy + duy_dx)
    return rotation + shape_factor * strain
