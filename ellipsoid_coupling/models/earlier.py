"""The last state of an earlier run, from which a scene with start.file goes on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

VELOCITIES = ("velocity_x", "velocity_y", "angular_velocity")


class Earlier(NamedTuple):
    """See the module.

    Attributes
    ----------
    where : str
        The file, for messages.
    layout : "particles", "rho" or "q"
    variables : dict of float64 arrays
        Those of the result file at its last time, without the axis of time.
    coordinates : dict
        Cell centres by axis; {} of particles.
    particles : float
        How many of the particles hold a mass of 1; 0 of a grid.
    digest : str
        What tells two states apart.
    """

    where: str
    layout: str
    variables: dict[str, Floats]
    coordinates: dict[str, Floats]
    particles: float
    digest: str
