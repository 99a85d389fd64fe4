"""Who of many is flagged: a loop that vectorises flags, and the few are then gone through one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel

Flags = NDArray[np.uint8]
Indices = NDArray[np.int64]


@kernel
def flagged(flags: Flags) -> Indices:
    """The indices (m,), ascending, of those of flags (n,) that are not 0."""
    which, count = np.empty(flags.size, np.int64), 0
    for i in range(flags.size):
        if flags[i] != 0:
            which[count] = i
            count += 1
    return which[:count]
