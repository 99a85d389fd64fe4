"""What becomes of particles where the fluid has an outline: inside, or ended at a patch, and when.

A particle that comes to a patch which it does not leave again (an outlet, a wall that holds it) stays where
it touched the patch: at rest, for ever, acting on nobody. It is one of `frozen`, which forces,
noise and step control leave out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.fate_codes import INSIDE

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]


class Fates(NamedTuple):
    """See the module.

    Attributes
    ----------
    code : (R, N) int32
        See `geometry.fate_codes`.
    time : (R, N) float64
        When a particle ended; 0 before.
    """

    code: NDArray[np.int32]
    time: Floats


def all_inside(blocks: int, number: int) -> Fates:
    """The fates of so many particles at the start."""
    return Fates(np.full((blocks, number), INSIDE, np.int32), np.zeros((blocks, number)))


@kernel
def part_inside(fates: Fates | None) -> float:
    """The part of all particles that is in the fluid, of one at least; 1 where none can end."""
    if fates is None:
        return 1.0
    count = 0
    for k in range(fates.code.shape[0]):
        for i in range(fates.code.shape[1]):
            count += fates.code[k, i] == INSIDE
    return max(count, 1) / fates.code.size


@kernel
def takes_part(frozen: Flags | None, k: int, i: int) -> bool:
    """Whether particle i of block k moves and acts."""
    return frozen is None or frozen[k, i] == 0
