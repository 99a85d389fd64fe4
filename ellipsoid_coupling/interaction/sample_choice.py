"""Which way to compute the interaction of samples: pair by pair where that is less work, or possible."""

from __future__ import annotations

import math

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.choice import Method
from ellipsoid_coupling.interaction.sample_forces import MOST_HARMONICS, SampleInteraction
from ellipsoid_coupling.interaction.sample_pairs import Interval, SamplePairs
from ellipsoid_coupling.physics.potential import PotentialShape

# Up to so many pairs within reach (5 ms on two threads) harmonics do not pay.
_FEW_PAIRS = 3e5
# Particles more slender than there may be harmonics: no series follows how sharply they turn aside,
# and looking for one on nodes a quarter of their width apart would fill the memory.
_MOST_SLENDER = MOST_HARMONICS


def takes_pairs(
    area: float, shape: PotentialShape, width: float, *, samples: int, method: Method = "auto"
) -> bool:
    """Whether so many samples on so much area interact pair by pair without a look at the series."""
    within = min(1.0, math.pi * shape.reach**2 / area)
    slender = shape.reach > 2.0 * math.sqrt(2.0) * _MOST_SLENDER * width
    return method == "direct" or (
        method == "auto" and (slender or samples**2 * within <= _FEW_PAIRS)
    )


def choose_samples(
    x_range: Interval,
    y_range: Interval,
    shape: PotentialShape,
    width: float,
    strength: float,
    *,
    samples: int,
    tolerance: float,
    method: Method = "auto",
) -> SampleInteraction | SamplePairs:
    """The interaction of so many samples; see `SampleInteraction` for the other arguments.

    "auto" takes pairs where they are few and where harmonics cannot reach the tolerance, as for
    slender particles; the choice depends on the arguments only, not on the machine.

    Raises
    ------
    InputError
        For "harmonics" where they cannot reach the tolerance.
    """
    pairs = SamplePairs(x_range, y_range, shape, strength)
    area = (x_range[1] - x_range[0]) * (y_range[1] - y_range[0])
    if takes_pairs(area, shape, width, samples=samples, method=method):
        return pairs
    try:
        return SampleInteraction(x_range, y_range, shape, width, strength, tolerance)
    except InputError:
        if method == "harmonics":
            raise
        return pairs
