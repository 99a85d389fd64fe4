"""Tasks of compiled code on all threads, against the same tasks one after another in Python."""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel, plain
from ellipsoid_coupling.compiled.parallel_arguments import pack, signed, unpack
from ellipsoid_coupling.compiled.threads import single_task_chunks

Floats = NDArray[np.float64]


class Inner(NamedTuple):
    """Numbers, an array, and what may not be there."""

    weights: Floats
    offset: float | None


class Outer(NamedTuple):
    """Tuples in tuples."""

    inner: Inner
    pair: tuple[Inner, int]


@kernel
def _add_row(k: int, rows: Floats, outer: Outer, factor: float, seen: NDArray[np.int64]) -> None:
    inner, (other, power) = outer
    for i in range(rows.shape[1]):
        rows[k, i] += factor * inner.weights[i] + other.weights[i] ** power
    _add_offset(rows[k], inner.offset)
    seen[k] += 1


@kernel
def _add_offset(row: Floats, offset: float | None) -> None:
    if offset is not None:
        row += offset


@parallel_kernel
def _add_rows(count: int, arguments: tuple[Any, ...]) -> None:
    packed = pack(arguments)
    for k in numba.prange(count):
        _add_row(signed(k), *unpack(packed))


def arguments_for(count: int, offset: float | None) -> tuple[Any, ...]:
    rng = np.random.default_rng(count)
    inner = Inner(rng.random(50), offset)
    outer = Outer(inner, (Inner(rng.random(50), None), 3))
    return rng.random((count, 50)), outer, 0.7, np.zeros(count, np.int64)


@pytest.mark.parametrize("offset", [None, 0.25])
@pytest.mark.parametrize("count", [0, 1, 2, 7, 100])
def test_each_task_runs_once_with_everything_it_is_given(count: int, offset: float | None) -> None:
    """The bits of the same kernel called for one task after another."""
    found, wanted = arguments_for(count, offset), arguments_for(count, offset)
    with single_task_chunks():
        _add_rows(count, found)
    for k in range(count):
        _add_row(k, *wanted)
    assert np.array_equal(found[3], np.ones(count))
    assert np.array_equal(found[0], wanted[0])


def test_in_python_it_is_what_it_was() -> None:
    found, wanted = arguments_for(9, 0.5), arguments_for(9, 0.5)
    plain(_add_rows)(9, found)
    _add_rows(9, wanted)
    assert np.array_equal(found[0], wanted[0])
    assert np.array_equal(found[3], wanted[3])


class Twin(NamedTuple):
    """Like `Inner` but for its name."""

    weights: Floats
    offset: float | None


@parallel_kernel
def _sums(values: tuple[Any, ...], out: Floats) -> None:
    packed = pack(values)
    for k in numba.prange(out.size):
        first, second = unpack(packed)
        out[k] = first.weights.sum() + 2.0 * second.weights.sum() + k


def test_alike_is_not_the_same() -> None:
    """Types that hold the same in the same order are told apart."""
    one, two = Inner(np.ones(3), None), Twin(np.full(3, 5.0), None)
    found = np.zeros((2, 4))
    _sums((one, two), found[0])
    _sums((two, one), found[1])
    assert np.array_equal(found[0], 33.0 + np.arange(4))
    assert np.array_equal(found[1], 21.0 + np.arange(4))


def test_the_number_of_threads_changes_no_bit() -> None:
    found = []
    before = numba.get_num_threads()
    try:
        for threads in {1, before}:
            numba.set_num_threads(threads)
            found.append(arguments_for(33, 0.1))
            _add_rows(33, found[-1])
    finally:
        numba.set_num_threads(before)
    assert np.array_equal(found[0][0], found[-1][0])


def test_nothing_is_held_or_given_up() -> None:
    """Each task counts itself as one who refers to the arrays, and takes that back."""
    arguments = arguments_for(40, None)
    arrays = arguments[0], arguments[1].inner.weights, arguments[1].pair[0].weights
    _add_rows(40, arguments)
    counts = [sys.getrefcount(array) for array in arrays]
    for _ in range(20):
        _add_rows(40, arguments)
    assert [sys.getrefcount(array) for array in arrays] == counts
    # Memory that is given up too often is handed out again and overwritten.
    others = [np.full(50, 7.0) for _ in range(100)]
    assert all(np.array_equal(other, np.full(50, 7.0)) for other in others)
    assert np.array_equal(arrays[1], arguments_for(40, None)[1].inner.weights)
