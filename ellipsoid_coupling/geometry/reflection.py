"""Reflection at walls, for use inside compiled kernels."""

from __future__ import annotations

import math

from ellipsoid_coupling.compiled.jit import inline_kernel


@inline_kernel
def reflect(coordinate: float, low: float, high: float) -> tuple[float, float]:
    """Fold a coordinate back into [low, high], as often as it takes.

    Parameters
    ----------
    coordinate : float
    low, high : float
        The walls; -inf or inf where there is none.

    Returns
    -------
    (folded, sign); sign is the factor of the velocity's component: -1 after an odd number of
    reflections, else 1. A coordinate that is not a number stays so.
    """
    folded, sign = coordinate, 1.0
    width = high - low
    if not low <= coordinate <= high:
        if math.isinf(width):
            wall = low if coordinate < low else high
            folded, sign = 2.0 * wall - coordinate, -1.0
        else:
            turns = math.floor((coordinate - low) / (2.0 * width))
            way = coordinate - low - 2.0 * width * turns
            if way > width:
                way, sign = 2.0 * width - way, -1.0
            # Rounding may leave the interval by the last bit.
            folded = min(max(low + way, low), high)
    return folded, sign
