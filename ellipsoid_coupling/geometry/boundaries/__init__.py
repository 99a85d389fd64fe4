"""What happens at the sides of the domain: kinds of boundary, one file each.

A kind is a NamedTuple (its parameters) and a formula of what a ghost cell holds, registered by name and
type (`contract.py`): a scene names it, and kernels are compiled with its formula inlined. To add one,
copy `remove.py`, or register it from outside of the package as tests/extension/test_boundary.py does.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.geometry.boundaries.contract import (
    ACROSS,
    ALONG,
    DENSITY,
    OTHERS,
    Place,
    Seen,
    at_side,
    ghost,
    ghost_of,
    inflow_speed,
    make_kind,
    register_boundary,
)
from ellipsoid_coupling.geometry.boundaries.inlet import Inlet
from ellipsoid_coupling.geometry.boundaries.periodic import Periodic
from ellipsoid_coupling.geometry.boundaries.reflect import Reflect
from ellipsoid_coupling.geometry.boundaries.remove import Remove
from ellipsoid_coupling.geometry.boundaries.stick import Stick
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.sides import AtSide

__all__ = [
    "ACROSS",
    "ALONG",
    "DENSITY",
    "OTHERS",
    "Boundaries",
    "Inlet",
    "Periodic",
    "Place",
    "Reflect",
    "Remove",
    "Seen",
    "Stick",
    "at_side",
    "box_of_sides",
    "everywhere",
    "ghost",
    "ghost_of",
    "make_kind",
    "periodic_axes",
    "register_boundary",
    "scene_boundaries",
]

Floats = NDArray[np.float64]


class Boundaries(NamedTuple):
    """The kind of each side of a rectangle; both of opposite sides are periodic, or none."""

    left: object
    right: object
    bottom: object
    top: object

    def ends(self, axis: int) -> tuple[object, object]:
        """The kinds at the lower and the upper end of x (-1) or y (-2)."""
        return (self.left, self.right) if axis == -1 else (self.bottom, self.top)

    def wraps(self, axis: int) -> bool:
        """Whether x (-1) or y (-2) is periodic."""
        return at_side(self.ends(axis)[0]) == "wrap"

    @property
    def closed(self) -> bool:
        """Whether no mass passes any side."""
        return all(at_side(kind) != "leave" for kind in self)

    def inflow_step(self, distance: float) -> float:
        """The time in which nothing that comes in flies further than `distance`; infinite without."""
        speed = max(inflow_speed(kind) for kind in self)
        return distance / speed if speed > 0.0 else np.inf


def everywhere(kind: object) -> Boundaries:
    """That kind at all sides."""
    return Boundaries(kind, kind, kind, kind)


def scene_boundaries(scene: Scene) -> Boundaries:
    """The kinds of a scene's sides, with their parameters."""
    return Boundaries(
        **{name: make_kind(side.kind, side.parameters) for name, side in scene.sides.items()}
    )


def periodic_axes(scene: Scene) -> tuple[bool, bool]:
    """Whether y and x are periodic, in the order of a grid's axes."""
    sides = scene.sides
    return sides["bottom"].particles == "wrap", sides["left"].particles == "wrap"


def box_of_sides(scene: Scene, *acts: AtSide) -> Floats | None:
    """[[x_low, x_high], [y_low, y_high]] of the sides where particles do one of `acts`; None without any.

    Infinite at the other sides.
    """
    if not any(scene.has_sides(act) for act in acts):
        return None
    ends = (*scene.domain.x, *scene.domain.y)
    far = (-np.inf, np.inf, -np.inf, np.inf)
    held = [
        end if side.particles in acts else beyond
        for side, end, beyond in zip(scene.sides.values(), ends, far, strict=True)
    ]
    return np.reshape(held, (2, 2))
