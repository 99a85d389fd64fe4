"""L1 distances of densities and angle distributions on common bins, and the sampling error."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.geometry.histograms import FULL_TURN
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

DENSITY_CELLS = 20
ANGLE_BINS = 60


class Errors(NamedTuple):
    """L1 distances at each saved time, (T,) each; 0 is equality, 2 no overlap at all."""

    density: Floats
    angle: Floats


def centred_angles(result: Result) -> Floats:
    """The masses of 60 angle bins centred on the multiples of 6 degrees, (T, 60), sum 1.

    Particles start at multiples of a right angle and may stay there: on the edge of two bins, where
    rounding decided between them.
    """
    halves = result.angle_distribution(2 * ANGLE_BINS) * FULL_TURN / (2 * ANGLE_BINS)
    return halves[:, ::2] + np.roll(halves[:, 1::2], 1, axis=1)


def errors_against(result: Result, reference: Result) -> Errors:
    """The distances of two results of the same scene, on 20 x 20 cells and 60 angles.

    The angle bins are those of `centred_angles`.

    Raises
    ------
    InputError
        If the two were not saved at the same times.
    """
    if not np.array_equal(result.times, reference.times):
        raise InputError(
            f"{result.model} and {reference.model}",
            f"the same save times {list(reference.times)}",
            str(list(result.times)),
            "Compare runs of one scene that both came to their end.",
        )
    domain = reference.scene.domain
    area = domain.width * domain.height / DENSITY_CELLS**2
    density = result.density(DENSITY_CELLS) - reference.density(DENSITY_CELLS)
    angle = centred_angles(result) - centred_angles(reference)
    return Errors(np.abs(density).sum(axis=(1, 2)) * area, np.abs(angle).sum(axis=1))


def sampling_errors(ensemble: Result) -> Errors:
    """The expected L1 error that an ensemble has by its finite number of realisations.

    Half the distance between its two halves: each half errs by sqrt(2) of the whole, their
    difference by sqrt(2) again. One realisation is split by particles instead.
    """
    axis = 1 if ensemble.variables["x"].shape[1] > 1 else 2
    count = ensemble.variables["x"].shape[axis] // 2

    def part(first: int) -> Result:
        index = (slice(None),) * axis + (slice(first, first + count),)
        chosen = {name: values[index] for name, values in ensemble.variables.items()}
        return replace(ensemble, variables=chosen)

    halves = errors_against(part(0), part(count))
    return Errors(0.5 * halves.density, 0.5 * halves.angle)
