"""Compiled tasks on all threads, whatever they are given.

Loops that numba shares among threads (`prange`) take numbers, arrays and flat tuples of these. Tuples of
tuples go in by their address instead: to hand work over takes 3 us, with Python's threads 70 us.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic, overload

# Numba ships half of its types: this function has none.
_variable: Any = cgutils.alloca_once_value

Share = Callable[[int, tuple[Any, ...]], None]


def _address_of(context: Any, value: Any) -> Any:
    del context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del signature
        room = _variable(builder, arguments[0])
        return builder.ptrtoint(room, context.get_value_type(types.intp))

    return types.intp(value), generate


_compiled_address_of: Any = intrinsic(_address_of)


def _reader_of(kind: Any) -> Any:
    """What reads a value of this type from its address."""

    def read(context: Any, address: Any) -> Any:
        del context

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            del signature
            pointer = context.get_value_type(kind).as_pointer()
            value = builder.load(builder.inttoptr(arguments[0], pointer))
            # Who has a value counts as one who refers to its arrays.
            context.nrt.incref(builder, kind, value)
            return value

        return kind(address), generate

    return intrinsic(read)


def shared(task: Callable[..., None]) -> Share:
    """For parallel kernels: ``share(count, arguments)`` runs task(k, *arguments) for all k < count.

    On numba's threads, in any order: tasks must be independent. The kernel around it is what Python
    calls, and what numba's cache can keep:

        _share_rows = shared(_step_row)

        @parallel_kernel
        def _step_rows(count, arguments):
            _share_rows(count, arguments)

    Parameters
    ----------
    task : kernel
        Returns nothing.
    """

    def share(count: int, arguments: tuple[Any, ...]) -> None:
        for k in range(count):
            task(k, *arguments)

    @overload(share, inline="always", strict=False)
    def choose(count: Any, arguments: Any) -> Any:
        del count
        value_at = _reader_of(arguments)

        def run(count: Any, arguments: Any) -> None:
            address = _compiled_address_of(arguments)
            for k in numba.prange(count):
                # Numba counts such loops without a sign; a task is not to be compiled for both.
                task(np.int64(k), *value_at(address))

        return run

    return share
