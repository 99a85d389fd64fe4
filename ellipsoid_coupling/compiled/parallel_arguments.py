"""Nested tuples as arguments of loops that threads share.

Numba hands numbers, arrays and flat tuples of these to such loops (`prange`). Tuples of tuples go in
packed:

    @parallel_kernel
    def _step_all(count, arguments):
        packed = pack(arguments)
        for k in numba.prange(count):
            _step(signed(k), *unpack(packed))

Only kernel arguments may be packed: numba frees a kernel's own arrays as soon as they are packed. An
array must be passed packed or plain, never both, because numba assumes that plain arguments do not alias
packed ones.

To start a shared loop takes 3 us; with Python's threads, which `threads.for_each` uses, 70 us.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from ellipsoid_coupling.compiled.jit import inline_kernel
from ellipsoid_coupling.compiled.kernel_forms import in_kernels

# Numba ships half of its types: these have none.
_variable: Any = cgutils.alloca_once_value
_array: Any = types.Array
_record: Any = types.Record

# To numba a packed value is an array of one record, whose field name holds the number of its type.
_kinds: list[Any] = []


@inline_kernel
def signed(k: int) -> int:
    """The index k of a shared loop as a signed integer; numba counts such loops without a sign.

    A kernel that is called with both would be compiled twice.
    """
    return int(np.int64(k))


def pack(value: Any) -> Any:
    """An argument of this kernel for its shared loops; in Python as it is."""
    return value


def unpack(packed: Any) -> Any:
    """The value that was packed."""
    return packed


def _box_for(kind: Any) -> Any:
    if kind not in _kinds:
        _kinds.append(kind)
    # A record of one byte: its size does not matter, its name does.
    field = {"type": types.uint8, "offset": 0}
    return _array(_record([(f"kind_{_kinds.index(kind)}", field)], 1, False), 1, "C")


def _kind_in(box: Any) -> Any:
    (name,) = box.dtype.fields
    return _kinds[int(name.removeprefix("kind_"))]


def _pack(context: Any, value: Any) -> Any:
    del context
    box = _box_for(value)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature
        array = context.make_array(box)(context, builder)
        one = context.get_constant(types.intp, 1)
        context.populate_array(
            array,
            data=builder.bitcast(_variable(builder, arguments[0]), array.data.type),
            shape=(one,),
            strides=(one,),
            itemsize=one,
            # No owner: the memory lies on the stack of the running kernel.
            meminfo=None,
        )
        return array._getvalue()

    return box(value), generate


def _unpack(context: Any, packed: Any) -> Any:
    del context
    kind = _kind_in(packed)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        value = builder.load(builder.bitcast(data, context.get_value_type(kind).as_pointer()))
        # The unpacked copy owns references: increment their counts.
        context.nrt.incref(builder, kind, value)
        return value

    return kind(packed), generate


_compiled_pack: Any = intrinsic(_pack)
_compiled_unpack: Any = intrinsic(_unpack)


@in_kernels(pack)
def _choose_pack(value: Any) -> Any:
    del value
    return lambda value: _compiled_pack(value)


@in_kernels(unpack)
def _choose_unpack(packed: Any) -> Any:
    del packed
    return lambda packed: _compiled_unpack(packed)
