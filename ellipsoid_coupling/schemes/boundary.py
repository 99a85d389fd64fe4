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
        (open): continue the outermost cell (Neumann) where it moves outwards, so that what reaches
        the edge leaves, and mirror where it moves inwards. A continued cell that moves inwards
        would be a source without end: nothing is known of what lies outside.
    normal : int
        The component that is the momentum along `axis`.
    """
    lines = np.moveaxis(fields, axis, 1)
    n = lines.shape[1]
    # Layer by layer: the second mirrors the other end's first where there is one cell only.
    for layer in range(GHOSTS):
        for edge, inwards in ((GHOSTS, 1), (n - GHOSTS - 1, -1)):
            mirrored = True if reflecting else lines[normal, edge] * inwards > 0.0
            ghost = lines[:, edge - inwards * (layer + 1)]
            ghost[:] = np.where(mirrored, lines[:, edge + inwards * layer], lines[:, edge])
            ghost[normal] *= np.where(mirrored, -1.0, 1.0)


def fill_periodic(fields: Floats, axis: int) -> None:
    """Fill the ghost layers at both ends of a periodic direction, in place."""
    lines = np.moveaxis(fields, axis, 1)
    lines[:, :GHOSTS] = lines[:, -2 * GHOSTS : -GHOSTS]
    lines[:, -GHOSTS:] = lines[:, GHOSTS : 2 * GHOSTS]
