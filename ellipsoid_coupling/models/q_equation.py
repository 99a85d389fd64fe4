"""The q-equations, `eq:macro_q_max` and `eq:macro_q_mono`: density over place and angle.

    d_t q         + div_r(q v)               + d_theta(q omega)         = 0
    d_t (q v)     + div_r(q v (x) v + p q I) + d_theta(q v omega)       = q S_1 - (A^2/2) q v
    d_t (q omega) + div_r(q v omega)         + d_theta(q omega^2 + p q) = q S_2 - (B^2/2) q omega

    S_1 = gamma (u - v) - K_1[q]/m - grad V1,   S_2 = gamma_bar (g - omega) - K_2[q]/I_c - dV2

The closure is the pressure coefficient p: 1 Maxwellian, 0 mono-kinetic. Scheme `paper`: FORCE in x,
y and theta, then implicit Euler. Scheme `accurate`: kick-drift-kick about a ballistic flight where
there is no pressure, else the scheme of finite_volume/well_balanced.py. `_STEPPERS` names them all.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.finite_volume.boundary import grid_ghosts
from ellipsoid_coupling.finite_volume.crossing import CrossingDetector
from ellipsoid_coupling.finite_volume.diagnostics import largest_magnitude, survey_cells
from ellipsoid_coupling.finite_volume.grid import cell_of, scene_grid, start_density
from ellipsoid_coupling.finite_volume.q_grid import (
    QOMEGA,
    QVX,
    QVY,
    Q,
    QGrid,
    check_angles,
    inside,
    start_angles,
)
from ellipsoid_coupling.finite_volume.q_splitting import Godunov, KickDriftKick, QStepper, QSystem
from ellipsoid_coupling.finite_volume.well_balanced import BalancedHeun
from ellipsoid_coupling.geometry.boundaries import scene_boundaries
from ellipsoid_coupling.interaction import WALL_FRAMES, WallTable
from ellipsoid_coupling.interaction.convolution.q_kernel_spectra import Quantity, distinct_angles
from ellipsoid_coupling.interaction.q_grid import AngleForces, AngleGridInteraction, box_of
from ellipsoid_coupling.models.base import Arrays, Counts, Health, SchemeName, Setup
from ellipsoid_coupling.models.failure_site import FLUID, OUTER, PAIRS, TORQUE, Spot, worst
from ellipsoid_coupling.models.from_scene import scene_cell_terms, scene_walls
from ellipsoid_coupling.models.periodic import periodic_axes, require_room
from ellipsoid_coupling.models.run_warnings import as_counts, of_crossing, of_one_angle, of_start
from ellipsoid_coupling.physics.closure import PRESSURE
from ellipsoid_coupling.physics.potential import PotentialShape, potential_shape
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.stepping.status import MEANING, RUNNING
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

_STEPPERS: dict[tuple[str, SchemeName], type[QStepper]] = {
    ("mono_kinetic", "paper"): Godunov,
    ("maxwellian", "paper"): Godunov,
    ("mono_kinetic", "accurate"): KickDriftKick,
    ("maxwellian", "accurate"): BalancedHeun,
}

_STEPS_PER_CALL = 16


class QEquation:
    """`Model` of the q-equations.

    Raises
    ------
    InputError
        For a grid that does not fit the domain, too few angles, or kernels that fill the memory.
    """

    names: ClassVar[tuple[str, ...]] = ("q_maxwellian", "q_mono_kinetic")
    layout: ClassVar[Literal["particles", "rho", "q"]] = "q"
    together: ClassVar[bool] = True

    def __init__(self, name: str, setup: Setup) -> None:
        self.name = name
        self._setup = setup
        closure = name.removeprefix("q_")
        stepper = _STEPPERS[closure, setup.scheme]
        self.system = build_system(setup, PRESSURE[closure], stepper.quantity)
        self.grid = self.system.grid
        self.stepper: QStepper = stepper(self.system)
        self.stepper.prepare()
        self.clock = new_clock(1, np.inf, CFL)
        self.end, self.aside = float(setup.scene.times[-1]), Aside()
        # Under pressure characteristics do not cross.
        single = self.system.pressure == 0.0
        self._crossing = CrossingDetector(self.system.terms.damping) if single else None
        self._mass_start = self._mass()

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Raise InputError for a grid that does not fit the domain, or too few angles."""
        grid = _scene_q_grid(setup.scene)
        require_room(setup.scene, grid.plane)
        if setup.terms.angle and grid.angles > 1:
            check_angles(setup.scene.name, grid.angles)

    @property
    def time(self) -> float:
        """The time reached."""
        return float(self.clock[0, TIME])

    def _mass(self) -> float:
        return float(inside(self.system.fields)[Q].sum() * self.grid.volume)

    def advance(self, until: float) -> None:
        """Some steps, each as long as the CFL number allows."""
        status = advance_by_limits(self, until, _STEPS_PER_CALL)
        if status != RUNNING:
            raise self._failure(status)

    def allowed_step(self) -> tuple[float, int]:
        """What the CFL number allows, the acceleration within the step included."""
        distance = self.system.cfl * self.grid.plane.cell
        inflow = self.system.ghosts.kinds.inflow_step(distance), CFL
        return min(self.stepper.largest_step, inflow)

    def try_step(self, dt: float) -> bool:
        """Step by dt; False, with all as before, if the stepper finds that it was too long."""
        self.system.time = self.time
        if not self.stepper.step(dt, int(self.clock[0, STEPS])):
            return False
        if self._crossing is not None:
            system, now = self.system, self.time + dt
            self._crossing.look(system.fields, self.grid.plane.cell, now, system.extents)
        return True

    def _failure(self, status: int) -> RunError:
        what, remedy = MEANING[status]
        return RunError(
            f"{self._setup.scene.name}, {self.name}, t = {self.time:.6g}, "
            f"step {int(self.clock[0, STEPS])}: {what}. {self.spot()} {remedy}"
        )

    def snapshot(self) -> Arrays:
        """density, velocity_x, velocity_y, angular_velocity, each (na, ny, nx); 0 in vacuum."""
        fields = inside(self.system.fields)
        turns = fields.shape[0] > QOMEGA
        return {
            "density": fields[Q].copy(),
            "velocity_x": self._carried(QVX),
            "velocity_y": self._carried(QVY),
            "angular_velocity": self._carried(QOMEGA) if turns else np.zeros(self.grid.shape),
        }

    def _carried(self, component: int) -> Floats:
        values: Floats = np.zeros(self.grid.shape)
        box = box_of(self.system.extents)
        if box is not None:
            fields, here = inside(self.system.fields)[..., *box], values[..., *box]
            np.divide(fields[component], fields[Q], out=here, where=fields[Q] > 0.0)
        return values

    def state(self) -> Arrays:
        """What `live` has, of what the run goes on from; see `Aside`."""
        return self.live() if self.aside.arrays is None else self.aside.arrays

    def live(self) -> Arrays:
        """Fields, clock, what has left, and what the stepper and the detector remember."""
        arrays: Arrays = {
            "fields": self.system.fields,
            "clock": self.clock,
            "left": self.system.left,
            "memory": self.stepper.memory,
        }
        if self._crossing is not None:
            arrays["crossing"] = self._crossing.memory
        return arrays

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`."""
        self.aside = Aside()
        current = self.live()
        for name, array in state.items():
            current[name][...] = array
        self.system.look_for_mass()
        self.stepper.prepare()

    def spot(self) -> Spot:
        """The fastest cell; forces as far as the stepper keeps them."""
        system, forces = self.system, self.stepper.forces
        fields = inside(system.fields)
        speeds = np.array([self._carried(k) for k in range(QVX, fields.shape[0])])
        a, j, i = np.unravel_index(worst(speeds, fields[Q] > 0.0), self.grid.shape)
        terms, plane = system.terms, self.grid.plane
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
        return Spot(place, strengths)

    def health(self) -> Health:
        """Mass, least density, speeds; a bound of the forces where there is no pressure."""
        mass, least, speeds = survey_cells(self.system.fields)
        infinite = math.inf, math.inf
        forces = infinite if self.system.pressure > 0.0 else self._largest_forces()
        left = float(self.system.left[0] * self.grid.volume)
        return Health(mass * self.grid.volume, least, speeds, forces, left=left)

    def _largest_forces(self) -> tuple[float, float]:
        terms, forces = self.system.terms, self.stepper.forces
        steady, turning = largest_magnitude(terms.steady), 3.0 * largest_magnitude(terms.turning)
        turning += terms.amplitude or 0.0
        if forces is None:
            return steady, turning
        pull = max(largest_magnitude(forces.x), largest_magnitude(forces.y))
        torque = largest_magnitude(forces.torque)
        return steady + pull * terms.inverse_mass, turning + torque * terms.inverse_inertia

    def counts(self) -> Counts:
        """The steps, the mass balance, if they have, when characteristics crossed, and what to tell."""
        crossing = {} if self._crossing is None else self._crossing.counts()
        crossed = math.nan if self._crossing is None else self._crossing.time
        scene, turns = self._setup.scene, self.system.fields.shape[0] > QOMEGA
        one = of_one_angle(scene, turns) if self.grid.angles == 1 else []
        return (
            step_log(self.clock)
            | crossing
            | {
                "mass_start": self._mass_start,
                "mass_end": self._mass(),
                "mass_left": float(self.system.left[0] * self.grid.volume),
            }
            | as_counts(of_crossing(crossed), of_start(scene), one)
        )

    def coordinates(self) -> dict[str, Floats]:
        """Cell centres."""
        plane = self.grid.plane
        return {"angle": self.grid.angle, "y": plane.y, "x": plane.x}


def build_system(setup: Setup, pressure: float, quantity: Quantity) -> QSystem:
    """The scene's grid, start and terms; what it lacks is None."""
    scene, terms = setup.scene, setup.terms
    shape = potential_shape(scene.particles.length, scene.particles.width)
    grid = _scene_q_grid(scene)
    turns = terms.angle and grid.angles > 1
    fields = np.zeros((4 if terms.angle else 3, *grid.padded))
    inside(fields)[Q] = _start(grid, scene)
    interaction = None
    if scene.interaction is not None:
        strength = scene.interaction.strength
        tolerance, periods = _tolerance(scene, pressure), periodic_axes(scene)
        interaction = AngleGridInteraction(
            grid.shape, grid.plane.cell, shape, strength, quantity, tolerance, periods
        )
    return QSystem(
        grid=grid,
        fields=fields,
        terms=scene_cell_terms(setup, grid.plane),
        axes=(-1, -2, -3) if turns else (-1, -2),
        pressure=pressure,
        ghosts=grid_ghosts(grid.plane, scene_boundaries(scene), grid.angle_width),
        cfl=scene.numerics.cfl,
        interaction=interaction,
        walls=_wall_forces(scene, grid, shape),
    )


def _start(grid: QGrid, scene: Scene) -> Floats:
    """The density at the start, (na, ny, nx): that of the plane at the start angle, or the points."""
    places = scene.start.places()
    if not places:
        density = start_density(grid.plane, scene) / grid.angle_width
        return start_angles(grid, scene.start.own_angle)[:, None, None] * density
    start = np.zeros(grid.shape)
    for x, y, angle in places:
        start[(slice(None), *cell_of(grid.plane, x, y))] += start_angles(grid, angle)
    return np.asarray(start / (len(places) * grid.volume))


def _tolerance(scene: Scene, pressure: float) -> float:
    """What the interaction may be off by; pressure has equilibria, which stay with all digits only."""
    numerics = scene.numerics
    exact = numerics.interaction == "direct" or pressure > 0.0
    return 0.0 if exact else numerics.harmonics_tolerance


def _scene_q_grid(scene: Scene) -> QGrid:
    """Circles look the same at every angle: one cell, unless V2 tells the angles apart."""
    one = scene.particles.is_circle and scene.angular_potential is None
    return QGrid(scene_grid(scene), 1 if one else scene.numerics.angle_cells)


def _wall_forces(scene: Scene, grid: QGrid, shape: PotentialShape) -> AngleForces | None:
    """What the walls do to every cell and every angle that the potential tells apart."""
    walls = scene_walls(scene, shape)
    if walls is None:
        return None
    table: WallTable = walls.table(grid.plane.cell)
    n = distinct_angles(grid.angles, shape)
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


MODEL = QEquation
