"""A wall that holds what reaches it: particles stay where they touched it, grids lose that mass.

ghost = that of a side which removes: nothing comes back
"""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.geometry.boundaries.contract import register_boundary
from ellipsoid_coupling.geometry.boundaries.remove import outflow


class Stick(NamedTuple):
    """It has no parameters."""


register_boundary("stick", Stick, outflow, particles="leave")
