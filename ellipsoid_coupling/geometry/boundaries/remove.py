"""An open side: what reaches it is removed, and nothing comes in.

    ghost = edge (Neumann)             where the edge cell moves outwards
    ghost = image, turned round        where it moves inwards

A continued cell that moves inwards would be a source without end: nothing is known of what lies outside.
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values, select
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.geometry.boundaries.contract import ALONG, Place, register_boundary
from ellipsoid_coupling.geometry.boundaries.reflect import mirrored


class Remove(NamedTuple):
    """It has no parameters."""


@inline_kernel
def outflow(
    kind: object, edge: Values, image: Values, normal: float, t: float, place: Place
) -> Values:
    """See the module."""
    return select(edge[ALONG] * normal > 0.0, mirrored(image), edge)


register_boundary("remove", Remove, outflow, particles="leave")
