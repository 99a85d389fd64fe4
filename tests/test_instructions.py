"""Instructions that Python has no words for, against their plain twins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.instructions import fetch_ahead, fused
from ellipsoid_coupling.kernels import kernel


@kernel
def compiled_fused(a: float, b: float, c: float) -> float:
    return fused(a, b, c)


@kernel
def sum_with_fetching(values: NDArray[np.float64]) -> float:
    total = 0.0
    for i in range(values.size):
        fetch_ahead(values, i + 100)
        total += values[i]
    return total


def test_fused_rounds_once() -> None:
    """(1 + e)(1 - e) - 1 = -e^2, which two roundings lose."""
    e = 2.0**-30
    assert compiled_fused(1.0 + e, 1.0 - e, -1.0) == -(e**2)
    assert fused(2.0, 3.0, 4.0) == 10.0


def test_fetching_beyond_the_end_changes_nothing() -> None:
    values = np.arange(10.0)
    assert sum_with_fetching(values) == 45.0
    fetch_ahead(values, 200)
