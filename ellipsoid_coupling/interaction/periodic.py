"""A direct sum in a periodic domain: over fields that go on beyond the seam.

. . . | o o o o o o | . . .      the last `halo` columns once more in front, the first ones behind
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ellipsoid_coupling.interaction.grid_forces import Array, Forces, GridInteraction

# Whether y and x are periodic, in the order of a grid's axes.
Periods = tuple[bool, bool]


class ContinuedInteraction:
    """`GridInteraction` of fields that are continued by `halo` cells along periodic axes.

    Parameters
    ----------
    grid_shape : (ny, nx)
    periods : (bool, bool)
    halo : int
        Cells that the potential reaches.
    make : ((ny, nx)) -> GridInteraction
        The interaction on a grid that ends.
    """

    def __init__(
        self,
        grid_shape: tuple[int, int],
        periods: Periods,
        halo: int,
        make: Callable[[tuple[int, int]], GridInteraction],
    ) -> None:
        y, x = (halo if periodic else 0 for periodic in periods)
        self._halo = (y, y), (x, x)
        self._own = slice(y, y + grid_shape[0]), slice(x, x + grid_shape[1])
        self._interaction = make((grid_shape[0] + 2 * y, grid_shape[1] + 2 * x))

    def __call__(self, density: Array, angle: Array) -> Forces:
        """See `GridInteraction`."""
        fields = (np.pad(field, self._halo, mode="wrap") for field in (density, angle))
        x, y, torque = self._interaction(*fields)
        # Walls are added to them in place.
        own = self._own
        return Forces(x[own].copy(), y[own].copy(), None if torque is None else torque[own].copy())
