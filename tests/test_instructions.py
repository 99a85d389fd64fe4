"""Instructions that Python has no words for, against their plain twins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError
from numpy.typing import NDArray

from ellipsoid_coupling.instructions import LINE, fetch_ahead, fused, sum_products
from ellipsoid_coupling.kernels import kernel


@kernel
def compiled_sum(factors: Any, which: Any, sources: Any, sums: Any) -> None:
    sum_products(factors, which, sources, sums)


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


@pytest.mark.parametrize(("kind", "exact"), [(np.float32, 1e-6), (np.float64, 1e-15)])
@pytest.mark.parametrize(("lines", "terms"), [(1, 1), (3, 7), (8, 0)])
def test_sums_of_products(
    kind: type[np.float32 | np.float64], exact: float, lines: int, terms: int
) -> None:
    """Fused and in another order than the plain twin: alike to rounding of the largest product."""
    lanes = LINE // np.dtype(kind).itemsize
    rng = np.random.default_rng(lines)
    factors = rng.standard_normal((lines, 11, lanes)).astype(kind)
    sources = rng.standard_normal((lines, terms, 4, lanes)).astype(kind)
    which = rng.integers(0, 11, terms)
    found, expected = np.full((2, 4, lines * lanes), np.nan, kind)
    compiled_sum(factors, which, sources, found)
    sum_products(factors, which, sources, expected)
    assert np.allclose(found, expected, rtol=0.0, atol=10 * exact * max(terms, 1))


def test_sums_of_products_take_contiguous_arrays_only() -> None:
    factors, sources = np.zeros((2, 3, 16)), np.zeros((2, 3, 4, 8))
    with pytest.raises(TypingError):
        compiled_sum(factors[:, :, ::2], np.arange(3), sources, np.zeros((4, 16)))


def test_fused_rounds_once() -> None:
    """(1 + e)(1 - e) - 1 = -e^2, which two roundings lose."""
    e = 2.0**-30
    assert compiled_fused(1.0 + e, 1.0 - e, -1.0) == -(e**2)
    assert fused(2.0, 3.0, 4.0) == 10.0


def test_fetching_beyond_the_end_changes_nothing() -> None:
    values = np.arange(10.0)
    assert sum_with_fetching(values) == 45.0
    fetch_ahead(values, 200)
