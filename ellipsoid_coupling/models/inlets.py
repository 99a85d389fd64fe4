"""Inlets for particles: how many come in until the last save time, when and where, and how they move.

A density rho (mass per area, of a mass of 1 at the start) that the fluid carries in through a patch brings

    rho N int max(u . n, 0) ds          particles in a unit of time,

N of them at the start, each with the weight 1/N; n is the inner normal. Where they come in has the density
u . n along the patch. Each moves and turns with the fluid at its birth, at the inlet's angle.

Particles of the microscopic model know nothing of one another upstream. So their births are a Poisson
process, drawn from the stream of each realisation: counts in any part of the fluid then have the law of
independent particles, as those of the start have it. The samples of a density without noise are points of a
quadrature instead, and come in evenly, in time and along the patch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import in_words, memory_left
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.edge_grid import ALONG_X, ALONG_Y, GAP, LENGTH, X, Y
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.from_scene import scene_external
from ellipsoid_coupling.particles.births import Births
from ellipsoid_coupling.particles.noise import birth_stream
from ellipsoid_coupling.physics.jeffery import jeffery_coefficients, jeffery_rate
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes.sides import keys_of

Floats = NDArray[np.float64]

# Points on all edges of an inlet at which u . n is taken, and on one edge at least.
_POINTS, _FEWEST_POINTS = 512, 4
# Gaps before the edge that particles are born at: more than rounding.
_BEFORE = 2.0
# Bytes a slot takes at most, noise and snapshots apart.
_SLOT_BYTES = 400.0
# Multiples of it fill an interval most evenly, however many there are.
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class Source(NamedTuple):
    """What all inlets feed in.

    Attributes
    ----------
    rate : float
        Mass in a unit of time.
    cumulated : (m + 1,) float64
        Its part up to each piece of an inlet, from 0 to 1.
    start, way : (m, 2)
        Where each piece begins, inside of its edge, and the way to its end.
    angle : (m,)
    """

    rate: float
    cumulated: Floats
    start: Floats
    way: Floats
    angle: Floats

    def places(self, part: Floats) -> tuple[Floats, Floats]:
        """Places (2, n) and angles (n,) at parts of the mass in [0, 1)."""
        piece = np.searchsorted(self.cumulated, part, side="right") - 1
        piece = np.clip(piece, 0, len(self.start) - 1)
        share = (part - self.cumulated[piece]) / np.diff(self.cumulated)[piece]
        return (self.start[piece] + share[:, None] * self.way[piece]).T, self.angle[piece]


def scene_source(setup: Setup, edges: FluidEdges) -> Source | None:
    """What the inlets of a scene feed in; None without inlets, or where the fluid comes in at none."""
    flow, scene = setup.flow, setup.scene
    inlets = [p for p, part in enumerate(edges.parts) if keys_of(part.kind).inflow]
    chosen = np.flatnonzero(np.isin(edges.grid.patches, inlets))
    if flow is None or chosen.size == 0:
        return None
    pieces = [_pieces(flow, edges, int(e), chosen.size) for e in chosen]
    flux, start, way = (np.concatenate(column) for column in zip(*pieces, strict=True))
    patch = np.repeat(edges.grid.patches[chosen], [len(piece[0]) for piece in pieces])
    parameters = [part.parameters for part in edges.parts]
    density = np.array([one.get("density", 0.0) for one in parameters])[patch]
    angle = np.array([one.get("angle", scene.start.angle) for one in parameters])[patch]
    mass = density * flux
    fed = mass > 0.0
    if not fed.any():
        return None
    total = float(mass.sum())
    cumulated = np.concatenate(([0.0], np.cumsum(mass[fed]) / total))
    return Source(total, cumulated, start[fed], way[fed], angle[fed] - scene.start.turns)


def _pieces(
    flow: FlowField, edges: FluidEdges, e: int, count: int
) -> tuple[Floats, Floats, Floats]:
    """(flux in, start, way) of the pieces of edge e, one of `count`, that lie in the fluid."""
    line = edges.grid.lines[e]
    number = max(_POINTS // count, _FEWEST_POINTS)
    along, normal = line[[ALONG_X, ALONG_Y]], np.array([-line[ALONG_Y], line[ALONG_X]])
    width = line[LENGTH] / number
    start = line[[X, Y]] + _BEFORE * line[GAP] * normal
    start = start + (np.arange(number) * width)[:, None] * along
    middle = start + 0.5 * width * along
    inside = edges.inside(middle[:, 0], middle[:, 1])
    sample = flow.evaluate(middle[:, 0], middle[:, 1])
    inwards = normal[0] * sample.velocity_x + normal[1] * sample.velocity_y
    flux = np.where(inside, np.maximum(inwards, 0.0) * width, 0.0)
    return flux, start, np.broadcast_to(width * along, start.shape)


def scene_births(
    setup: Setup, edges: FluidEdges, blocks: int, number: int, evenly: bool
) -> Births | None:
    """The slots of `blocks` blocks of `number` particles at the start; None where nothing comes in.

    evenly : in time and along the inlets, over all blocks; else at random, each block by itself

    Raises
    ------
    InputError
        For more slots than memory has room for.
    """
    source = scene_source(setup, edges)
    if source is None:
        return None
    rate, end = source.rate * number, setup.scene.times[-1]
    _require_room(setup, rate * end * blocks)
    if evenly:
        drawn = _even_births(rate * blocks, end, blocks)
    else:
        first = setup.first_realisation
        drawn = [_random_births(setup.seed, first + k, rate, end) for k in range(blocks)]
    slots = max(len(times) for times, _ in drawn)
    degrees = 3 if setup.terms.angle else 2
    time = np.full((blocks, slots), np.inf)
    place = np.empty((blocks, 3, slots))
    # Slots that stay empty need a place as well: the first piece's.
    place[...] = np.array([*source.start[0], source.angle[0]])[:, None]
    for k, (times, parts) in enumerate(drawn):
        time[k, : len(times)] = times
        place[k, :2, : len(times)], place[k, 2, : len(times)] = source.places(parts)
    velocity = _moving_with_the_fluid(setup, place)[:, :degrees]
    place = np.ascontiguousarray(place[:, :degrees])
    return Births(
        number,
        np.zeros(blocks, np.int64),
        time,
        place,
        np.ascontiguousarray(velocity),
        _drift_at(setup, place),
    )


def _require_room(setup: Setup, expected: float) -> None:
    needed, left = expected * _SLOT_BYTES, memory_left()
    if not needed < left:
        raise InputError(
            f"scene {setup.scene.name}, key boundaries",
            f"inlets whose particles fit into the {in_words(left)} that are left",
            f"{expected:.3g} of them until the last of times, which take {in_words(needed)}",
            "Give a smaller density, fewer particles or a shorter time.",
        )


def _random_births(seed: int, realisation: int, rate: float, end: float) -> tuple[Floats, Floats]:
    """Times and parts of the source of a Poisson process: a number of births, then each by itself."""
    stream = birth_stream(seed, realisation)
    number = int(stream.poisson(rate * end))
    return end * np.sort(stream.random(number)), stream.random(number)


def _even_births(rate: float, end: float, blocks: int) -> list[tuple[Floats, Floats]]:
    """Times and parts of the source, dealt out to the blocks in turn."""
    j = np.arange(int(np.floor(rate * end + 0.5)), dtype=np.float64)
    times: Floats = (j + 0.5) / rate
    parts: Floats = np.mod((j + 0.5) * _GOLDEN, 1.0)
    return [(times[k::blocks], parts[k::blocks]) for k in range(blocks)]


def _moving_with_the_fluid(setup: Setup, place: Floats) -> Floats:
    """Velocity and rate of rotation (R, 3, B) of the fluid for particles at place (R, 3, B)."""
    flow, particles = setup.flow, setup.scene.particles
    assert flow is not None
    sample = flow.evaluate(place[:, 0], place[:, 1])
    shape_factor = potential_shape(particles.length, particles.width).shape_factor
    # The formulas are of numbers, and hold for arrays of them.
    coefficients: Any = plain(jeffery_coefficients)
    rate: Any = plain(jeffery_rate)
    turning = coefficients(1.0, sample.stretch, sample.dux_dy, sample.duy_dx, shape_factor)
    spin = rate(np.cos(2.0 * place[:, 2]), np.sin(2.0 * place[:, 2]), *turning)
    return np.stack((sample.velocity_x, sample.velocity_y, spin), axis=1)


def _drift_at(setup: Setup, place: Floats) -> Floats:
    """The drift (R, D, B) at place of what acts on a particle by itself."""
    force = np.empty_like(place)
    drift = Drift(scene_external(setup), None)
    for k in range(len(place)):
        particle_forces(drift, 0.0, place[k], force[k])
    return force
