"""Sums and largest values that vectorise, in a fixed order.

Read as integers, the bits of numbers that are not negative have the order of the numbers. The compiler
may take a maximum of integers in any order, and hence in vectors, but not one of floating point numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.interaction.pairs.pair_sum import sum_in_lanes

Floats = NDArray[np.float64]

_LESS_SIGN = 0x7FFFFFFFFFFFFFFF


@kernel
def largest_size(values: Floats) -> float:
    """The largest absolute value of a contiguous row (n,); NaN if there is one, 0 if there is none."""
    # Without the sign's bit. Those of NaN are larger than those of infinity, so that NaN shows.
    bits = values.view(np.int64)
    most = np.int64(0)
    for i in range(bits.size):
        most = max(most, bits[i] & _LESS_SIGN)
    found: float = np.int64(most).view(np.float64)
    return found


@kernel
def sum_and_largest(values: Floats) -> tuple[float, float]:
    """The sum and the largest of numbers (n,) that are not negative."""
    whole = values.size - values.size % 8
    # The rest of less than eight is added last, so that the order depends on the size alone.
    total: float = sum_in_lanes(values)
    for i in range(whole, values.size):
        total += values[i]
    return total, largest_size(values)
