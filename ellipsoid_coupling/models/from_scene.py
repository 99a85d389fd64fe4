"""From a scene to what kernels take: each part is made here once, or is None where absent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms, cell_tables
from ellipsoid_coupling.finite_volume.grid import Grid
from ellipsoid_coupling.finite_volume.moving_tables import MovingTables
from ellipsoid_coupling.flow import FlowArrays, FlowField
from ellipsoid_coupling.flow.interval import Interval
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.geometry.boundaries import periodic_axes
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges, fluid_edges
from ellipsoid_coupling.geometry.patches import is_outlined
from ellipsoid_coupling.interaction import Walls
from ellipsoid_coupling.interaction.pairs.cells import Sources, cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs
from ellipsoid_coupling.interaction.particle_forces import Drift
from ellipsoid_coupling.interaction.wall_lines import ghosts_along
from ellipsoid_coupling.interaction.walls import GhostParticles
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.flow_fit import can_be_left
from ellipsoid_coupling.models.staircase import Staircase, StairsAt
from ellipsoid_coupling.particles.state import Rates
from ellipsoid_coupling.physics.drift import EVERYWHERE, External, Fluid
from ellipsoid_coupling.physics.outer import scene_outer
from ellipsoid_coupling.physics.potential import PotentialShape, potential_shape
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.sides import SIDES

Floats = NDArray[np.float64]


def scene_walls(
    scene: Scene, shape: PotentialShape, stairs: Staircase | None = None
) -> Walls | None:
    """The walls of a scene's domain with both kinds of ghosts; None without [walls].

    Where patches bound the fluid of `stairs`, what a wall does is all that counts: see `curved_walls`.

    Raises
    ------
    InputError
        For walls that are no sides of the domain.
    """
    part = scene.walls
    if part is None or scene.interaction is None:
        return None
    outlined = stairs is not None and stairs.outline is not None
    if not scene.wall_sides and not outlined:
        raise InputError(
            f"scene {scene.name}, key walls.sides",
            "walls on sides of the domain, where no patches of a case bound the fluid",
            f"{', '.join(part.sides or ('none that reflects',))}",
            "Name sides, or give a flow whose case has these patches.",
        )
    return Walls(
        domain=(scene.domain.x, scene.domain.y),
        sides=scene.wall_sides or SIDES,
        length=scene.particles.length,
        shape=shape,
        strength=scene.interaction.strength,
        particles=scene.particles.number,
        strength_factor=part.strength_factor,
        ghost_density=part.ghost_density,
    )


def scene_ghosts(scene: Scene, edges: FluidEdges | None) -> GhostParticles | None:
    """The ghost particles on a scene's walls, sides of its domain or edges; None without [walls]."""
    shape = potential_shape(scene.particles.length, scene.particles.width)
    if edges is None:
        walls = scene_walls(scene, shape)
        return None if walls is None else walls.ghost_particles()
    if scene.walls is None or scene.interaction is None:
        return None
    return ghosts_along(edges.walls(scene.walls.sides), scene.particles.length)


def _ghost_sources(ghosts: GhostParticles, pairs: Pairs) -> Sources:
    c2, s2 = np.cos(2.0 * ghosts.angle), np.sin(2.0 * ghosts.angle)
    return sort_by_cell(ghosts.x, ghosts.y, c2, s2, pairs.grid)[0]


def scene_pairs(scene: Scene, torque: bool, edges: FluidEdges | None = None) -> Pairs | None:
    """The pair interaction with its 1/N, 1/m and 1/I_c, ghost particles included; None without."""
    if scene.interaction is None:
        return None
    particles, strength = scene.particles, scene.interaction.strength
    shape = potential_shape(particles.length, particles.width)
    scaled = strength / particles.number
    pairs = Pairs(
        grid=cell_grid(scene.domain.x, scene.domain.y, shape.reach, periodic_axes(scene)),
        shape=shape,
        force_weight=scaled / particles.mass,
        torque_weight=scaled / particles.inertia if torque else None,
        ghosts=None,
        ghost_factor=0.0,
    )
    ghosts = scene_ghosts(scene, edges)
    if ghosts is None or scene.walls is None:
        return pairs
    sources = _ghost_sources(ghosts, pairs)
    return pairs._replace(ghosts=sources, ghost_factor=scene.walls.strength_factor)


def scene_fluid(setup: Setup) -> Fluid | None:
    """Drag and Jeffery's term of `setup`'s scene; None without a fluid."""
    part, particles = setup.scene.flow, setup.scene.particles
    if part is None or setup.flow is None:
        return None
    return Fluid(
        flow=setup.flow.in_time,
        drag=part.drag,
        angular_drag=part.angular_drag,
        shape_factor=potential_shape(particles.length, particles.width).shape_factor,
        rim=mesh[5:9] if (mesh := scene_mesh(setup)) is not None else EVERYWHERE,
    )


def scene_external(setup: Setup) -> External:
    """What acts on each particle, or cell, by itself; a term that the scene lacks is None."""
    scene = setup.scene
    return External(scene_fluid(setup), scene_outer(scene), scene.angular_potential)


def scene_drift(setup: Setup, edges: FluidEdges | None = None) -> Drift:
    """The drift of `setup`'s scene; a term that it lacks is None.

    edges : as of `scene_edges`, on which walls have their ghosts
    """
    return Drift(scene_external(setup), scene_pairs(setup.scene, setup.terms.torque, edges))


def scene_edges(setup: Setup) -> FluidEdges | None:
    """`flow_edges` of `setup`'s scene and flow."""
    return flow_edges(setup.scene, setup.flow)


def flow_edges(scene: Scene, flow: FlowField | None) -> FluidEdges | None:
    """What bounds the fluid; None where the domain is a box that reflects or may be left.

    Patches of the flow's case, or else the sides of the domain, where particles come in through one.

    Raises
    ------
    InputError
        For patches that do not fit the scene.
    """
    if not _has_edges(scene, flow):
        return None
    patches = flow.outline if flow is not None and is_outlined(scene, flow) else None
    return fluid_edges(scene, polygon_outline([]) if patches is None else patches)


def _has_edges(scene: Scene, flow: FlowField | None) -> bool:
    return flow is not None and (is_outlined(scene, flow) or scene.has_inflow)


def scene_mesh(setup: Setup) -> FlowArrays | None:
    """The flow, if particles can leave its mesh; None where they cannot, or where edges bound the fluid."""
    flow = setup.flow
    if flow is None or _has_edges(setup.scene, flow) or not can_be_left(setup.scene, flow):
        return None
    return flow.arrays


def scene_rates(setup: Setup) -> Rates:
    """Damping gamma + A^2/2 and noise amplitude of each degree of freedom.

    This gamma is that of -gamma v alone, which schemes solve exactly; gamma u is in the drift.
    """
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


def scene_cell_terms(
    setup: Setup, grid: Grid, t: float = 0.0, stairs: Staircase | None = None
) -> CellTerms:
    """What drives the cells of an r-grid, as of time t; a term that the scene lacks is None.

    On a staircase the fluid's velocity in a cell is the mean of those at its faces, and no term acts in
    solids.

    Raises
    ------
    InputError
        If a cell lies outside the flow.
    """
    scene, turns = setup.scene, setup.terms.angle
    external, rates = scene_external(setup), scene_rates(setup)
    if stairs is None:
        require_cells_inside(setup, grid)
    steady, turning = _tables(external, t, grid, stairs)
    pushed = external.fluid is not None or external.outer is not None
    return CellTerms(
        steady=steady if pushed else None,
        turning=turning if external.fluid is not None and turns else None,
        angular=external.angular,
        damping=float(rates.damping[0]),
        angular_damping=float(rates.damping[2]) if turns else 0.0,
        inverse_mass=1.0 / scene.particles.mass,
        inverse_inertia=1.0 / scene.particles.inertia,
        in_fluid=external.fluid is not None and external.fluid.drag > 0.0,
    )


def _tables(
    external: External, t: float, grid: Grid, stairs: Staircase | None
) -> tuple[Floats, Floats]:
    """`cell_tables`, on a staircase as `scene_cell_terms` says."""
    steady, turning = cell_tables(external, t, grid.x, grid.y)
    if stairs is None or external.fluid is None:
        return steady, turning
    still, _ = cell_tables(External(None, external.outer, None), t, grid.x, grid.y)
    means = np.array([stairs.faces[axis].mean for axis in (-1, -2)])
    inside = stairs.cells.inside
    return (still + external.fluid.drag * means) * inside, turning * inside


def scene_moving_tables(
    setup: Setup, stairs_at: StairsAt, grid: Grid, terms: CellTerms
) -> MovingTables | None:
    """What brings the `terms` of an r-grid to a time; None where nothing changes."""
    external = scene_external(setup)
    if external.fluid is None or not isinstance(external.fluid.flow, Interval):
        return None

    def tables_at(t: float) -> tuple[Floats, Floats]:
        return _tables(external, t, grid, stairs_at(t))

    return MovingTables(tables_at, external.fluid.flow, terms)


def require_cells_inside(setup: Setup, grid: Grid) -> None:
    """Refuse a grid with a cell whose centre is not in the fluid.

    Raises
    ------
    InputError
        With the place of the first one.
    """
    if setup.flow is None:
        return
    x, y = np.meshgrid(grid.x, grid.y)
    outside = ~setup.flow.at(0.0).evaluate(x, y).inside
    if outside.any():
        raise InputError(
            f"scene {setup.scene.name}, key flow.field",
            "a flow that covers the whole domain",
            f"{np.count_nonzero(outside)} cells outside it, the first at "
            f"({x[outside][0]:.6g}, {y[outside][0]:.6g})",
            "Make the domain smaller or give another flow.",
        )
