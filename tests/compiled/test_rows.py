"""Rows side by side: what kernels do against the plain twins; loops over whole vectors and no further."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values, total
from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.compiled.loops import prefetch_block, round_up_to_vectors
from ellipsoid_coupling.compiled.rows import (
    Rows,
    element,
    load,
    map_fields,
    offset,
    prefetch,
    rows_at,
    store,
)

Floats = NDArray[np.float64]


@inline_kernel
def _scaled(factor: float, a: float, b: float) -> float:
    return factor * a - b


@inline_kernel
def _both(factor: float, a: float, b: float) -> tuple[float, float]:
    return factor * a, a - b


def _row(array: Floats, which: tuple[int, ...], first: int, width: int) -> None:
    rows = offset(rows_at(array, which, first - 1), 1)
    prefetch_block(rows, 1000)
    for i in range(width):
        values = load(rows, i)
        prefetch(rows, i + 1000)
        doubled, zero = map_fields(_both, (2.0,), (values, values))
        store(rows, i, map_fields(_scaled, (3.0,), (doubled, zero)))


@pytest.mark.parametrize("which", [(0,), (2, 0), (1, 3, 2, 0)])
def test_kernels_do_what_the_plain_twins_do(which: tuple[int, ...]) -> None:
    """6 times the elements 2 to 6 of some rows, whose order does not matter; nothing else."""
    array = np.random.default_rng(0).random((4, 9))
    compiled, plain, expected = array.copy(), array.copy(), array.copy()
    kernel(_row)(compiled, which, 2, 5)
    _plain_row(plain, which, 2, 5)
    expected[list(which), 2:7] *= 6.0
    np.testing.assert_array_equal(compiled, plain)
    np.testing.assert_allclose(compiled, expected, rtol=1e-15)


def _plain_row(array: Floats, which: tuple[int, ...], first: int, width: int) -> None:
    rows = offset(rows_at(array, which, first - 1), 1)
    for i in range(width):
        values = load(rows, i)
        prefetch(rows, i)
        doubled, zero = map_fields(_python(_both), (2.0,), (values, values))
        store(rows, i, map_fields(_python(_scaled), (3.0,), (doubled, zero)))


def _python(compiled: Any) -> Any:
    return compiled.py_func


@kernel
def _of_nothing(array: Floats, single: NDArray[np.float32]) -> tuple[Values, float, float, float]:
    none = rows_at(None, (0,), 0)
    store(none, 3, ())
    each_of_none = map_fields(_scaled, (1.0,), (load(none, 7), ()))
    mixed = load(rows_at(array, (1,), 0), 2) + map_fields(_scaled, (1.0,), (load(none, 0), ()))
    small = map_fields(_scaled, (2.0,), (load(rows_at(single, (1,), 0), 1), (1.0,)))
    return each_of_none, total(()), total(mixed), total(small)


def test_no_rows_are_nothing() -> None:
    """Of no array, an empty tuple comes out everywhere; numbers in single precision are taken up."""
    array = np.arange(12.0).reshape(3, 4)
    nothing, zero, one, small = _of_nothing(array, array.astype(np.float32))
    assert nothing == ()
    assert zero == 0.0
    assert one == array[1, 2]
    assert small == 2.0 * array[1, 1] - 1.0
    assert rows_at(None, (0,), 0) == ()
    assert load((), 0) == map_fields(_python(_scaled), (1.0,), ((), ())) == ()
    assert total(()) == 0.0


@kernel
def _sum_at(array: Floats, rows: tuple[int, ...], first: int) -> float:
    second: float = element(array, array.shape[2] + 1)
    return total(load(rows_at(array, rows, first), 0)) + second


def test_rows_are_counted_through_all_but_the_last_axis() -> None:
    array = np.random.default_rng(1).random((2, 3, 4))
    rows = array.reshape(6, 4)
    expected = rows[1, 2] + rows[5, 2] + array[0, 1, 1]
    assert _sum_at(array, (1, 5), 2) == expected
    assert total(load(rows_at(array, (1, 5), 2), 0)) + element(array, 5) == expected


def test_only_contiguous_arrays_have_rows() -> None:
    scattered = np.zeros((2, 3, 8))[..., ::2]
    with pytest.raises(TypingError, match="contiguous"):
        _sum_at(scattered, (0,), 0)
    with pytest.raises(ValueError, match="contiguous"):
        rows_at(scattered, (0,), 0)


@kernel
def _shifted(array: Floats, i: int) -> Values:
    first = 1
    return load(offset(rows_at(array, (1,), first), -1), i)


def test_rows_go_on_in_their_neighbours() -> None:
    """Before the beginning and beyond the end of a row; outside of the array Python says so."""
    array = np.arange(12.0).reshape(3, 4)
    for i in (-4, -1, 0, 3, 4, 7):
        assert _shifted(array, i) == _python(_shifted)(array, i) == (4.0 + i,)
    for i in (-5, 8):
        with pytest.raises(IndexError, match=r"array|bounds"):
            _python(_shifted)(array, i)


def test_numbers_of_rows_divide_as_in_kernels() -> None:
    """By zero: infinity, not an exception, though a formula in Python alone would raise one."""
    zero, one = load(rows_at(np.array([[0.0], [1.0]]), (0, 1), 0), 0)
    with np.errstate(divide="ignore"):
        assert one / zero == np.inf


@kernel(noalias=True)
def _double(source: Rows, target: Rows, width: int) -> None:
    for i in range(round_up_to_vectors(width)):
        if i < width:
            store(target, i, map_fields(_scaled, (3.0,), (load(source, i), load(source, i))))


@kernel
def _double_all(source: Floats, target: Floats, width: int) -> None:
    first = 0
    _double(rows_at(source, (0, 1), first), rows_at(target, (0, 1), first), width)


@pytest.mark.parametrize("width", [0, 1, 7, 8, 9, 31])
def test_a_loop_over_whole_vectors_ends_where_it_should(width: int) -> None:
    """What lies beyond the width is not written, to the end of the memory of an array."""
    source = np.random.default_rng(2).random((2, width))
    target = np.full((2, 40), -1.0)
    _double_all(source, target, width)
    np.testing.assert_array_equal(target[:, :width], 3.0 * source - source)
    assert (target[:, width:] == -1.0).all()
    assert round_up_to_vectors(width) % 8 == 0
    assert 0 <= round_up_to_vectors(width) - width < 8
