"""Where the drift is strongest, and by which term: for the message of a failure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FLUID, OUTER, PAIRS, TORQUE = "the fluid", "V1 and gravity", "interaction and walls", "the torque"


class FailureSite(NamedTuple):
    """Where the drift is strongest, and how strong each of its terms is there.

    Attributes
    ----------
    position : tuple of float
        x, y and, in models that resolve it, the angle.
    strengths : dict
        Magnitudes by the term's name, per mass or per inertia.
    """

    position: tuple[float, ...]
    strengths: dict[str, float]

    def __str__(self) -> str:
        where = ", ".join(f"{value:.6g}" for value in self.position)
        if not all(map(math.isfinite, self.strengths.values())):
            return f"The first forces that are not finite are at ({where})."
        strongest = max(self.strengths, key=lambda name: self.strengths[name])
        return f"The strongest term is {strongest}, {self.strengths[strongest]:.3g} at ({where})."


def worst(values: Sequence[Floats] | Floats, counts: NDArray[np.bool_] | None = None) -> int:
    """The flat index, over all but the first axis, of the first value that is not finite, else the largest.

    Parameters
    ----------
    values : (K, ...) float64
    counts : (...) bool, optional
        Where they count: cells that hold mass.
    """
    size = np.abs(np.asarray(values)).max(axis=0)
    size = np.where(np.isfinite(size), size, np.inf)
    return int(np.argmax(size if counts is None else np.where(counts, size, -1.0)))
