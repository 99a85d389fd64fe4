"""An open edge: what reaches it leaves, and nothing comes in.

    ghost = edge (Neumann)             where the edge cell moves outwards
    ghost = image, turned round        where it moves inwards

A continued cell that moves inwards would be a source without end: nothing is known of what lies outside.
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.compiled.algebra import Values, select
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.geometry.boundaries.contract import ALONG, Place, register_boundary
from ellipsoid_coupling.geometry.boundaries.reflecting import mirrored


class Open(NamedTuple):
    """It has no parameters."""


@inline_kernel
def _ghost(
    kind: Open, edge: Values, image: Values, normal: float, t: float, place: Place
) -> Values:
    return select(edge[ALONG] * normal > 0.0, mirrored(image), edge)


register_boundary("open", Open, _ghost, particles="leave")
