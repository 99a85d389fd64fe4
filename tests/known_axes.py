"""The axes of results that tests make up: centres of equal cells, as those of every grid are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.scenes import Scene


def even_axis(scene: Scene, name: str, size: int) -> NDArray[np.float64]:
    """Centres of `size` cells of the domain along x or y, or of a whole turn."""
    if name == "angle":
        return np.arange(size) * 2.0 * np.pi / size
    low, high = scene.domain.x if name == "x" else scene.domain.y
    return low + (high - low) * (np.arange(size) + 0.5) / size
