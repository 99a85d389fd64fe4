"""From a scene to what kernels take: each part is made here once, or is None where absent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms, cell_tables
from ellipsoid_coupling.finite_volume.grid import Grid
from ellipsoid_coupling.flow import FlowArrays
from ellipsoid_coupling.geometry.boundaries import periodic_axes
from ellipsoid_coupling.interaction import Walls
from ellipsoid_coupling.interaction.pairs.cells import Sources, cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs
from ellipsoid_coupling.interaction.particle_forces import Drift
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.flow_fit import can_be_left
from ellipsoid_coupling.models.staircase import Staircase
from ellipsoid_coupling.particles.state import Rates
from ellipsoid_coupling.physics.drift import EVERYWHERE, External, Fluid
from ellipsoid_coupling.physics.potential import PotentialShape, potential_shape
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]


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
        grid=cell_grid(scene.domain.x, scene.domain.y, shape.reach, periodic_axes(scene)),
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


def scene_fluid(setup: Setup) -> Fluid | None:
    """Drag and Jeffery's term of `setup`'s scene; None without a fluid."""
    part, particles = setup.scene.flow, setup.scene.particles
    if part is None or setup.flow is None:
        return None
    return Fluid(
        flow=setup.flow.arrays,
        drag=part.drag,
        angular_drag=part.angular_drag,
        shape_factor=potential_shape(particles.length, particles.width).shape_factor,
        rim=mesh[5:9] if (mesh := scene_mesh(setup)) is not None else EVERYWHERE,
    )


def scene_external(setup: Setup) -> External:
    """What acts on each particle, or cell, by itself; a term that the scene lacks is None."""
    scene = setup.scene
    return External(scene_fluid(setup), scene.outer_potential, scene.angular_potential)


def scene_drift(setup: Setup) -> Drift:
    """The drift of `setup`'s scene; a term that it lacks is None."""
    return Drift(scene_external(setup), scene_pairs(setup.scene, setup.terms.torque))


def scene_mesh(setup: Setup) -> FlowArrays | None:
    """The flow, if particles can leave its mesh; None where they cannot."""
    flow = setup.flow
    return flow.arrays if flow is not None and can_be_left(setup.scene, flow) else None


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
    steady, turning = cell_tables(external, t, grid.x, grid.y)
    if stairs is not None and external.fluid is not None:
        still, _ = cell_tables(External(None, external.outer, None), t, grid.x, grid.y)
        means = np.array([stairs.faces[axis].mean for axis in (-1, -2)])
        steady = (still + external.fluid.drag * means) * stairs.cells.inside
        turning = turning * stairs.cells.inside
    pushed = external.fluid is not None or external.outer is not None
    return CellTerms(
        steady=steady if pushed else None,
        turning=turning if external.fluid is not None and turns else None,
        angular=external.angular,
        damping=float(rates.damping[0]),
        angular_damping=float(rates.damping[2]) if turns else 0.0,
        inverse_mass=1.0 / scene.particles.mass,
        inverse_inertia=1.0 / scene.particles.inertia,
    )


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
    outside = ~setup.flow.evaluate(x, y).inside
    if outside.any():
        raise InputError(
            f"scene {setup.scene.name}, key flow.field",
            "a flow that covers the whole domain",
            f"{np.count_nonzero(outside)} cells outside it, the first at "
            f"({x[outside][0]:.6g}, {y[outside][0]:.6g})",
            "Make the domain smaller or give another flow.",
        )
