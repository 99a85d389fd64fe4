"""Flows with an outlet, a solid or a wall, by formula, for tests of what leaves them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField


def channel(speed: float = 1.0, solid: tuple[float, float] | None = None) -> FlowField:
    """U = (speed, 0) in [0, 4] x [0, 1], 16 cells a unit; solid from x = solid[0] to solid[1]."""
    x, y = np.linspace(0.0, 4.0, 65), np.linspace(0.0, 1.0, 17)
    inside: NDArray[np.bool_] | None = None
    if solid is not None:
        middle = 0.5 * (x[1:] + x[:-1])
        inside = np.ones((16, 64), np.bool_)
        inside[4:12, (solid[0] < middle) & (middle < solid[1])] = False
    psi = np.repeat(speed * y[:, None], 65, axis=1)
    return FlowField.from_stream_function(psi, x, y, "a channel", inside=inside)


def growing_channel() -> FlowField:
    """U_x = y (1 - y) (1 + x^3) in [0, 4] x [0, 1]: its continuation beyond x = 4 grows for ever."""
    x, y = np.linspace(0.0, 4.0, 65), np.linspace(0.0, 1.0, 17)
    psi = np.outer(y**2 / 2.0 - y**3 / 3.0, 1.0 + x**3)
    return FlowField.from_stream_function(psi, x, y, "a channel that grows faster")
