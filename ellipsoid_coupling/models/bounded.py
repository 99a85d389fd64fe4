"""Particles in a fluid that edges bound: their start, their fates, and what the monitors see of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.diagnostics import survey_particles
from ellipsoid_coupling.geometry.edge_grid import count_in_solid, off_edges
from ellipsoid_coupling.geometry.fate_codes import FIRST_PATCH, INSIDE, NOT_YET
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges
from ellipsoid_coupling.models.base import Health, Setup
from ellipsoid_coupling.models.ended import count_inside
from ellipsoid_coupling.models.inlets import scene_births
from ellipsoid_coupling.particles.births import Births
from ellipsoid_coupling.particles.fates import Fates, all_inside
from ellipsoid_coupling.particles.state import ParticleState
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.stepping.step_control import LARGEST_FORCE, LARGEST_TORQUE

Floats = NDArray[np.float64]


def require_fluid_at_inlets(scene: Scene) -> None:
    """Refuse an inlet without a fluid that carries particles in.

    Raises
    ------
    InputError
    """
    if scene.flow is None and scene.has_inflow:
        raise InputError(
            f"scene {scene.name}, key boundaries",
            "a fluid, [flow], that carries particles in through an inlet",
            "none",
            "Give a flow, or another kind of boundary.",
        )


def require_start_in_fluid(setup: Setup, edges: FluidEdges, x: Floats, y: Floats) -> None:
    """Refuse particles that start in a solid or outside of the fluid.

    Raises
    ------
    InputError
        With the position of the first one.
    """
    outside = ~edges.inside(x, y)
    if outside.any():
        first = float(x[outside][0]), float(y[outside][0])
        raise InputError(
            f"scene {setup.scene.name}, key start",
            "particles that start in the fluid, within the domain and the patches of the case",
            f"{np.count_nonzero(outside)} of {x.size} in a solid or outside, the first at "
            f"({first[0]:.6g}, {first[1]:.6g})",
            "Move the start, or give another flow.",
        )


def off_the_edges(edges: FluidEdges, points: Floats) -> Floats:
    """Points (K, 2, n) in the fluid, of which those on an edge are put before it by rounding."""
    moved = points.copy()
    for block in moved:
        off_edges(edges.grid, block[0], block[1])
    return moved


def with_fates(
    start: ParticleState, setup: Setup, edges: FluidEdges, evenly: bool
) -> ParticleState:
    """Particles at their start, with fates where they can end, and slots for what inlets feed in."""
    blocks, degrees, number = start.position.shape
    births = scene_births(setup, edges, blocks, number, evenly)
    if births is None and not edges.ends_any:
        return start
    slots = 0 if births is None else births.time.shape[1]
    fates = all_inside(blocks, number + slots)
    fates.code[:, number:] = NOT_YET
    position, velocity, still = np.zeros((3, blocks, degrees, number + slots))
    position[:, :, :number], velocity[:, :, :number] = start.position, start.velocity
    if births is not None:
        position[:, :, number:] = births.position
    frozen = (fates.code != INSIDE).astype(np.uint8)
    return ParticleState(position, velocity, still, start.clock, None, frozen, fates, births)


def start_count(state: ParticleState) -> int:
    """How many particles there are at the start, which hold a mass of 1."""
    return (
        state.position[:, 0].size
        if state.births is None
        else len(state.position) * state.births.first
    )


def restore_fates(state: ParticleState, boundaries: int) -> None:
    """Set who takes part, and how many were fed in, by fates from a checkpoint.

    Raises
    ------
    InputError
        For fates that no run has, which kernels would take as indices.
    """
    fates, births, frozen = state.fates, state.births, state.frozen
    assert fates is not None
    assert frozen is not None
    code = fates.code
    first = code.shape[1] if births is None else births.first
    unborn = code[:, first:] == NOT_YET
    sound = (code >= NOT_YET) & (code < FIRST_PATCH + boundaries)
    # Slots are born one after the other.
    if not sound.all() or (code[:, :first] == NOT_YET).any() or (np.diff(unborn * 1) < 0).any():
        raise InputError("checkpoint", "fates of a run", "others", "Remove it to start again.")
    frozen[...] = code != INSIDE
    if births is not None:
        births.born[...] = np.count_nonzero(~unborn, axis=1)


def inside_of(fates: Fates | None, state: ParticleState) -> int:
    """How many particles are in the fluid."""
    return state.position[:, 0].size if fates is None else count_inside(fates)


def came_in(births: Births | None) -> int:
    """How many particles inlets have fed in so far."""
    return 0 if births is None else int(births.born.sum())


def health_at_edges(state: ParticleState, edges: FluidEdges, start: int) -> Health:
    """Of all realisations together; none that is alive may be in a solid."""
    v, omega, _, _, _ = survey_particles(*state[:3], None)
    inside, number = inside_of(state.fates, state), state.position[:, 0].size
    # Those that take no part stand still, and count in no mean.
    share = np.sqrt(number / max(inside, 1))
    clock = state.clock
    forces = float(clock[:, LARGEST_FORCE].max()), float(clock[:, LARGEST_TORQUE].max())
    ended = number - inside
    if state.births is not None:
        ended -= int(np.count_nonzero(state.fates.code == NOT_YET)) if state.fates else 0
    return Health(
        inside / start,
        0.0,
        (share * v, share * omega),
        forces,
        count_in_solid(edges.grid, state.position[:, 0], state.position[:, 1]),
        (ended - came_in(state.births)) / start,
    )
