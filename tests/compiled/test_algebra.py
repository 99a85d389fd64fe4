"""Arithmetic on tuples: compiled against the plain twins, to the bit."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError

from ellipsoid_coupling.compiled.algebra import (
    Values,
    absolute,
    add,
    axpy,
    div,
    fill,
    fused_axpy,
    maximum,
    minimum,
    mul,
    scale,
    select,
    sub,
    total,
)
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, plain
from ellipsoid_coupling.compiled.loops import chunk, over_row
from ellipsoid_coupling.compiled.rows import Rows, load, rows_at, store


@kernel
def _all_of_them(a: Values, b: Values, number: float, holds: bool) -> tuple[Any, ...]:
    return (
        add(a, b),
        sub(number, a),
        mul(a, b),
        div(a, number),
        scale(number, a),
        axpy(number, a, b),
        axpy(a, b, number),
        maximum(a, b),
        minimum(a, number),
        absolute(a),
        select(holds, a, b),
        select(holds, number, a),
        fill(number, a),
    )


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("holds", [True, False])
def test_kernels_do_what_python_does(count: int, holds: bool) -> None:
    rng = np.random.default_rng(count)
    a, b = (tuple(rng.standard_normal(count).tolist()) for _ in range(2))
    assert _all_of_them(a, b, 1.5, holds) == plain(_all_of_them)(a, b, 1.5, holds)


@kernel
def _of_integers(rows: tuple[int, ...], plane: int, row: int) -> tuple[tuple[int, ...], ...]:
    return axpy(rows, plane, row), add(rows, 1), fill(row, rows)


def test_integers_stay_integers() -> None:
    found = _of_integers((0, 2, 1), 10, 3)
    assert found == ((3, 23, 13), (1, 3, 2), (3, 3, 3)) == plain(_of_integers)((0, 2, 1), 10, 3)
    assert all(isinstance(number, int) for values in found for number in values)


@kernel
def _of_nothing(number: float) -> tuple[Any, ...]:
    return add((), number), axpy(number, (), ()), select(True, (), ()), fill(number, ()), total(())


def test_nothing_stays_nothing() -> None:
    assert _of_nothing(1.0) == ((), (), (), (), 0.0) == plain(_of_nothing)(1.0)


@kernel
def _largest(a: Values, b: Values) -> tuple[Values, Values]:
    return maximum(a, b), minimum(a, b)


def test_what_is_not_a_number_is_never_larger_nor_smaller() -> None:
    """As Python's own max and min: the first one stays."""
    nan = math.nan
    for found in (_largest((nan, 1.0), (1.0, nan)), plain(_largest)((nan, 1.0), (1.0, nan))):
        for values in found:
            assert math.isnan(values[0])
            assert values[1] == 1.0


@kernel
def _fused(a: float, x: Values, y: Values) -> Values:
    return fused_axpy(a, x, y)


def test_a_fused_sum_is_rounded_once() -> None:
    """To the bit, in exact arithmetic; Python rounds twice, and its last digit may differ."""
    rng = np.random.default_rng(5)
    a, (x, y) = float(rng.standard_normal()), rng.standard_normal((2, 4)).tolist()
    exact = [float(Fraction(a) * Fraction(u) + Fraction(v)) for u, v in zip(x, y, strict=True)]
    assert _fused(a, tuple(x), tuple(y)) == tuple(exact)
    np.testing.assert_allclose(plain(_fused)(a, tuple(x), tuple(y)), exact, rtol=0, atol=4e-16)
    with pytest.raises(TypingError, match="floating point"):
        kernel(plain(_fused))(2, (1, 2), (3, 4))


@kernel
def _too_long(a: Values, b: Values) -> Values:
    return add(a, b)


def test_tuples_of_different_lengths_are_refused() -> None:
    with pytest.raises(TypingError, match="one length"):
        _too_long((1.0, 2.0), (1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match="argument 2"):
        plain(_too_long)((1.0, 2.0), (1.0, 2.0, 3.0))


@kernel
def _sum(values: Values) -> float:
    return total(values)


def test_a_total_adds_up_in_order() -> None:
    values = (1e16, 1.0, -1e16, 1.0)
    assert _sum(values) == 1.0 == plain(_sum)(values)


@inline_kernel
def _step(i: int, cells: Rows, factor: float) -> None:
    store(cells, i, scale(factor, load(cells, i)))


@kernel
def _step_row(array: np.ndarray[Any, np.dtype[np.float64]], width: int, factor: float) -> None:
    over_row(width, _step, (rows_at(array, (1, 0), 0), factor))


@pytest.mark.parametrize("width", [0, 1, 7, 8, 9, 30])
def test_a_loop_over_a_row_is_that_of_python(width: int) -> None:
    """And writes nothing beyond its width."""
    array = np.random.default_rng(3).random((2, 40))
    other, expected = array.copy(), array.copy()
    _step_row(array, width, 3.0)
    over_row(width, plain(_step), (rows_at(other, (1, 0), 0), 3.0))
    expected[:, :width] *= 3.0
    np.testing.assert_array_equal(array, expected)
    np.testing.assert_array_equal(other, expected)


@pytest.mark.parametrize("count", [0, 1, 7, 64, 100])
@pytest.mark.parametrize("tasks", [1, 3, 64])
def test_chunks_cover_all_once(count: int, tasks: int) -> None:
    parts = [chunk(task, tasks, count) for task in range(tasks)]
    assert [k for first, end in parts for k in range(first, end)] == list(range(count))
