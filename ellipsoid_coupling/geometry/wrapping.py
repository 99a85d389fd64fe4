"""Periodic coordinates, for use inside compiled kernels."""

from __future__ import annotations

import math

import numpy as np

from ellipsoid_coupling.compiled.jit import inline_kernel


@inline_kernel
def wrap(coordinate: float, low: float, high: float) -> float:
    """A coordinate in [low, high), shifted by as many whole periods as it takes.

    Parameters
    ----------
    coordinate : float
        One that is not finite becomes NaN, unless there is no period.
    low, high : float
        The sides; -inf and inf where there is no period.
    """
    wrapped = coordinate
    width = high - low
    if not low <= coordinate < high and not math.isinf(width):
        wrapped = coordinate - width * np.floor((coordinate - low) / width)
        # Rounding may lead to the upper side, or below the lower one by the last bit.
        if not low <= wrapped < high and math.isfinite(wrapped):
            wrapped = low
    return wrapped
