"""The uniform cubic B-spline: its four values about a point, and their slopes."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel

# A number in kernels; an array in Python, by `jit.plain`.
Value = TypeVar("Value", float, NDArray[np.float64])


@inline_kernel
def spline_weights(t: Value) -> tuple[Value, Value, Value, Value]:
    """B at the four nodes about a point, t in [0, 1) node distances after the second; their sum is 1.

    B(t - k) for k = -1 .. 2:  (1-t)^3/6,  2/3 - t^2 (1 - t/2),  the same of 1-t,  t^3/6
    """
    s = 1.0 - t
    return (
        s * s * s / 6.0,
        2.0 / 3.0 - t * t * (1.0 - 0.5 * t),
        2.0 / 3.0 - s * s * (1.0 - 0.5 * s),
        t * t * t / 6.0,
    )


@inline_kernel
def spline_slopes(t: Value) -> tuple[Value, Value, Value, Value]:
    """dB/dt at the same four nodes; their sum is 0."""
    s = 1.0 - t
    return -0.5 * s * s, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t * t
