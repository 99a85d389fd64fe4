"""From a scene to what kernels take: each part is made here once, or is None where absent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.finite_volume.grid import Grid
from ellipsoid_coupling.flow import FlowArrays
from ellipsoid_coupling.interaction import Walls
from ellipsoid_coupling.interaction.drift import Drift
from ellipsoid_coupling.interaction.pairs.cells import Sources, cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.flow_fit import can_be_left
from ellipsoid_coupling.particles.state import Rates
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
