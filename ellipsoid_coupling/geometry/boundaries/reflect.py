"""A wall: particles bounce, and no mass crosses.

ghost = image, with the momentum along the normal turned round
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.geometry.boundaries.contract import (
    ALONG,
    DENSITY,
    Place,
    register_boundary,
)


class Reflect(NamedTuple):
    """It has no parameters."""


@inline_kernel
def mirrored(image: Values) -> Values:
    """The image with its momentum along the normal turned round."""
    return (image[DENSITY], -image[ALONG], *image[2:])


@inline_kernel
def _ghost(
    kind: Reflect, edge: Values, image: Values, normal: float, t: float, place: Place
) -> Values:
    return mirrored(image)


register_boundary("reflect", Reflect, _ghost, particles="reflect")
