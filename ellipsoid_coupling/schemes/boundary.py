"""What the ghost layers of a padded field hold: mirrored or continued values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.schemes.grid import GHOSTS

Floats = NDArray[np.float64]


def fill_ghosts(fields: Floats, axis: int, reflecting: bool, normal: int) -> None:
    """Fill the ghost layers at both ends of one direction, in place.

    Parameters
    ----------
    fields : (K, ..., n + 4, ...) float64
        Conserved fields, component first; padded along `axis`.
    axis : int
        The axis to fill, counted on `fields`.
    reflecting : bool
        True: mirror the interior and turn the normal momentum round, so that no mass crosses; False
        (Neumann): continue the outermost cell, so that what reaches the edge leaves.
    normal : int
        The component that is the momentum along `axis`.
    """
    lines = np.moveaxis(fields, axis, 1)
    n = lines.shape[1]
    for layer in range(GHOSTS):
        low, high = GHOSTS - 1 - layer, n - GHOSTS + layer
        lines[:, low] = lines[:, GHOSTS + layer if reflecting else GHOSTS]
        lines[:, high] = lines[:, n - GHOSTS - 1 - layer if reflecting else n - GHOSTS - 1]
        if reflecting:
            lines[normal, low] *= -1.0
            lines[normal, high] *= -1.0


def fill_periodic(fields: Floats, axis: int) -> None:
    """Fill the ghost layers at both ends of a periodic direction, in place."""
    lines = np.moveaxis(fields, axis, 1)
    lines[:, :GHOSTS] = lines[:, -2 * GHOSTS : -GHOSTS]
    lines[:, -GHOSTS:] = lines[:, GHOSTS : 2 * GHOSTS]
