"""Inlets for particles: how many come in until the last save time, when and where, and how they move.

A density rho (mass per area, of a mass of 1 at the start) that the fluid carries in through a patch brings

    rho N int max(u(t) . n, 0) ds          particles in a unit of time,

N of them at the start, each with the weight 1/N; n is the inner normal. Where they come in has the density
u . n along the patch. Each moves and turns with the fluid at its birth, at the inlet's angle. In a flow
that changes the rate does, too; as the fluid is known beforehand, so are all births (`particles.inflow`).

Particles of the microscopic model know nothing of one another upstream. So their births are a Poisson
process, drawn from the stream of each realisation: counts in any part of the fluid then have the law of
independent particles, as those of the start have it. The samples of a density without noise are points of a
quadrature instead, and come in evenly, in time and along the patch.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.files.limits import in_words, memory_left
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.geometry.edge_grid import ALONG_X, ALONG_Y, GAP, LENGTH, X, Y
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.fluid_motion import fluid_motion
from ellipsoid_coupling.models.from_scene import scene_external
from ellipsoid_coupling.particles.births import Births
from ellipsoid_coupling.particles.inflow import Inflow
from ellipsoid_coupling.particles.noise import birth_stream
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
    inflow : Inflow
        Mass through the pieces, P of them, until the last save time.
    start, way : (P, 2)
        Where each piece begins, inside of its edge, and the way to its end.
    angle : (P,)
    """

    inflow: Inflow
    start: Floats
    way: Floats
    angle: Floats

    def positions(self, time: Floats, part: Floats) -> tuple[Floats, Floats]:
        """Positions (2, n) and angles (n,) of what comes in at times (n,), at parts (n,) of all inlets."""
        piece, share = self.inflow.pieces(time, part)
        return (self.start[piece] + share[:, None] * self.way[piece]).T, self.angle[piece]


class _Pieces(NamedTuple):
    """Pieces of edges: start, way and inner normal (P, 2), width and patch (P,)."""

    start: Floats
    way: Floats
    normal: Floats
    width: Floats
    patch: NDArray[np.int64]


def scene_source(setup: Setup, edges: FluidEdges) -> Source | None:
    """What the inlets of a scene feed in; None without inlets, or where the fluid comes in at none."""
    flow, scene = setup.flow, setup.scene
    inlets = [p for p, part in enumerate(edges.parts) if keys_of(part.kind).inflow]
    chosen = np.flatnonzero(np.isin(edges.grid.patches, inlets))
    if flow is None or chosen.size == 0:
        return None
    found = [_pieces(edges, int(e), chosen.size) for e in chosen]
    pieces = _Pieces(*(np.concatenate(column) for column in zip(*found, strict=True)))
    parameters = [part.parameters for part in edges.parts]
    density = np.array([one.get("density", 0.0) for one in parameters])[pieces.patch]
    angle = np.array([one.get("angle", scene.start.angle) for one in parameters])[pieces.patch]
    middle = pieces.start + 0.5 * pieces.way
    density = density * edges.inside(middle[:, 0], middle[:, 1])
    mass = np.array([density * _flux(field, pieces) for field in flow.steady_fields()])
    fed = mass.max(axis=0) > 0.0
    if not fed.any():
        return None
    end = scene.times[-1]
    inflow = Inflow(mass[:, fed], *flow.given_times(end), end)
    if inflow.mass <= 0.0:
        return None
    return Source(inflow, pieces.start[fed], pieces.way[fed], angle[fed] - scene.start.turns)


def _pieces(edges: FluidEdges, e: int, count: int) -> _Pieces:
    """Those of edge e, one of `count`."""
    line = edges.grid.lines[e]
    number = max(_POINTS // count, _FEWEST_POINTS)
    along, normal = line[[ALONG_X, ALONG_Y]], np.array([-line[ALONG_Y], line[ALONG_X]])
    width = line[LENGTH] / number
    start = line[[X, Y]] + _BEFORE * line[GAP] * normal
    start = start + (np.arange(number) * width)[:, None] * along
    way, inwards = np.broadcast_to([width * along, normal], (number, 2, 2)).swapaxes(0, 1)
    patch = np.full(number, edges.grid.patches[e])
    return _Pieces(start, way, inwards, np.full(number, width), patch)


def _flux(flow: FlowField, pieces: _Pieces) -> Floats:
    """What flows in through each piece, (P,): its width times u . n in its middle."""
    middle = pieces.start + 0.5 * pieces.way
    sample = flow.evaluate(middle[:, 0], middle[:, 1])
    normal_x, normal_y = pieces.normal.T
    return np.asarray((normal_x * sample.velocity_x + normal_y * sample.velocity_y) * pieces.width)


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
    inflow = source.inflow
    _require_room(setup, inflow.mass * number * blocks)
    if evenly:
        drawn = _even_births(inflow, number, blocks)
    else:
        first = setup.first_realisation
        drawn = [_random_births(setup.seed, first + k, inflow, number) for k in range(blocks)]
    slots = max(len(times) for times, _ in drawn)
    degrees = 3 if setup.terms.angle else 2
    time = np.full((blocks, slots), np.inf)
    position = np.empty((blocks, 3, slots))
    # Slots that stay empty need a position as well: the first piece's.
    position[...] = np.array([*source.start[0], source.angle[0]])[:, None]
    for k, (times, parts) in enumerate(drawn):
        time[k, : len(times)] = times
        position[k, :2, : len(times)], position[k, 2, : len(times)] = source.positions(times, parts)
    motion = _at_birth(setup, inflow, time, position)
    kept = (np.ascontiguousarray(values[:, :degrees]) for values in (position, *motion))
    return Births(number, np.zeros(blocks, np.int64), time, *kept)


def _require_room(setup: Setup, expected: float) -> None:
    needed, left = expected * _SLOT_BYTES, memory_left()
    if not needed < left:
        raise InputError(
            f"scene {setup.scene.name}, key boundaries",
            f"inlets whose particles fit into the {in_words(left)} that are left",
            f"{expected:.3g} of them until the last of times, which take {in_words(needed)}",
            "Give a smaller density, fewer particles or a shorter time.",
        )


def _random_births(
    seed: int, realisation: int, inflow: Inflow, number: int
) -> tuple[Floats, Floats]:
    """Times and parts of the source of a Poisson process: a number of births, then each by itself."""
    stream = birth_stream(seed, realisation)
    count = int(stream.poisson(inflow.mass * number))
    times = inflow.when(inflow.mass * np.sort(stream.random(count)))
    return times, stream.random(count)


def _even_births(inflow: Inflow, number: int, blocks: int) -> list[tuple[Floats, Floats]]:
    """Times and parts of the source, dealt out to the blocks in turn: one for each unit of mass."""
    units = number * blocks
    j = np.arange(int(np.floor(inflow.mass * units + 0.5)), dtype=np.float64)
    times = inflow.when((j + 0.5) / units)
    parts: Floats = np.mod((j + 0.5) * _GOLDEN, 1.0)
    return [(times[k::blocks], parts[k::blocks]) for k in range(blocks)]


def _at_birth(
    setup: Setup, inflow: Inflow, time: Floats, position: Floats
) -> tuple[Floats, Floats]:
    """Velocity and drift (R, 3, B) of particles born at times (R, B) and positions (R, 3, B).

    Both are linear in the fluid, so that each of its fields counts by its part at the time.
    """
    assert setup.flow is not None
    flat = np.ascontiguousarray(position.swapaxes(0, 1)).reshape(3, -1)
    found = np.zeros((2, *flat.shape))
    for number, field in enumerate(setup.flow.steady_fields()):
        weight = inflow.weights(time.ravel(), number)
        some = np.flatnonzero(weight > 0.0)
        if some.size:
            at = np.ascontiguousarray(flat[:, some])
            found[0, :, some] += (weight[some] * fluid_motion(setup.scene, field, at)).T
            found[1, :, some] += (weight[some] * _drift_at(setup, field, at)).T
    velocity, drift = found.reshape(2, 3, *time.shape).swapaxes(1, 2)
    return velocity, drift


def _drift_at(setup: Setup, field: FlowField, position: Floats) -> Floats:
    """The drift (3, n) at positions (3, n) of what acts on a particle alone, in one field of the fluid."""
    force = np.zeros_like(position)
    drift = Drift(scene_external(replace(setup, flow=field)), None)
    turns = 3 if setup.terms.angle else 2
    particle_forces(drift, 0.0, position[:turns], force[:turns])
    return force
