"""A periodic side: what leaves through it comes in through the opposite one, which is periodic as well.

ghost = image, a cell at the other side
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.geometry.boundaries.contract import Place, register_boundary


class Periodic(NamedTuple):
    """It has no parameters."""


@inline_kernel
def _ghost(
    kind: Periodic, edge: Values, image: Values, normal: float, t: float, place: Place
) -> Values:
    return image


register_boundary("periodic", Periodic, _ghost, particles="wrap")
