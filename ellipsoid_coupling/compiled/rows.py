"""Several rows of one array side by side, element by element as tuples, in kernels.

A loop that treats all fields of a cell at once touches each number once, where a loop a field reads
again what the one before has written. How many fields there are is known when such a loop is compiled:
it is the length of a tuple. Each function has a plain twin of the same name for Python.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.intrinsics import emit_prefetch
from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.simd_sums import DOUBLES

# Numba ships half of its types: these functions have none.
_unpack: Any = cgutils.unpack_tuple
_uni_tuple: Any = types.UniTuple
_is_tuple: Any = types.BaseTuple
_of_types: Any = types.BaseTuple.from_types
_points_to: Any = types.CPointer

Floats = NDArray[np.float64]
# Where some rows begin: addresses in kernels, views in Python.
Rows = tuple[Floats, ...]
Values = tuple[float, ...]


def rows_at(array: NDArray[Any] | None, which: tuple[int, ...], first: int) -> Rows:
    """The rows `which` of a contiguous array from element `first` on; none of no array.

    Rows are along the last axis, counted through all the others.
    """
    if array is None:
        return ()
    rows = array.reshape(-1, array.shape[-1])
    return tuple(rows[k, first:] for k in which)


def load(rows: Rows, i: int) -> Values:
    """Element i of each row; kernels do not count a negative i from the end."""
    return tuple(float(row[i]) for row in rows)


def store(rows: Rows, i: int, values: Values) -> None:
    """Write element i of each row."""
    for row, value in zip(rows, values, strict=True):
        row[i] = value


def fetch(rows: Rows, i: int) -> None:
    """Ask for the cache line of element i of each row, in kernels."""
    del rows, i


def element(array: NDArray[Any], i: int) -> Any:
    """Element i of a contiguous array, along its axes one after another.

    Kernels do not count a negative i from the end; with ``array[first + i]`` in a loop they do, and
    gather what stands in line.
    """
    return array.reshape(-1)[i]


def onwards(rows: Rows, i: int) -> Rows:
    """The rows from element i on."""
    return tuple(row[i:] for row in rows)


def each(formula: Callable[..., Any], shared: tuple[Any, ...], tuples: tuple[Values, ...]) -> Any:
    """formula(*shared, a, b, ..) for the elements a, b, .. of tuples of the same length.

    Returns
    -------
    tuple
        Of what the formula returns; where that is several numbers, a tuple of each of them. Nothing
        for empty tuples.
    """
    found = [formula(*shared, *values) for values in zip(*tuples, strict=True)]
    if not found:
        return ()
    return tuple(zip(*found, strict=True)) if isinstance(found[0], tuple) else tuple(found)


@inline_kernel
def whole_vectors(width: int) -> int:
    """So many cells, or whatever numbers, are whole vectors.

    Loops go on to there and leave out with an `if` what lies beyond ``width``: the rest of a loop
    would go one cell at a time, which takes as long as three vectors.
    """
    return (width + DOUBLES - 1) // DOUBLES * DOUBLES


@inline_kernel
def row_of(rows: int, row: int, component: int) -> int:
    """A row of a component that has so many rows, counted through all components (see `rows_at`)."""
    return component * rows + row


@inline_kernel
def next_row(row: int) -> int:
    """The row after it."""
    return row + 1


# Cache lines that the processor waits for at once.
_LINES = 40


@inline_kernel
def piece_of(rows: int) -> int:
    """So many cells of each of these rows may be asked for at once.

    A loop over long rows goes piece by piece, and asks for the same piece of the next rows before it
    works on one: the processor reads ahead too little by itself, and waits when asked for too much.
    """
    return max(1, _LINES // rows) * DOUBLES


@inline_kernel
def fetch_piece(rows: Rows, width: int) -> None:
    """Ask for so many cells of each row."""
    for i in range(0, width, DOUBLES):
        fetch(rows, i)


def _rows_of_nothing(array: None, which: tuple[int, ...], first: int) -> Rows:  # noqa: ARG001
    return ()


def total(values: Values) -> float:
    """The sum, in order; 0 of none."""
    return sum(values)


def _check_contiguous(array: Any) -> None:
    if array.layout != "C":
        raise TypingError("a contiguous array is needed")


def _rows_at(context: Any, array: Any, which: Any, first: Any) -> Any:
    del context
    _check_contiguous(array)
    result = _uni_tuple(_points_to(array.dtype), which.count)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = context.make_array(array)(context, builder, arguments[0])
        length = _unpack(builder, whole.shape, array.ndim)[-1]
        starts = []
        for row in _unpack(builder, arguments[1], which.count):
            place = builder.add(builder.mul(row, length), arguments[2])
            starts.append(builder.gep(whole.data, [place]))
        return context.make_tuple(builder, signature.return_type, starts)

    return result(array, which, first), generate


def _places(builder: Any, rows: Any, count: int, index: Any) -> list[Any]:
    return [builder.gep(row, [index]) for row in _unpack(builder, rows, count)]


def _load(context: Any, rows: Any, i: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = _places(builder, arguments[0], rows.count, arguments[1])
        values = [builder.load(place) for place in places]
        return context.make_tuple(builder, signature.return_type, values)

    kind = rows.dtype.dtype if rows.count > 0 else types.float64
    return _of_types([kind] * rows.count)(rows, i), generate


def _store(context: Any, rows: Any, i: Any, values: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature
        places = _places(builder, arguments[0], rows.count, arguments[1])
        for place, value in zip(places, _unpack(builder, arguments[2], rows.count), strict=True):
            builder.store(value, place)
        return context.get_dummy_value()

    return types.none(rows, i, values), generate


def _fetch(context: Any, rows: Any, i: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature
        for place in _places(builder, arguments[0], rows.count, arguments[1]):
            emit_prefetch(builder, place)
        return context.get_dummy_value()

    return types.none(rows, i), generate


def _onwards(context: Any, rows: Any, i: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places = _places(builder, arguments[0], rows.count, arguments[1])
        return context.make_tuple(builder, signature.return_type, places)

    return rows(rows, i), generate


def _element(context: Any, array: Any, i: Any) -> Any:
    del context
    _check_contiguous(array)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.load(builder.gep(data, [arguments[1]]))

    return array.dtype(array, i), generate


def _total(context: Any, values: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del context, signature
        numbers = _unpack(builder, arguments[0], values.count)
        if not numbers:
            return ir.Constant(ir.DoubleType(), 0.0)
        return functools.reduce(builder.fadd, numbers)

    return types.float64(values), generate


def _each(context: Any, formula: Any, shared: Any, tuples: Any) -> Any:
    count = tuples[0].count
    if count == 0:
        return _none_of_each(formula, shared, tuples)
    kinds = [*shared, *(one.dtype for one in tuples)]
    single = formula.get_call_type(context, kinds, {})
    result = single.return_type
    several = isinstance(result, _is_tuple)
    whole = _uni_tuple(result.dtype if several else result, count)
    returned = _uni_tuple(whole, result.count) if several else whole

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature
        call = context.get_function(formula, single)
        first = _unpack(builder, arguments[1], len(kinds) - len(tuples))
        packed = _unpack(builder, arguments[2], len(tuples))
        columns = [_unpack(builder, one, count) for one in packed]
        found = [call(builder, [*first, *values]) for values in zip(*columns, strict=True)]
        if not several:
            return context.make_tuple(builder, returned, found)
        parts = [_unpack(builder, one, result.count) for one in found]
        made = [context.make_tuple(builder, whole, part) for part in zip(*parts, strict=True)]
        return context.make_tuple(builder, returned, made)

    return returned(formula, shared, tuples), generate


def _none_of_each(formula: Any, shared: Any, tuples: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del arguments
        return context.make_tuple(builder, signature.return_type, ())

    return _of_types(())(formula, shared, tuples), generate


_compiled_total: Any = intrinsic(_total)
_compiled_rows_at: Any = intrinsic(_rows_at)
_compiled_load: Any = intrinsic(_load)
_compiled_store: Any = intrinsic(_store)
_compiled_fetch: Any = intrinsic(_fetch)
_compiled_onwards: Any = intrinsic(_onwards)
_compiled_element: Any = intrinsic(_element)
_compiled_each: Any = intrinsic(_each)


@overload(total, inline="always", strict=False)
def _choose_total(values: Any) -> Any:
    del values
    return lambda values: _compiled_total(values)


@overload(rows_at, inline="always", strict=False)
def _choose_rows_at(array: Any, which: Any, first: Any) -> Any:
    del which, first
    if isinstance(array, types.NoneType):
        return _rows_of_nothing
    return lambda array, which, first: _compiled_rows_at(array, which, first)


@overload(load, inline="always", strict=False)
def _choose_load(rows: Any, i: Any) -> Any:
    del rows, i
    return lambda rows, i: _compiled_load(rows, i)


@overload(store, inline="always", strict=False)
def _choose_store(rows: Any, i: Any, values: Any) -> Any:
    del rows, i, values
    return lambda rows, i, values: _compiled_store(rows, i, values)


@overload(fetch, inline="always", strict=False)
def _choose_fetch(rows: Any, i: Any) -> Any:
    del rows, i
    return lambda rows, i: _compiled_fetch(rows, i)


@overload(onwards, inline="always", strict=False)
def _choose_onwards(rows: Any, i: Any) -> Any:
    del rows, i
    return lambda rows, i: _compiled_onwards(rows, i)


@overload(element, inline="always", strict=False)
def _choose_element(array: Any, i: Any) -> Any:
    del array, i
    return lambda array, i: _compiled_element(array, i)


@overload(each, inline="always", strict=False)
def _choose_each(formula: Any, shared: Any, tuples: Any) -> Any:
    del formula, shared, tuples
    return lambda formula, shared, tuples: _compiled_each(formula, shared, tuples)
