"""Particles that an inlet feeds in: slots behind the others, each with its time and place of birth.

    0 ... first - 1     those of the start
    first ...           slots, in the order of their births; those of the future take no part

A slot whose time has come within a step is alive from the step's end on. It has moved with the fluid since
its birth: by its age, less than dt, times the fluid's velocity at the inlet. That is off by dt^2 once in a
particle's life, so that the order of a scheme stays 2. It meets the others' forces from the next step on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Births(NamedTuple):
    """See the module.

    Attributes
    ----------
    first : int
        The first slot.
    born : (R,) int64
        How many slots of each realisation are alive already, or were.
    time : (R, B) float64
        Ascending; infinite for slots that stay empty.
    position, velocity, force : (R, D, B) float64
        At birth: the inlet's position and angle, the fluid's velocity and rate of rotation, and the drift.
    """

    first: int
    born: NDArray[np.int64]
    time: Floats
    position: Floats
    velocity: Floats
    force: Floats
