"""What the q-equations share, `eq:macro_q_max` and `eq:macro_q_mono`: density over place and angle.

    d_t q         + div_r(q v)               + d_theta(q omega)         = 0
    d_t (q v)     + div_r(q v (x) v + p q I) + d_theta(q v omega)       = q S_1 - (A^2/2) q v
    d_t (q omega) + div_r(q v omega)         + d_theta(q omega^2 + p q) = q S_2 - (B^2/2) q omega

    S_1 = gamma (u - v) - K_1[q]/m - grad V1,   S_2 = gamma_bar (g - omega) - K_2[q]/I_c - dV2

The closure is the pressure coefficient p: 1 Maxwellian, 0 mono-kinetic. Scheme `paper`: FORCE in x,
y and theta, then implicit Euler. Scheme `accurate`: kick-drift-kick about a ballistic flight where
there is no pressure, else the scheme of finite_volume/well_balanced.py.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.boundary import grid_ghosts
from ellipsoid_coupling.finite_volume.cell_acceleration import largest_outer_torque
from ellipsoid_coupling.finite_volume.cell_forces import AngleGridForces
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.diagnostics import largest_magnitude
from ellipsoid_coupling.finite_volume.grid import cell_of, scene_grid, start_density
from ellipsoid_coupling.finite_volume.q_grid import QGrid, check_angles, start_angles
from ellipsoid_coupling.finite_volume.system import DENSITY, System, q_system
from ellipsoid_coupling.geometry.boundaries import periodic_axes, scene_boundaries
from ellipsoid_coupling.interaction import WALL_FRAMES, WallTable
from ellipsoid_coupling.interaction.convolution.q_kernel_spectra import distinct_angles
from ellipsoid_coupling.interaction.occupied import occupied_box
from ellipsoid_coupling.interaction.q_grid import AngleForces, AngleGridInteraction
from ellipsoid_coupling.models.base import Arrays, Setup
from ellipsoid_coupling.models.cell_model import CellModel, flux_of, stepper_of
from ellipsoid_coupling.models.failure_site import FLUID, OUTER, PAIRS, TORQUE, FailureSite, worst
from ellipsoid_coupling.models.from_scene import scene_cell_terms, scene_moving_tables, scene_walls
from ellipsoid_coupling.models.periodic import require_room
from ellipsoid_coupling.models.run_warnings import of_drag_work, of_one_angle
from ellipsoid_coupling.models.staircase import (
    Staircase,
    curved_walls,
    require_start_in_fluid,
    scene_moving_lines,
    staircase_in_time,
    staircase_lines,
)
from ellipsoid_coupling.models.start_state import fill_start
from ellipsoid_coupling.models.summation import q_tolerance
from ellipsoid_coupling.physics.potential import PotentialShape, potential_shape
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]


class QEquation(CellModel):
    """A `Model` of a q-equation, but for its name and closure.

    Raises
    ------
    InputError
        For a grid that does not fit the domain, too few angles, a flux that does not fit, or kernels
        that fill the memory.
    """

    def __init__(self, name: str, setup: Setup) -> None:
        scene, system = setup.scene, self.system(setup)
        shape = potential_shape(scene.particles.length, scene.particles.width)
        grid = _scene_q_grid(scene)
        stairs_at = staircase_in_time(setup, grid.plane)
        stairs = stairs_at(0.0)
        terms = scene_cell_terms(setup, grid.plane, stairs=stairs)
        cells = CellFields(
            system=system,
            grid=grid,
            terms=terms,
            tables=scene_moving_tables(setup, stairs_at, grid.plane, terms),
            ghosts=grid_ghosts(grid.plane, scene_boundaries(scene), grid.angle_width),
            cfl=scene.numerics.cfl,
            find_forces=AngleGridForces(
                _interaction(setup, grid, system, shape), _wall_forces(scene, grid, shape, stairs)
            ),
            lines=stairs and staircase_lines(setup, stairs, grid, system),
            moving_lines=scene_moving_lines(setup, stairs_at, grid, system),
        )
        fill_start(cells, setup, stairs, {DENSITY: _start(grid, setup, stairs)})
        for component, value in self.start_values(setup, cells.inside[0]).items():
            cells.fill(component, value)
        super().__init__(name, setup, cells)

    @classmethod
    def system(cls, setup: Setup) -> System:
        """The components that the scene needs, and the pressure of the closure."""
        resolved = _scene_q_grid(setup.scene).angles > 1
        return q_system(setup.terms.angle, resolved, cls.kinds[0].pressure)

    @classmethod
    def require_fit(cls, setup: Setup) -> None:
        """Raise InputError for a grid or a flux that does not fit, or too few angles."""
        grid = _scene_q_grid(setup.scene)
        require_room(setup.scene, grid.plane)
        if setup.terms.angle and grid.angles > 1:
            check_angles(setup.scene.name, grid.angles)
        flux_of(cls.system(setup), setup, QGrid.angle_resolved)

    def snapshot(self) -> Arrays:
        """density, velocity_x, velocity_y, angular_velocity, each (na, ny, nx); 0 in vacuum."""
        x, y, *spin = (self._advected(k) for k in self.cells.system.velocities)
        return {
            "density": self.cells.inside[0].copy(),
            "velocity_x": x,
            "velocity_y": y,
            "angular_velocity": spin[0] if spin else np.zeros(self.grid.shape),
        }

    def _advected(self, component: int) -> Floats:
        values: Floats = np.zeros(self.grid.shape)
        box = occupied_box(self.cells.extents)
        if box is not None:
            fields, here = self.cells.inside[..., *box], values[..., *box]
            np.divide(fields[component], fields[0], out=here, where=fields[0] > 0.0)
        return values

    def failure_site(self) -> FailureSite:
        """The fastest cell; forces as far as they are known."""
        cells, plane = self.cells, self.grid.plane
        terms, forces = cells.terms, cells.forces
        speeds = np.array([self._advected(k) for k in cells.system.velocities])
        a, j, i = np.unravel_index(worst(speeds, cells.inside[0] > 0.0), self.grid.shape)
        strengths = {"its own speed": float(np.abs(speeds[:, a, j, i]).max())}
        if terms.steady is not None:
            strengths[f"{FLUID} with {OUTER}"] = float(np.hypot(*terms.steady[:, j, i]))
        if forces is not None:
            at = a % forces.x.shape[0], j, i
            pull = float(np.hypot(forces.x[at], forces.y[at]))
            strengths[PAIRS] = terms.inverse_mass * pull
            if forces.torque is not None:
                strengths[TORQUE] = terms.inverse_inertia * abs(float(forces.torque[at]))
        place = float(plane.x[i]), float(plane.y[j]), float(self.grid.angle[a])
        return FailureSite(place, strengths)

    def _force_bounds(self) -> tuple[float, float]:
        terms, forces = self.cells.terms, self.cells.forces
        steady, turning = largest_magnitude(terms.steady), 3.0 * largest_magnitude(terms.turning)
        turning += largest_outer_torque(terms.angular, self.grid.angle)
        if forces is None:
            return steady, turning
        pull = max(largest_magnitude(forces.x), largest_magnitude(forces.y))
        torque = largest_magnitude(forces.torque)
        return steady + pull * terms.inverse_mass, turning + torque * terms.inverse_inertia

    def warnings(self) -> list[str]:
        """As every cell equation's, that one cell stands for all angles, and drag that is too strong."""
        turns = len(self.cells.system.velocities) > 2
        one = of_one_angle(self._setup.scene, turns) if self.grid.angles == 1 else []
        balances = self.stepper.balances
        return super().warnings() + one + of_drag_work(self._drag_work() if balances else 0.0)

    def _drag_work(self) -> float:
        """By how much the drag's work across a cell, gamma u h, differs between cells of the fluid."""
        flow, rates, plane = self._setup.flow, self._setup.scene.flow, self.grid.plane
        if flow is None or rates is None:
            return 0.0
        sample = flow.at(self.time).evaluate(*np.meshgrid(plane.x, plane.y))
        lines = self.cells.lines
        inside = sample.inside if lines is None else sample.inside & lines.inside
        if not inside.any():
            return 0.0
        spread = max(
            float(np.ptp(velocity[inside])) for velocity in (sample.velocity_x, sample.velocity_y)
        )
        return rates.drag * spread * plane.cell

    def coordinates(self) -> dict[str, Floats]:
        """Cell centres."""
        plane = self.grid.plane
        return {"angle": self.grid.angle, "y": plane.y, "x": plane.x}


def _interaction(
    setup: Setup, grid: QGrid, system: System, shape: PotentialShape
) -> AngleGridInteraction | None:
    """Of the quantity that the scheme asks for; None without interaction."""
    scene = setup.scene
    if scene.interaction is None:
        return None
    quantity, strength = (
        stepper_of(system, setup, grid.angle_resolved).quantity,
        scene.interaction.strength,
    )
    tolerance, periods = q_tolerance(scene, system.pressure), periodic_axes(scene)
    return AngleGridInteraction(
        grid.shape, grid.plane.cell, shape, strength, quantity, tolerance, periods
    )


def _start(grid: QGrid, setup: Setup, stairs: Staircase | None) -> Floats:
    """The density at the start, (na, ny, nx): that of the plane at the start angle, or the points."""
    scene = setup.scene
    places, density = scene.start.places(), start_density(grid.plane, scene)
    if stairs is not None and setup.earlier is None:
        density = require_start_in_fluid(scene, stairs.cells.inside, grid.plane, density)
    if not places:
        parts = start_angles(grid, scene.start.own_angle)[:, None, None]
        return parts * (density / grid.angle_width)
    start = np.zeros(grid.shape)
    for x, y, angle in places:
        start[(slice(None), *cell_of(grid.plane, x, y))] += start_angles(grid, angle)
    return np.asarray(start / (len(places) * grid.volume))


def _scene_q_grid(scene: Scene) -> QGrid:
    """Circles look the same at every angle: one cell, unless V2 tells the angles apart."""
    one = scene.particles.is_circle and scene.angular_potential is None
    return QGrid(scene_grid(scene), 1 if one else scene.numerics.angle_cells)


def _wall_forces(
    scene: Scene, grid: QGrid, shape: PotentialShape, stairs: Staircase | None
) -> AngleForces | None:
    """What the walls do to every cell and every angle that the potential tells apart."""
    walls = scene_walls(scene, shape, stairs)
    if walls is None:
        return None
    n = distinct_angles(grid.angles, shape)
    curved = curved_walls(scene, stairs, grid.plane, walls)
    if curved is not None:
        force_x, force_y, torque = curved.on_angles(grid.angle[:n], grid.plane.shape)
        return AngleForces(force_x, force_y, torque if shape.shape_factor else None)
    table: WallTable = walls.table(grid.plane.cell)
    force_x, force_y, torque = np.zeros((3, n, *grid.plane.shape))
    for side in table.sides:
        frame = WALL_FRAMES[side]
        count = grid.plane.nx if frame.normal_x else grid.plane.ny
        distance = np.arange(count, dtype=np.int64)
        if frame.normal_x + frame.normal_y < 0.0:
            distance = distance[::-1]
        push, turning = table.force(distance, grid.angle[:n, None] - frame.angle)
        across = np.s_[:, None, :] if frame.normal_x else np.s_[:, :, None]
        force_x += frame.normal_x * push[across]
        force_y += frame.normal_y * push[across]
        torque += turning[across]
    return AngleForces(force_x, force_y, torque if shape.shape_factor else None)
