"""Sums in registers, against their plain twins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.simd_stencils import Four, add_stencil, sum_stencil
from ellipsoid_coupling.compiled.simd_sums import sum_products, sum_rows
from ellipsoid_coupling.compiled.simd_vectors import DOUBLES, LINE

Kind = type[np.float32] | type[np.float64]


@kernel
def compiled_sum(factors: Any, which: Any, sources: Any, sums: Any) -> None:
    sum_products(factors, which, sources, sums)


@kernel
def compiled_rows(weights: Any, rows: Any, sums: Any) -> None:
    sum_rows(weights, rows, sums)


@kernel
def compiled_stencil(
    nodes: Any, at: Any, along_y: Any, along_x: Any, factors: Any
) -> tuple[float, float, float]:
    return sum_stencil(nodes, at, along_y, along_x, factors)


@kernel
def compiled_addition(nodes: Any, at: Any, along_y: Any, along_x: Any, basis: Any) -> None:
    add_stencil(nodes, at, along_y, along_x, basis)


@pytest.mark.parametrize(("kind", "exact"), [(np.float32, 1e-6), (np.float64, 1e-15)])
@pytest.mark.parametrize(("lines", "terms"), [(1, 1), (3, 7), (2, 8), (8, 0)])
def test_sums_of_products(kind: Kind, exact: float, lines: int, terms: int) -> None:
    """Fused and in another order than the plain twin: alike to rounding of the largest product."""
    lanes = LINE // np.dtype(kind).itemsize
    rng = np.random.default_rng(lines)
    factors = rng.standard_normal((lines, 11, 11, lanes)).astype(kind)
    sources = rng.standard_normal((lines, terms, 4, lanes)).astype(kind)
    which = rng.integers(0, 11, terms)
    found, expected = np.full((2, terms, 4, lines * lanes), np.nan, kind)
    compiled_sum(factors, which, sources, found)
    sum_products(factors, which, sources, expected)
    assert np.allclose(found, expected, rtol=0.0, atol=10 * exact * max(terms, 1))


def test_sums_of_products_take_contiguous_arrays_only() -> None:
    factors, sources = np.zeros((2, 3, 3, 16)), np.zeros((2, 3, 4, 8))
    with pytest.raises(TypingError):
        compiled_sum(factors[..., ::2], np.arange(3), sources, np.zeros((3, 4, 16)))


@pytest.mark.parametrize(("kind", "exact"), [(np.float32, 1e-6), (np.float64, 1e-15)])
@pytest.mark.parametrize(
    ("count", "terms", "lines"),
    [(1, 1, 1), (4, 3, 2), (5, 7, 3), (15, 29, 14), (3, 0, 2), (0, 2, 1)],
)
def test_sums_of_rows(kind: Kind, exact: float, count: int, terms: int, lines: int) -> None:
    """A matrix product, also where sums or lines are left over; alike to rounding of the largest term."""
    lanes = LINE // np.dtype(kind).itemsize
    rng = np.random.default_rng(count)
    weights = rng.standard_normal((count, terms)).astype(kind)
    rows = rng.standard_normal((terms, lines * lanes)).astype(kind)
    found = np.full((count + 1, lines * lanes), np.nan, kind)
    compiled_rows(weights, rows, found[:count])
    assert np.isnan(found[count]).all()
    expected = weights.astype(np.float64) @ rows.astype(np.float64)
    assert np.allclose(found[:count], expected, rtol=0.0, atol=10 * exact * max(terms, 1))
    sum_rows(weights, rows, found[:count])
    assert np.allclose(found[:count], expected, rtol=0.0, atol=10 * exact * max(terms, 1))


@pytest.mark.parametrize("which", range(3))
def test_sums_of_rows_take_contiguous_arrays_of_one_kind_only(which: int) -> None:
    arrays = [np.zeros((3, 5)), np.zeros((5, 8)), np.zeros((3, 8))]
    single = [array.astype(np.float32) if k == which else array for k, array in enumerate(arrays)]
    arrays[which] = np.zeros((2 * arrays[which].shape[0], arrays[which].shape[1]))[::2]
    for wrong in (arrays, single):
        with pytest.raises(TypingError):
            compiled_rows(*wrong)


def weights(rng: np.random.Generator) -> Four:
    a, b, c, d = rng.standard_normal(4)
    return a, b, c, d


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("blocks", [1, 3])
def test_stencils(kind: Kind, blocks: int) -> None:
    """Any node of a grid; sums are in double precision for either kind of nodes."""
    rng = np.random.default_rng(blocks)
    nodes: NDArray[Any] = rng.standard_normal((6, 9, blocks * DOUBLES)).astype(kind)
    factors = rng.standard_normal((2, blocks * DOUBLES))
    y, x = ((weights(rng), weights(rng)) for _ in range(2))
    for at in ((0, 0), (1, 3), (2, 5)):
        found = compiled_stencil(nodes, at, y, x, factors)
        assert found == pytest.approx(sum_stencil(nodes, at, y, x, factors), rel=1e-12)


def test_what_is_added_to_a_stencil_is_what_is_summed_from_it() -> None:
    """Against the plain twin, and one as the transpose of the other."""
    rng = np.random.default_rng(0)
    nodes, factors = rng.standard_normal((6, 9, 2 * DOUBLES)), rng.standard_normal((2, 2 * DOUBLES))
    v, w, at = weights(rng), weights(rng), (2, 4)
    found, expected = np.zeros((2, *nodes.shape))
    compiled_addition(found, at, v, w, factors[1])
    add_stencil(expected, at, v, w, factors[1])
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    assert np.count_nonzero(found) == 16 * 2 * DOUBLES
    value = compiled_stencil(nodes, at, (v, v), (w, w), factors)[2]
    assert value == pytest.approx(float(np.sum(found * nodes)), rel=1e-12)


def test_stencils_take_contiguous_arrays_only() -> None:
    one = (1.0, 1.0, 1.0, 1.0)
    nodes, basis = np.zeros((5, 5, 2 * DOUBLES)), np.zeros((2, 2 * DOUBLES))
    with pytest.raises(TypingError):
        compiled_stencil(nodes[..., ::2], (0, 0), (one, one), (one, one), basis)
    with pytest.raises(TypingError):
        compiled_addition(nodes, (0, 0), one, one, basis[0, ::2])
    with pytest.raises(TypingError):
        compiled_addition(nodes.astype(np.float32), (0, 0), one, one, basis[0])
