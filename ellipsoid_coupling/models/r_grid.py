"""What equations for rho(r), phi(r) on an r-grid share: the angle is carried, F and F_bar are kept."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.threads import threads_for
from ellipsoid_coupling.finite_volume.boundary import grid_ghosts
from ellipsoid_coupling.finite_volume.cell_forces import MeanAngleForces
from ellipsoid_coupling.finite_volume.cells import CellFields
from ellipsoid_coupling.finite_volume.diagnostics import largest_magnitude
from ellipsoid_coupling.finite_volume.grid import Grid, scene_grid, start_angle, start_density
from ellipsoid_coupling.finite_volume.q_grid import RGrid
from ellipsoid_coupling.finite_volume.system import DENSITY, MEAN_ANGLE, System, rho_system
from ellipsoid_coupling.geometry.boundaries import periodic_axes, scene_boundaries
from ellipsoid_coupling.interaction import (
    CurvedWalls,
    GridInteraction,
    WallTable,
    choose_interaction,
)
from ellipsoid_coupling.models.base import Arrays, Setup
from ellipsoid_coupling.models.cell_model import CellModel, flux_of
from ellipsoid_coupling.models.failure_site import FLUID, OUTER, PAIRS, TORQUE, FailureSite, worst
from ellipsoid_coupling.models.from_scene import scene_cell_terms, scene_moving_tables, scene_walls
from ellipsoid_coupling.models.periodic import require_room
from ellipsoid_coupling.models.run_warnings import of_mixed_angles
from ellipsoid_coupling.models.staircase import (
    Staircase,
    curved_walls,
    require_start_in_fluid,
    scene_moving_lines,
    staircase_in_time,
    staircase_lines,
)
from ellipsoid_coupling.models.start_state import fill_start
from ellipsoid_coupling.physics.potential import potential_shape

Floats = NDArray[np.float64]

# A call of `advance` takes so many steps, or more where a step takes less than the look of the
# monitors that follows.
_STEPS_PER_CALL, _MOST_STEPS_PER_CALL = 24, 32
_CELLS_PER_CALL = 16_000
# A sweep over so many cells takes some 0.1 ms: sharing less costs more than it gains.
_CELLS_PER_THREAD = 5000


class RGridEquation(CellModel):
    """A `CellModel` of rho, rho v_x, rho v_y and, where something turns, rho phi and rho omega."""

    slaved: ClassVar[bool] = False

    def __init__(self, name: str, setup: Setup) -> None:
        scene, plane = setup.scene, scene_grid(setup.scene)
        steps = min(_CELLS_PER_CALL // (plane.nx * plane.ny), _MOST_STEPS_PER_CALL)
        self.steps_per_call = max(steps, _STEPS_PER_CALL)
        system, grid = self.system(setup), RGrid(plane)
        stairs_at = staircase_in_time(setup, plane)
        stairs = stairs_at(0.0)
        interaction = _scene_interaction(setup, plane, stairs)
        self._forces = MeanAngleForces(*interaction, start_angle(plane, scene))
        terms = scene_cell_terms(setup, plane, stairs=stairs)
        cells = CellFields(
            system=system,
            grid=grid,
            terms=terms,
            tables=scene_moving_tables(setup, stairs_at, plane, terms),
            ghosts=grid_ghosts(plane, scene_boundaries(scene)),
            cfl=scene.numerics.cfl,
            find_forces=self._forces,
            lines=stairs and staircase_lines(setup, stairs, grid, system),
            moving_lines=scene_moving_lines(setup, stairs_at, grid, system),
        )
        density = start_density(plane, scene)
        if stairs is not None and setup.earlier is None:
            density = require_start_in_fluid(scene, stairs.cells.inside, plane, density)
        own = {DENSITY: density[None], MEAN_ANGLE: self._forces.start_angle[None]}
        fill_start(cells, setup, stairs, own)
        for component, value in self.start_values(setup, cells.inside[0]).items():
            cells.fill(component, value)
        super().__init__(name, setup, cells)

    @classmethod
    def system(cls, setup: Setup) -> System:
        """The components that the scene needs."""
        return rho_system(setup.terms.angle, cls.slaved)

    @classmethod
    def require_fit(cls, setup: Setup) -> None:
        """Raise InputError for cells, a scheme or a flux that do not fit."""
        require_room(setup.scene, scene_grid(setup.scene))
        flux_of(cls.system(setup), setup, RGrid.angle_resolved)

    @property
    def fields(self) -> Floats:
        """Padded fields of the plane, (5 or 3, ny + 4, nx + 4)."""
        return self.cells.fields[:, 0]

    @property
    def drift(self) -> Floats:
        """F_x, F_y and, where something turns, F_bar at the present fields, (3 or 2, ny, nx)."""
        return self.cells.drift[:, 0]

    def advance(self, until: float) -> None:
        """As every cell equation, on as many threads as the grid is worth."""
        plane = self.grid.plane
        with threads_for(plane.nx * plane.ny, _CELLS_PER_THREAD):
            super().advance(until)

    def _advected(self, component: int) -> Floats:
        """A quantity a = (rho a)/rho, (ny, nx); 0 in vacuum."""
        rho, content = self.cells.inside[0, 0], self.cells.inside[component, 0]
        return np.asarray(np.divide(content, rho, out=np.zeros_like(rho), where=rho > 0.0))

    def snapshot(self) -> Arrays:
        """density, mean_angle, velocity_x, velocity_y, angular_velocity, each (ny, nx); 0 in vacuum."""
        x, y, *spin = (self._advected(k) for k in self.cells.system.velocities)
        density = self.cells.inside[0, 0].copy()
        angle = self._forces.mean_angle(self.cells) + self._setup.scene.start.turns
        return {
            "density": density,
            "mean_angle": np.where(density > 0.0, angle, 0.0),
            "velocity_x": x,
            "velocity_y": y,
            "angular_velocity": spin[0] if spin else np.zeros(self.grid.plane.shape),
        }

    def failure_site(self) -> FailureSite:
        """The cell where the drift is strongest."""
        plane, terms = self.grid.plane, self.cells.terms
        where = worst(self.drift, self.cells.inside[0, 0] > 0.0)
        j, i = np.unravel_index(where, plane.shape)
        drift = self.drift[:, j, i]
        steady = np.zeros(2) if terms.steady is None else terms.steady[:, j, i]
        strengths = {
            f"{FLUID} with {OUTER}": float(np.hypot(*steady)),
            PAIRS: float(np.hypot(*(drift[:2] - steady))),
            TORQUE: float(np.abs(drift[2:]).max(initial=0.0)),
        }
        return FailureSite((float(plane.x[i]), float(plane.y[j])), strengths)

    def _force_bounds(self) -> tuple[float, float]:
        return largest_magnitude(self.drift[:2]), largest_magnitude(self.drift[2:])

    def warnings(self) -> list[str]:
        """As every cell equation's, and where start angles are mixed."""
        return super().warnings() + of_mixed_angles(self._setup.scene)

    def coordinates(self) -> dict[str, Floats]:
        """Cell centres."""
        return {"y": self.grid.plane.y, "x": self.grid.plane.x}


def _scene_interaction(
    setup: Setup, grid: Grid, stairs: Staircase | None
) -> tuple[GridInteraction | None, WallTable | CurvedWalls | None]:
    scene = setup.scene
    if scene.interaction is None:
        return None, None
    shape = potential_shape(scene.particles.length, scene.particles.width)
    numerics, strength = scene.numerics, scene.interaction.strength
    interaction = choose_interaction(
        grid.shape,
        grid.cell,
        shape,
        strength,
        tolerance=numerics.harmonics_tolerance,
        method=numerics.interaction,
        periods=periodic_axes(scene),
    )
    walls = scene_walls(scene, shape, stairs)
    if walls is None:
        return interaction, None
    return interaction, curved_walls(scene, stairs, grid, walls) or walls.table(grid.cell)
