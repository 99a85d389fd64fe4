"""An inlet: the fluid carries particles in, of a given density and angle, at its own velocity.

    ghost = density (1, u_x, u_y, phi, omega)      where the fluid comes in
    ghost = that of a side which removes           where it does not

u is the fluid's velocity at the face and omega Jeffery's rate there: what has been in the fluid for long
moves like that. Cells that hold particles all the same may fly out against the fluid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values, scale, select
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.geometry.boundaries.contract import (
    ALONG,
    Place,
    register_boundary,
)
from ellipsoid_coupling.geometry.boundaries.remove import outflow


class Inlet(NamedTuple):
    """The density outside, of a mass of 1 at the start, and the angle (NaN: that of the start)."""

    density: float
    angle: float = math.nan


@inline_kernel
def _ghost(
    kind: Inlet, edge: Values, image: Values, normal: float, t: float, place: Place
) -> Values:
    comes_in = place.carried[ALONG] * normal > 0.0
    held = scale(kind.density, place.carried)
    return select(comes_in, held, outflow(kind, edge, image, normal, t, place))


# Of what comes in grids know the speed beforehand: it is the fluid's, which bounds their steps anyway.
register_boundary("inlet", Inlet, _ghost, particles="leave", inflow=lambda kind: 0.0)  # noqa: ARG005
