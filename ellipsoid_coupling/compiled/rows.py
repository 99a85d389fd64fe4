"""Rows of one array side by side, element by element as tuples, in kernels (a structure of arrays).

A loop that treats all fields of a cell at once touches each number once; one loop a field would read
again what the loop before has written. The number of fields is the length of a tuple, known when the loop
is compiled. Kernels see addresses, without reference counts and without bounds checks; Python sees the
same places as `Row`, with bounds checks.
`algebra.py` has the arithmetic of such tuples, `loops.py` the loops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.algebra import Values
from ellipsoid_coupling.compiled.intrinsics import emit_prefetch
from ellipsoid_coupling.compiled.lowering import compile_as

# Numba ships half of its types: these functions have none.
_unpack: Any = cgutils.unpack_tuple
_uni_tuple: Any = types.UniTuple
_is_tuple: Any = types.BaseTuple
_tuple_of: Any = types.BaseTuple.from_types
_points_to: Any = types.CPointer


@dataclass(frozen=True, slots=True)
class Row:
    """An address in Python: element `first` of the memory of an array, and all others from there.

    As in kernels, an index may be negative or go on in the next row. Outside of the array it is an
    IndexError. A number read divides as in kernels: by zero it gives infinity or NaN.
    """

    memory: NDArray[Any]
    first: int

    def __getitem__(self, i: int) -> float:
        return np.float64(self.memory[self._position(i)])

    def __setitem__(self, i: int, value: float) -> None:
        self.memory[self._position(i)] = value

    def _position(self, i: int) -> int:
        position = self.first + i
        if position < 0:
            raise IndexError(f"index {i} is {-position} before the array")
        return position


# Where some rows begin: addresses in kernels.
Rows = tuple[Row, ...]


def rows_at(array: NDArray[Any] | None, which: tuple[int, ...], first: int) -> Rows:
    """The rows `which` of a contiguous array from element `first` on; none of no array.

    Rows are along the last axis, counted through all the others. Another layout is a ValueError in
    Python and does not compile.
    """
    if array is None:
        return ()
    if not array.flags.c_contiguous:
        raise ValueError("a contiguous array is needed")
    return tuple(Row(array.reshape(-1), k * array.shape[-1] + first) for k in which)


def load(rows: Rows, i: int) -> Values:
    """Element i of each row; a negative i is before its beginning."""
    return tuple(row[i] for row in rows)


def store(rows: Rows, i: int, values: Values) -> None:
    """Write element i of each row."""
    for row, value in zip(rows, values, strict=True):
        row[i] = value


def prefetch(rows: Rows, i: int) -> None:
    """Ask for the cache line of element i of each row, in kernels."""
    del rows, i


def element(array: NDArray[Any], i: int) -> Any:
    """Element i of a contiguous array, along its axes one after another.

    Kernels do not count a negative i from the end. With ``array[first + i]`` in a loop they do, and then
    gather number by number instead of loading vectors.
    """
    return array.reshape(-1)[i]


def offset(rows: Rows, i: int) -> Rows:
    """The rows from element i on."""
    return tuple(Row(row.memory, row.first + i) for row in rows)


def map_fields(
    formula: Callable[..., Any], shared: tuple[Any, ...], fields: tuple[Values, ...]
) -> Any:
    """formula(*shared, a, b, ..) for the elements a, b, .. of tuples of the same length.

    For formulas that `algebra` has no word for.

    Returns
    -------
    tuple
        The formula's values; where it returns several numbers, a tuple of each of them. () for empty
        tuples.
    """
    found = [formula(*shared, *values) for values in zip(*fields, strict=True)]
    if not found:
        return ()
    return tuple(zip(*found, strict=True)) if isinstance(found[0], tuple) else tuple(found)


def _check_contiguous(array: Any) -> None:
    if array.layout != "C":
        raise TypingError("a contiguous array is needed")


def _type_of_rows(context: Any, array: Any, which: Any, first: Any) -> Any:
    del context, first
    if isinstance(array, types.NoneType):
        return _tuple_of(())
    _check_contiguous(array)
    return _uni_tuple(_points_to(array.dtype), which.count)


def _emit_rows_at(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    array, which, _ = signature.args
    if isinstance(array, types.NoneType):
        return context.make_tuple(builder, signature.return_type, ())
    whole = context.make_array(array)(context, builder, arguments[0])
    length = _unpack(builder, whole.shape, array.ndim)[-1]
    first = context.cast(builder, arguments[2], signature.args[2], types.intp)
    # Addresses are computed here, once, and not in the loop that loads from them.
    starts = []
    for row in _unpack(builder, arguments[1], which.count):
        position = builder.add(builder.mul(row, length), first)
        starts.append(builder.gep(whole.data, [position]))
    return context.make_tuple(builder, signature.return_type, starts)


def _addresses(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> list[Any]:
    """Those of element `arguments[1]` of each of the rows `arguments[0]`."""
    index = context.cast(builder, arguments[1], signature.args[1], types.intp)
    rows = _unpack(builder, arguments[0], signature.args[0].count)
    return [builder.gep(row, [index]) for row in rows]


def _type_of_values(context: Any, rows: Any, i: Any) -> Any:
    del context, i
    return _tuple_of([rows.dtype.dtype] * rows.count if rows.count else [])


def _emit_load(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    values = [builder.load(one) for one in _addresses(context, builder, signature, arguments)]
    return context.make_tuple(builder, signature.return_type, values)


def _emit_store(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    rows, _, held = signature.args
    values = _unpack(builder, arguments[2], rows.count)
    addresses = _addresses(context, builder, signature, arguments)
    for address, value, kind in zip(addresses, values, held.types, strict=True):
        # Rows in single precision take numbers in double precision.
        builder.store(context.cast(builder, value, kind, rows.dtype.dtype), address)
    return context.get_dummy_value()


def _emit_prefetch(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    for address in _addresses(context, builder, signature, arguments):
        emit_prefetch(builder, address)
    return context.get_dummy_value()


def _emit_offset(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    addresses = _addresses(context, builder, signature, arguments)
    return context.make_tuple(builder, signature.return_type, addresses)


def _type_of_element(context: Any, array: Any, i: Any) -> Any:
    del context, i
    _check_contiguous(array)
    return array.dtype


def _emit_element(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
    index = context.cast(builder, arguments[1], signature.args[1], types.intp)
    return builder.load(builder.gep(data, [index]))


def _single_call(context: Any, formula: Any, shared: Any, fields: Any) -> Any:
    """The signature of the formula for one element of each tuple."""
    return formula.get_call_type(context, [*shared, *(one.dtype for one in fields)], {})


def _type_of_map(context: Any, formula: Any, shared: Any, fields: Any) -> Any:
    count = fields[0].count
    if count == 0:
        return _tuple_of(())
    made = _single_call(context, formula, shared, fields).return_type
    if isinstance(made, _is_tuple):
        return _uni_tuple(_uni_tuple(made.dtype, count), made.count)
    return _uni_tuple(made, count)


def _emit_map(context: Any, builder: Any, signature: Any, arguments: list[Any]) -> Any:
    formula, shared, fields = signature.args
    returned, count = signature.return_type, fields[0].count
    if count == 0:
        return context.make_tuple(builder, returned, ())
    # One call of the formula an element: LLVM inlines them all.
    single = _single_call(context.typing_context, formula, shared, fields)
    call = context.get_function(formula, single)
    first = _unpack(builder, arguments[1], len(shared))
    packed = _unpack(builder, arguments[2], len(fields))
    columns = [_unpack(builder, one, count) for one in packed]
    found = [call(builder, [*first, *values]) for values in zip(*columns, strict=True)]
    if not isinstance(single.return_type, _is_tuple):
        return context.make_tuple(builder, returned, found)
    parts = [_unpack(builder, one, returned.count) for one in found]
    made = [context.make_tuple(builder, returned.dtype, part) for part in zip(*parts, strict=True)]
    return context.make_tuple(builder, returned, made)


def _type_of_nothing(context: Any, *operands: Any) -> Any:
    del context, operands
    return types.none


compile_as(rows_at, _type_of_rows, _emit_rows_at)
compile_as(load, _type_of_values, _emit_load)
compile_as(store, _type_of_nothing, _emit_store)
compile_as(prefetch, _type_of_nothing, _emit_prefetch)
compile_as(element, _type_of_element, _emit_element)
compile_as(offset, lambda context, rows, i: rows, _emit_offset)  # noqa: ARG005
compile_as(map_fields, _type_of_map, _emit_map)
