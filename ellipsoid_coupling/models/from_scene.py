"""From a scene to what kernels take: each part is made here once, or is None where absent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.diagnostics import survey_particles
from ellipsoid_coupling.finite_volume.grid import Grid
from ellipsoid_coupling.flow import FlowArrays, FlowField
from ellipsoid_coupling.geometry.boundaries import reflecting_box
from ellipsoid_coupling.interaction import Walls
from ellipsoid_coupling.interaction.drift import Drift
from ellipsoid_coupling.interaction.pairs.cells import Sources, cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs
from ellipsoid_coupling.models.base import Arrays, Counts, Health, Setup
from ellipsoid_coupling.models.failure_site import FLUID, OUTER, PAIRS, TORQUE, Spot, worst
from ellipsoid_coupling.models.flow_fit import can_be_left, rectangle, require_start_inside
from ellipsoid_coupling.particles.collisions import (
    GHOSTS_IN_REACH,
    contact_of,
    highest,
    steepest,
)
from ellipsoid_coupling.particles.noise import start_positions
from ellipsoid_coupling.particles.state import Contact, Limits, ParticleState, Rates
from ellipsoid_coupling.physics.potential import PotentialShape, potential_shape
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.stepping.step_control import (
    LARGEST_FORCE,
    LARGEST_TORQUE,
    TIME,
    step_log,
)

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]


def scene_walls(scene: Scene, shape: PotentialShape) -> Walls | None:
    """The scene's walls with both kinds of ghosts; None without [walls]."""
    part = scene.walls
    if part is None or scene.interaction is None:
        return None
    return Walls(
        domain=(scene.domain.x, scene.domain.y),
        sides=part.sides,
        length=scene.particles.length,
        shape=shape,
        strength=scene.interaction.strength,
        particles=scene.particles.number,
        strength_factor=part.strength_factor,
        ghost_density=part.ghost_density,
    )


def _ghost_sources(walls: Walls, pairs: Pairs) -> Sources:
    ghosts = walls.ghost_particles()
    c2, s2 = np.cos(2.0 * ghosts.angle), np.sin(2.0 * ghosts.angle)
    return sort_by_cell(ghosts.x, ghosts.y, c2, s2, pairs.grid)[0]


def scene_pairs(scene: Scene, torque: bool) -> Pairs | None:
    """The pair interaction with its 1/N, 1/m and 1/I_c, ghost particles included; None without."""
    if scene.interaction is None:
        return None
    particles, strength = scene.particles, scene.interaction.strength
    shape = potential_shape(particles.length, particles.width)
    scaled = strength / particles.number
    pairs = Pairs(
        grid=cell_grid(scene.domain.x, scene.domain.y, shape.reach),
        shape=shape,
        force_weight=scaled / particles.mass,
        torque_weight=scaled / particles.inertia if torque else None,
        ghosts=None,
        ghost_factor=0.0,
    )
    walls = scene_walls(scene, shape)
    if walls is None:
        return pairs
    return pairs._replace(ghosts=_ghost_sources(walls, pairs), ghost_factor=walls.strength_factor)


def scene_drift(setup: Setup) -> Drift:
    """The drift of `setup`'s scene; a term that it lacks is None."""
    scene, terms = setup.scene, setup.terms
    flow_part, outer, angular = scene.flow, scene.outer_potential, scene.angular_potential
    return Drift(
        flow=setup.flow.arrays if setup.flow is not None else None,
        drag=flow_part.drag if flow_part else 0.0,
        angular_drag=flow_part.angular_drag if flow_part and terms.angle else None,
        shape_factor=potential_shape(scene.particles.length, scene.particles.width).shape_factor,
        pairs=scene_pairs(scene, terms.torque),
        stiffness=outer.stiffness if outer else None,
        amplitude=angular.amplitude if angular and terms.angle else None,
        rim=mesh[5:9] if (mesh := scene_mesh(setup)) is not None else None,
    )


def scene_mesh(setup: Setup) -> FlowArrays | None:
    """The flow, if particles can leave its mesh; None where they cannot."""
    flow = setup.flow
    return flow.arrays if flow is not None and can_be_left(setup.scene, flow) else None


def scene_rates(setup: Setup) -> Rates:
    """Damping gamma + A^2/2 and noise amplitude of each degree of freedom."""
    flow, noise = setup.scene.flow, setup.scene.noise
    a, b = (noise.noise, noise.angular_noise) if noise else (0.0, 0.0)
    drag, angular_drag = (flow.drag, flow.angular_drag) if flow else (0.0, 0.0)
    degrees = 3 if setup.terms.angle else 2
    damping = np.array([drag + a * a / 2, drag + a * a / 2, angular_drag + b * b / 2])
    return Rates(
        damping=damping[:degrees],
        amplitude=np.array([a, a, b])[:degrees],
        first_noisy=0 if setup.terms.noise else 2,
        last_noisy=3 if setup.terms.angular_noise else 2,
    )


def scene_contact(setup: Setup, scale: Floats, number: int) -> Contact | None:
    """What bounds steps where so many particles meet; None without interaction."""
    scene, rates = setup.scene, scene_rates(setup)
    if scene.interaction is None:
        return None
    particles, strength = scene.particles, scene.interaction.strength
    shape = potential_shape(particles.length, particles.width)
    slope, torque = steepest(shape)
    weight = np.array([1.0 / particles.mass] * 2 + [1.0 / particles.inertia])[: len(scale)]
    crowd = strength * weight * np.array([slope, slope, torque])[: len(scale)] / scale
    ghosts = GHOSTS_IN_REACH * scene.walls.strength_factor if scene.walls else 0.0
    # The thermal energy of a degree of freedom, per mass, is A^2/(2 Gamma).
    noisy = rates.amplitude > 0.0
    heat = rates.amplitude[noisy] ** 2 / (2.0 * rates.damping[noisy] * weight[noisy])
    height = strength / number * highest(shape) if noisy.any() else 0.0
    return contact_of(
        shape,
        scene.numerics.tolerance,
        np.array([crowd / number, crowd, ghosts / particles.number * crowd]),
        scene.walls is not None,
        (height, float(heat.max(initial=0.0)), particles.mass),
    )


def scene_limits(setup: Setup, number: int | None = None) -> Limits:
    """Step size, tolerance, reflecting box, mesh that can be left, and contacts of the steppers.

    number : how many particles share the interaction's strength, the scene's number if None.
    """
    numerics = setup.scene.numerics
    scale = np.array([setup.scene.particles.length] * 2 + [1.0])[: 3 if setup.terms.angle else 2]
    box = reflecting_box(setup.scene)
    contact = scene_contact(setup, scale, number or setup.scene.particles.number)
    mesh = scene_mesh(setup)
    return Limits(numerics.time_step, numerics.tolerance, scale, box, mesh, contact)


def random_points(scene: Scene, seed: int, realisations: int) -> Floats:
    """Uniform over the start box, (realisations, 2, N): one stream of numbers a realisation."""
    low = np.array([scene.start.x[0], scene.start.y[0]])[:, None]
    high = np.array([scene.start.x[1], scene.start.y[1]])[:, None]
    number = scene.particles.number
    return np.array(
        [low + (high - low) * start_positions(seed, k, number) for k in range(realisations)]
    )


def start_at_rest(setup: Setup, points: Floats) -> tuple[Floats, Floats]:
    """Places (blocks, D, n) and velocities 0 of particles at `points` (blocks, 2, n).

    With start.points these are where all realisations start, whatever `points` are.

    Raises
    ------
    InputError
        If one starts in a solid or beyond the flow's mesh.
    """
    start = setup.scene.start
    places = np.array(start.places())
    if places.size:
        points = np.broadcast_to(places[:, :2].T, (setup.realisations, 2, len(places)))
    require_start_inside(setup.scene, setup.flow, points[:, 0], points[:, 1])
    blocks, _, size = points.shape
    place = np.full((blocks, 3 if setup.terms.angle else 2, size), start.own_angle)
    place[:, :2] = points
    if places.size:
        place[:, 2:] = places[:, 2]
    return place, np.zeros_like(place)


def none_frozen(setup: Setup, place: Floats) -> Flags | None:
    """The flags (blocks, n) of particles at `place` (blocks, D, n), none of which has left the mesh."""
    if scene_mesh(setup) is None:
        return None
    return np.zeros((place.shape[0], place.shape[2]), np.uint8)


def freeze_again(state: ParticleState, flow: FlowField | None) -> None:
    """Set the flags of a restored state: who has left the mesh lies outside of it, all others inside."""
    if state.frozen is not None and flow is not None:
        state.frozen[...] = ~flow.evaluate(state.place[:, 0], state.place[:, 1]).inside


def silence(state: ParticleState, noise: Floats) -> None:
    """Take the noise (blocks, steps, components, n) of frozen particles out, in place."""
    if state.frozen is not None:
        np.moveaxis(noise, -1, 1)[state.frozen != 0] = 0.0


def count_frozen(state: ParticleState) -> int:
    """How many particles have left the flow's mesh."""
    return 0 if state.frozen is None else int(np.count_nonzero(state.frozen))


def particle_counts(state: ParticleState) -> Counts:
    """The steps, how many particles have left the flow's mesh, and the mass, which these take along."""
    left, number = count_frozen(state), state.place[:, 0].size
    return step_log(state.clock) | {
        "particles_outside_flow": float(left),
        "mass_start": 1.0,
        "mass_end": (number - left) / number,
        "mass_left": left / number,
    }


def require_none_left(state: ParticleState, setup: Setup, name: str) -> None:
    """Where no side can be left, nothing may leave the flow's mesh.

    Raises
    ------
    RunError
        With the place of the first particle that has.
    """
    if setup.scene.has_sides("leave") or state.frozen is None or not state.frozen.any():
        return
    assert setup.flow is not None
    block, i = (int(index) for index in np.argwhere(state.frozen)[0])
    x, y = (float(value) for value in state.place[block, :2, i])
    row = block if len(state.clock) > 1 else 0
    raise RunError(
        f"{setup.scene.name}, {name}, realisation {block}, t = {state.clock[row, TIME]:.6g}: "
        f"a particle has left the flow at ({x:.6g}, {y:.6g}). Its mesh lies in "
        f"{rectangle(setup.flow)}, less the solids in it, which do not reflect. "
        'Use a smaller time step, a flow without solids, or domain.boundary = "open".'
    )


def _still_angles(scene: Scene) -> Floats | float:
    """Where nothing turns: each point's own angle, or that of all."""
    places = scene.start.places()
    return np.array([angle for _, _, angle in places]) if places else scene.start.own_angle


def particle_snapshot(state: ParticleState, scene: Scene) -> Arrays:
    """x, y, angle, velocity_x, velocity_y, angular_velocity, each a copy (R, N).

    Where nothing turns, the angle is that of the start and the angular velocity 0. Where the flow's
    mesh can be left, `frozen` is 1 for those that have.
    """
    place, velocity = state.place, state.velocity
    turns = place.shape[1] == 3
    still = np.zeros(place[:, 0].shape) + _still_angles(scene)
    return {
        "x": place[:, 0].copy(),
        "y": place[:, 1].copy(),
        "angle": (place[:, 2] if turns else still) + scene.start.turns,
        "velocity_x": velocity[:, 0].copy(),
        "velocity_y": velocity[:, 1].copy(),
        "angular_velocity": velocity[:, 2].copy() if turns else np.zeros_like(still),
        **({} if state.frozen is None else {"frozen": state.frozen.astype(np.float64)}),
    }


def particle_spot(state: ParticleState, setup: Setup) -> Spot:
    """The particle that is pulled hardest."""
    place, force = (np.moveaxis(a, 1, 0).reshape(a.shape[1], -1) for a in state[:3:2])
    i = worst(force)
    x, y = float(place[0, i]), float(place[1, i])
    scene, fluid, outer = setup.scene, np.zeros(2), np.zeros(2)
    if setup.flow is not None and scene.flow is not None:
        sample = setup.flow.evaluate(x, y)
        fluid = scene.flow.drag * np.array([float(sample.velocity_x), float(sample.velocity_y)])
    if scene.outer_potential is not None:
        outer = -scene.outer_potential.stiffness * np.array([x, y])
    terms = {
        FLUID: float(np.hypot(*fluid)),
        OUTER: float(np.hypot(*outer)),
        PAIRS: float(np.hypot(*(force[:2, i] - fluid - outer))),
        TORQUE: float(np.abs(force[2:, i]).max(initial=0.0)),
    }
    return Spot((x, y, *map(float, place[2:, i])), terms)


def particle_health(state: ParticleState, box: Floats | None) -> Health:
    """Of all realisations together, between the walls `box` of `Limits`."""
    place, velocity, force = state[:3]
    v, omega, _, _, outside = survey_particles(place, velocity, force, box)
    clock = state.clock
    forces = float(clock[:, LARGEST_FORCE].max()), float(clock[:, LARGEST_TORQUE].max())
    inside = 1.0 - count_frozen(state) / state.place[:, 0].size
    return Health(inside, 0.0, (v, omega), forces, outside)


def _steady_force(setup: Setup, grid: Grid) -> Floats | None:
    """Gamma u - grad V1 in every cell (2, ny, nx), the flow sampled at the cells' centres."""
    scene, flow = setup.scene, setup.flow
    if flow is None and scene.outer_potential is None:
        return None
    x, y = np.meshgrid(grid.x, grid.y)
    force = np.zeros((2, *grid.shape))
    if flow is not None and scene.flow is not None:
        sample = flow.evaluate(x, y)
        if not np.all(sample.inside):
            raise _outside(scene, x[~sample.inside], y[~sample.inside])
        force += scene.flow.drag * np.array([sample.velocity_x, sample.velocity_y])
    if scene.outer_potential is not None:
        force -= scene.outer_potential.stiffness * np.array([x, y])
    return force


def _outside(scene: Scene, x: Floats, y: Floats) -> InputError:
    return InputError(
        f"scene {scene.name}, key flow.field",
        "a flow that covers the whole domain",
        f"{x.size} cells outside it, the first at ({x[0]:.6g}, {y[0]:.6g})",
        "Make the domain smaller or give another flow.",
    )


def _jeffery_coefficients(setup: Setup, grid: Grid) -> Floats | None:
    """gamma_bar (a, b, c) of g = a + b sin 2 theta + c cos 2 theta in every cell, (3, ny, nx)."""
    scene, flow = setup.scene, setup.flow
    if flow is None or scene.flow is None or not setup.terms.angle:
        return None
    x, y = np.meshgrid(grid.x, grid.y)
    s = flow.evaluate(x, y)
    factor = potential_shape(scene.particles.length, scene.particles.width).shape_factor
    rotation = 0.5 * (s.duy_dx - s.dux_dy)
    along_sine, along_cosine = -factor * s.dux_dx, 0.5 * factor * (s.dux_dy + s.duy_dx)
    return np.asarray(scene.flow.angular_drag * np.array([rotation, along_sine, along_cosine]))


def scene_cell_terms(setup: Setup, grid: Grid) -> CellTerms:
    """What drives the cells of an r-grid; a term that the scene lacks is None.

    Raises
    ------
    InputError
        If a cell lies outside the flow.
    """
    rates, angular = scene_rates(setup), setup.scene.angular_potential
    return CellTerms(
        steady=_steady_force(setup, grid),
        turning=_jeffery_coefficients(setup, grid),
        amplitude=angular.amplitude if angular and setup.terms.angle else None,
        damping=float(rates.damping[0]),
        angular_damping=float(rates.damping[2]) if setup.terms.angle else 0.0,
        inverse_mass=1.0 / setup.scene.particles.mass,
        inverse_inertia=1.0 / setup.scene.particles.inertia,
    )
