"""Arrays whose memory is reused from one evaluation to the next.

New memory costs more than the work on it: the system hands it out zeroed, page by page.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ellipsoid_coupling.compiled.simd_vectors import LINE


class BufferPool:
    """Hands out arrays by name; the next one of that name may have the same memory."""

    def __init__(self) -> None:
        self._memory: dict[str, NDArray[np.uint8]] = {}

    def array(self, name: str, shape: tuple[int, ...], kind: DTypeLike) -> NDArray[Any]:
        """Numbers of any value, contiguous, from the beginning of a cache line on."""
        size = int(np.prod(shape)) * np.dtype(kind).itemsize
        if name not in self._memory or self._memory[name].size < size:
            memory = np.empty(size + LINE, np.uint8)
            begin = -memory.ctypes.data % LINE
            self._memory[name] = memory[begin : begin + size]
        return self._memory[name][:size].view(kind).reshape(shape)
