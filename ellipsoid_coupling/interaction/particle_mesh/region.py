"""Where samples interact: a rectangle, and which of its sides are periodic."""

from __future__ import annotations

from typing import NamedTuple

from ellipsoid_coupling.interaction.pairs.cells import Interval
from ellipsoid_coupling.interaction.particle_mesh.folding import Periods


class Region(NamedTuple):
    """A rectangle.

    Attributes
    ----------
    x_range, y_range : (low, high)
        In the scene's unit.
    periods : (bool, bool)
        Whether y and x are periodic, in the order of a grid's axes; periods are at least twice the
        potential's reach.
    """

    x_range: Interval
    y_range: Interval
    periods: Periods = (False, False)

    @property
    def width(self) -> float:
        """Along x."""
        return self.x_range[1] - self.x_range[0]

    @property
    def height(self) -> float:
        """Along y."""
        return self.y_range[1] - self.y_range[0]
