"""Arrays whose memory is kept."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.simd_vectors import LINE


def test_memory_is_handed_out_again_unless_more_is_asked_for() -> None:
    room = BufferPool()
    first = room.array("a", (3, 5), np.float64)
    other = room.array("b", (3, 5), np.float64)
    smaller = room.array("a", (7,), np.complex64)
    larger = room.array("a", (100, 2), np.float32)
    assert np.shares_memory(first, smaller)
    assert not np.shares_memory(first, larger)
    assert not np.shares_memory(first, other)
    for array, shape in ((first, (3, 5)), (smaller, (7,)), (larger, (100, 2))):
        assert array.shape == shape
        assert array.flags.c_contiguous
        assert array.ctypes.data % LINE == 0
    assert room.array("empty", (0, 4), np.float64).size == 0
