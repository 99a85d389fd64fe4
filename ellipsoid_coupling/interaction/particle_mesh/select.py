"""Which way to compute the interaction of samples: pair by pair where that is less work, or possible."""

from __future__ import annotations

import math
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import in_words, memory_limit
from ellipsoid_coupling.geometry.boundaries import periodic_axes
from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.nodes import (
    most_harmonics,
    nodes_per_width,
    slenderness,
)
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.interaction.select import ENTRY_COST, POINT_COST, Method
from ellipsoid_coupling.physics.potential import PotentialShape, potential_shape
from ellipsoid_coupling.scenes import Scene

# How far beyond an open domain samples interact, in ranges of the potential.
_RANGES_BEYOND = 2.0
# Pairs within reach (2 ms on one thread) up to which harmonics never pay: their transforms take as long,
# however short they are.
_FEW_PAIRS = 3e5


class Samples(NamedTuple):
    """What a cloud of samples asks of its interaction.

    Attributes
    ----------
    region : Region
        Where samples interact.
    start : (width, height)
        Of the box that they start in.
    shape : PotentialShape
    width : float
        The particles' width D.
    strength : float
        eps0.
    number : int
        How many there are.
    tolerance : float
        `numerics.harmonics_tolerance`; see `forces` for the bounds that hold.
    method : "auto", "direct" or "harmonics"
    """

    region: Region
    start: tuple[float, float]
    shape: PotentialShape
    width: float
    strength: float
    number: int
    tolerance: float
    method: Method = "auto"


def scene_samples(scene: Scene, number: int) -> Samples | None:
    """Of a scene with `number` samples; None without interaction."""
    if scene.interaction is None:
        return None
    particles, domain, start = scene.particles, scene.domain, scene.start
    shape = potential_shape(particles.length, particles.width)
    beyond = _RANGES_BEYOND * shape.reach
    left, right, bottom, top = (
        beyond if side.particles == "leave" else 0.0 for side in scene.sides.values()
    )
    region = Region(
        (domain.x[0] - left, domain.x[1] + right),
        (domain.y[0] - bottom, domain.y[1] + top),
        periodic_axes(scene),
    )
    return Samples(
        region,
        (start.x[1] - start.x[0], start.y[1] - start.y[0]),
        shape,
        particles.width,
        scene.interaction.strength,
        number,
        scene.numerics.harmonics_tolerance,
        scene.numerics.interaction,
    )


def affordable_harmonics(samples: Samples) -> int:
    """How many harmonics a series may have; -1 where samples interact pair by pair without one.

    With "auto", as many as are less work than pairs for a cloud that has grown to the geometric mean
    of its start box and of the rectangle that it may fill. The choice depends on the arguments only,
    not on the machine.
    """
    if samples.method == "direct":
        return -1
    reach = samples.shape.reach
    h = samples.width / nodes_per_width(samples.shape, samples.width, samples.tolerance)
    sizes = samples.region.width, samples.region.height
    most = most_harmonics(sizes[0] * sizes[1] / h**2, reach / h)
    if samples.method == "harmonics":
        return most
    grown = [math.sqrt(start * size) for start, size in zip(samples.start, sizes, strict=True)]
    disc = math.pi * reach**2
    # In a cloud smaller than the disc all are within reach of each other.
    pairs = samples.number**2 * disc / max(grown[0] * grown[1], disc)
    if pairs <= _FEW_PAIRS:
        return -1
    # Transforms are padded by the reach, so that no image is felt.
    points = math.prod((size + reach) / h for size in grown)
    while most >= 0 and _work(2 * most + 1, points) > pairs:
        most -= 1
    # A series follows how sharply particles turn one another with more harmonics than L/D.
    return most if most >= slenderness(samples.shape, samples.width) - 1.0 else -1


def _work(functions: int, points: float) -> float:
    """Of one evaluation, in pairs: transforms there and back, and a block a frequency."""
    # A quarter of the frequencies: fields are real, and ky >= 0 tells the others.
    return POINT_COST * 2 * functions * points + ENTRY_COST * functions**2 * points / 4


def choose_samples(samples: Samples) -> SampleInteraction | SamplePairs:
    """The interaction of a cloud of samples.

    "auto" takes pairs, which are exact, where they are less work, and where harmonics cannot reach the
    tolerance, as for slender particles.

    Raises
    ------
    InputError
        For "harmonics" where they cannot reach the tolerance; where their spectra, of a cloud all
        over the rectangle, would not fit into the machine.
    """
    region, _, shape, width, strength, _, tolerance, method = samples
    pairs = SamplePairs(region, shape, strength)
    most = affordable_harmonics(samples)
    if most < 0 and method != "harmonics":
        return pairs
    try:
        found = SampleInteraction(region, shape, width, strength, tolerance, most)
    except InputError:
        if method == "harmonics":
            raise
        return pairs
    if found.spectra_bytes > memory_limit():
        raise InputError(
            "key numerics.harmonics_tolerance",
            f"spectra that fit into the {in_words(memory_limit())} of this machine",
            f"{tolerance:g}, for which they take {in_words(found.spectra_bytes)}",
            'Raise it, or set numerics.interaction = "direct".',
        )
    return found
