"""What every equation for rho(r), phi(r) on an r-grid shares: fields, drift, steps, results.

A model derives from `RGridEquation`, names itself and hands over its splitting; fields, drift and
the three operations that a splitting uses (`splitting.SplitEquation`) live here.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import threads_for
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.finite_volume.boundary import grid_ghosts
from ellipsoid_coupling.finite_volume.diagnostics import largest_magnitude, survey_cells
from ellipsoid_coupling.finite_volume.fluxes import AnyFlux
from ellipsoid_coupling.finite_volume.fluxes.contract import VACUUM
from ellipsoid_coupling.finite_volume.fused_xy_sweep import Move, sweep_planes
from ellipsoid_coupling.finite_volume.grid import (
    Grid,
    interior,
    scene_grid,
    start_angle,
    start_density,
)
from ellipsoid_coupling.finite_volume.sources import (
    ANGLE,
    MOMENTUM_X,
    MOMENTUM_Y,
    RHO,
    SPIN,
    set_drift,
)
from ellipsoid_coupling.finite_volume.splitting import Splitting
from ellipsoid_coupling.finite_volume.strips import whole_plane
from ellipsoid_coupling.geometry.boundaries import scene_boundaries
from ellipsoid_coupling.interaction import GridInteraction, WallTable, choose_interaction
from ellipsoid_coupling.interaction.grid_forces import Forces
from ellipsoid_coupling.models.base import Arrays, Counts, Health, Setup
from ellipsoid_coupling.models.failure_site import FLUID, OUTER, PAIRS, TORQUE, Spot, worst
from ellipsoid_coupling.models.from_scene import scene_cell_terms, scene_walls
from ellipsoid_coupling.models.periodic import periodic_axes, require_room
from ellipsoid_coupling.models.run_warnings import as_counts, of_mixed_angles, of_start
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.stepping.status import MEANING, NOT_FINITE, RUNNING
from ellipsoid_coupling.stepping.step_control import (
    CFL,
    STEPS,
    TIME,
    Aside,
    advance_by_limits,
    new_clock,
    step_log,
)

Floats = NDArray[np.float64]

# A call of `advance` takes so many steps, or more where a step takes less than the look of the
# monitors that follows.
_STEPS_PER_CALL, _MOST_STEPS_PER_CALL = 24, 32
_CELLS_PER_CALL = 16_000
# A sweep over so many cells takes some 0.1 ms: sharing less costs more than it gains.
_CELLS_PER_THREAD = 5000


class RGridEquation:
    """A `Model` but for its names; `splitting` steps it.

    Attributes
    ----------
    fields : (5, ny + 4, nx + 4) float64, or 3 components where nothing turns
        rho, rho v_x, rho v_y, rho phi, rho omega; padded by two ghost layers.
    drift : (3 or 2, ny, nx)
        F_x, F_y and F_bar of `finite_volume.sources`, at the present fields.
    """

    layout: ClassVar[Literal["particles", "rho", "q"]] = "rho"
    together: ClassVar[bool] = True

    def __init__(self, name: str, setup: Setup, splitting: Splitting) -> None:
        self.name = name
        self._setup = setup
        scene = setup.scene
        self.grid: Grid = scene_grid(scene)
        self._ghosts = grid_ghosts(self.grid, scene_boundaries(scene))
        self.terms = scene_cell_terms(setup, self.grid)
        self._interaction, self._walls = _scene_interaction(setup, self.grid)
        self._splitting = splitting
        steps = _CELLS_PER_CALL // (self.grid.nx * self.grid.ny)
        self._steps_per_call = min(max(steps, _STEPS_PER_CALL), _MOST_STEPS_PER_CALL)
        # The density that mass 1 has all over the domain, a small part of it.
        self._vacuum = VACUUM / (scene.domain.width * scene.domain.height)
        self.fields = np.zeros((5 if setup.terms.angle else 3, *self.grid.padded))
        interior(self.fields)[RHO] = start_density(self.grid, scene)
        self._start_angle = start_angle(self.grid, scene)
        if setup.terms.angle:
            interior(self.fields)[ANGLE] = interior(self.fields)[RHO] * self._start_angle
        self.drift = np.zeros((self.fields.shape[0] // 2 + 1, *self.grid.shape))
        self.clock = new_clock(1, np.inf, CFL)
        self.end, self.aside = float(scene.times[-1]), Aside()
        self._mass_start = self._mass()
        # What has left through open edges, in units of a cell's density.
        self._left = np.zeros(1)
        # What a refused step gives back; new arrays in every step would cost as much as a sweep.
        arrays = (self.fields, self.drift, self._left) if splitting.refuses else ()
        self._kept = [np.empty_like(array) for array in arrays]
        splitting.start(self)

    @property
    def cell(self) -> float:
        """The cell width h."""
        return self.grid.cell

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Raise InputError where the cells do not divide the domain, or fill a period badly."""
        require_room(setup.scene, scene_grid(setup.scene))

    @property
    def time(self) -> float:
        """The time reached."""
        return float(self.clock[0, TIME])

    def _mass(self) -> float:
        return float(interior(self.fields)[RHO].sum() * self.cell**2)

    def transport(self, flux: AnyFlux, dt: float, x_first: bool) -> None:
        """Move all fields along x and y, or y and x, for dt, boundary conditions included."""
        kinds = self._ghosts.kinds
        whole = whole_plane(self.grid.padded, kinds.wraps(-2), numba.get_num_threads())
        thin, flat = flux._replace(vacuum=self._vacuum), self.fields.reshape(len(self.fields), -1)
        move = Move(x_first, dt / self.cell, self.time)
        gone = sweep_planes(thin, flat, *whole, move, self._ghosts)
        if not kinds.closed:
            self._left += gone

    def evaluate_drift(self) -> None:
        """F and F_bar of the present fields, interaction and walls included."""
        set_drift(self.fields, self.terms, self.forces(), self.drift)

    def forces(self) -> Forces | None:
        """Interaction and walls at the present fields; None without interaction."""
        if self._interaction is None:
            return None
        density = np.ascontiguousarray(interior(self.fields)[RHO])
        angle = self._mean_angle()
        forces = self._interaction(density, angle)
        if self._walls is not None:
            self._walls.add_to(forces, density, angle)
        return forces

    def _carried(self, component: int) -> Floats:
        """A carried quantity a = (rho a)/rho, (ny, nx); 0 in vacuum."""
        rho = interior(self.fields)[RHO]
        values = interior(self.fields)[component]
        return np.asarray(np.divide(values, rho, out=np.zeros_like(rho), where=rho > 0.0))

    def _mean_angle(self) -> Floats:
        if self._setup.terms.angle:
            return self._carried(ANGLE)
        return self._start_angle.copy()

    def advance(self, until: float) -> None:
        """Some steps, as long as the CFL number allows; one that turns out too long is repeated."""
        with threads_for(self.grid.nx * self.grid.ny, _CELLS_PER_THREAD):
            status = advance_by_limits(self, until, self._steps_per_call)
        if status != RUNNING and not np.isfinite(self.drift).all():
            status = NOT_FINITE
        if status != RUNNING:
            raise self._failure(status)

    def allowed_step(self) -> tuple[float, int]:
        """What the CFL number, the force and the torque allow, see `Splitting.largest_step`."""
        cfl = self._setup.scene.numerics.cfl
        inflow = self._ghosts.kinds.inflow_step(cfl * self.cell), CFL
        return min(self._splitting.largest_step(self, cfl), inflow)

    def try_step(self, dt: float) -> bool:
        """Step by dt; False, with all fields as before, if that was too long."""
        count = int(self.clock[0, STEPS])
        if not self._splitting.refuses:
            return self._splitting.step(self, dt, count)
        arrays = self.fields, self.drift, self._left
        for kept, array in zip(self._kept, arrays, strict=True):
            np.copyto(kept, array)
        if self._splitting.step(self, dt, count):
            return True
        for kept, array in zip(self._kept, arrays, strict=True):
            np.copyto(array, kept)
        return False

    def _failure(self, status: int) -> RunError:
        what, remedy = MEANING[status]
        return RunError(
            f"{self._setup.scene.name}, {self.name}, t = {self.time:.6g}, "
            f"step {int(self.clock[0, STEPS])}: {what}. {self.spot()} {remedy}"
        )

    def snapshot(self) -> Arrays:
        """density, mean_angle, velocity_x, velocity_y, angular_velocity, each (ny, nx)."""
        turns = self._setup.terms.angle
        return {
            "density": interior(self.fields)[RHO].copy(),
            "mean_angle": self._mean_angle() + self._setup.scene.start.turns,
            "velocity_x": self._carried(MOMENTUM_X),
            "velocity_y": self._carried(MOMENTUM_Y),
            "angular_velocity": self._carried(SPIN) if turns else np.zeros(self.grid.shape),
        }

    def state(self) -> Arrays:
        """Fields, drift, clock and what has left, of what the run goes on from; see `Aside`."""
        return self.live() if self.aside.arrays is None else self.aside.arrays

    def live(self) -> Arrays:
        """Fields, drift, clock and what has left, as they are shown now."""
        return {
            "fields": self.fields,
            "drift": self.drift,
            "clock": self.clock,
            "left": self._left,
        }

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`."""
        self.aside = Aside()
        current = self.live()
        for name, array in state.items():
            current[name][...] = array
        self._splitting.restore(self)

    def spot(self) -> Spot:
        """The cell where the drift is strongest."""
        j, i = np.unravel_index(
            worst(self.drift, interior(self.fields)[RHO] > 0.0), self.grid.shape
        )
        drift = self.drift[:, j, i]
        steady = np.zeros(2) if self.terms.steady is None else self.terms.steady[:, j, i]
        terms = {
            f"{FLUID} with {OUTER}": float(np.hypot(*steady)),
            PAIRS: float(np.hypot(*(drift[:2] - steady))),
            TORQUE: float(np.abs(drift[2:]).max(initial=0.0)),
        }
        return Spot((float(self.grid.x[i]), float(self.grid.y[j])), terms)

    def health(self) -> Health:
        """Mass, least density, speeds, and the drift's largest components."""
        mass, least, speeds = survey_cells(self.fields)
        found = self._splitting.found
        if found is not None:
            forces = found.force, found.torque
        else:
            forces = largest_magnitude(self.drift[:2]), largest_magnitude(self.drift[2:])
        left = float(self._left[0] * self.cell**2)
        return Health(mass * self.cell**2, least, speeds, forces, left=left)

    def counts(self) -> Counts:
        """The steps, the mass balance, and what should be told."""
        return (
            step_log(self.clock)
            | {
                "mass_start": self._mass_start,
                "mass_end": self._mass(),
                "mass_left": float(self._left[0] * self.cell**2),
            }
            | as_counts(self.told())
        )

    def told(self) -> list[str]:
        """Sentences for `Result.warnings`."""
        scene = self._setup.scene
        return of_start(scene) + of_mixed_angles(scene)

    def coordinates(self) -> dict[str, Floats]:
        """Cell centres."""
        return {"y": self.grid.y, "x": self.grid.x}


def _scene_interaction(setup: Setup, grid: Grid) -> tuple[GridInteraction | None, WallTable | None]:
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
    walls = scene_walls(scene, shape)
    table = walls.table(grid.cell) if walls is not None else None
    return interaction, table
