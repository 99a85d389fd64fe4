"""The stationary solution without fluid, with the interaction potential as the errata have it.

    q_stat = exp(-V1 - V2 - U*q_stat/m)/Z,      Z such that q_stat has mass 1

It does not depend on the noise, since A dW comes with the damping A^2/2. It is a minimum of the free
energy, found by Newton's descent (`finite_volume.free_energy`), however strong the interaction is; a strong
one has many such states. Both schemes are the same: an equilibrium has no time step.
"""

from __future__ import annotations

import math
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.finite_volume.free_energy import Problem, descend, miss, point_at
from ellipsoid_coupling.finite_volume.grid import Grid, scene_grid
from ellipsoid_coupling.interaction.q_grid import AngleGridInteraction
from ellipsoid_coupling.models.base import Arrays, Counts, Health, Setup
from ellipsoid_coupling.models.failure_site import FailureSite
from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.periodic import require_no_period
from ellipsoid_coupling.models.summation import on_q_grid
from ellipsoid_coupling.physics.angular import angular_energy
from ellipsoid_coupling.physics.closure import PRESSURE
from ellipsoid_coupling.physics.outer import outer_energy, scene_outer
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.kinds import Record

Floats = NDArray[np.float64]

# Largest integral of |q - exp(-V - U*q)/Z|; with a strong U its rounding, relative to its largest value.
TOLERANCE = 1e-13
_ROUNDING = 1e-15
_STEPS_PER_CALL = 10
_MOST_STEPS = 2000
# An iteration that failed may have left any potential; its Z shall not overflow.
_LARGEST_LOG = 700.0

_TIME, _STEPS, _RESIDUAL = range(3)


@kernel
def _set_outer(
    outer: Record | None,
    angular: Record | None,
    angle: Floats,
    y: Floats,
    x: Floats,
    potential: Floats,
) -> None:
    """Overwrite `potential` (na, ny, nx) with V1 + V2."""
    for a in range(angle.size):
        turned = angular_energy(angular, angle[a])
        for j in range(y.size):
            for i in range(x.size):
                potential[a, j, i] = outer_energy(outer, x[i], y[j]) + turned


class StationaryState:
    """`Model` of the stationary solution: `advance` iterates, then time jumps to where it is asked.

    Raises
    ------
    InputError
        For a scene that has no such state: with a fluid, walls, or no outer potential; or with
        interaction and m != I_c, for then the forces have no common potential.
    """

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "stationary_state",
            label="stationary state",
            layout="q",
            rank=7,
            solves="the state at rest, over (x, y, theta)",
            needs="an [outer_potential]; no [flow], no [walls], no periodic sides",
            style=LineStyle("#56B4E9", (0.0, (6.0, 2.0)), "P"),
            random_motion=True,
            summation=partial(on_q_grid, pressure=PRESSURE["maxwellian"]),
            equilibrium=True,
        ),
    )

    def __init__(self, name: str, setup: Setup) -> None:
        self.name = name
        self._setup = setup
        self.grid: Grid = scene_grid(setup.scene)
        self.angles = setup.scene.numerics.angle_cells if setup.terms.angle else 1
        self.outer = self._outer_potential()
        self._interaction = self._interaction_potential()
        self._potential = np.zeros(self.outer.shape)
        self._clock = np.array([0.0, 0.0, np.inf])

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Raise InputError for a scene without a stationary state, or a grid that does not fit."""
        require_no_period(setup.scene, "stationary_state")
        _require_stationary(setup.scene)
        scene_grid(setup.scene)

    @property
    def _cell_volume(self) -> float:
        return self.grid.cell**2 * 2.0 * np.pi / self.angles

    @property
    def time(self) -> float:
        """0 until the iteration has converged, then whatever was asked for last."""
        return float(self._clock[_TIME])

    def _outer_potential(self) -> Floats:
        """V1 + V2, (na, ny, nx)."""
        scene = self._setup.scene
        angle = np.asarray(2.0 * np.pi / self.angles * np.arange(self.angles), np.float64)
        potential = np.empty((self.angles, *self.grid.shape))
        parts = scene_outer(scene), scene.angular_potential
        _set_outer(*parts, angle, self.grid.y, self.grid.x, potential)
        return potential

    def _interaction_potential(self) -> AngleGridInteraction | None:
        scene = self._setup.scene
        if scene.interaction is None:
            return None
        shape = potential_shape(scene.particles.length, scene.particles.width)
        strength = scene.interaction.strength / scene.particles.mass
        cells = self.angles, *self.grid.shape
        return AngleGridInteraction(cells, self.grid.cell, shape, strength, "potential")

    def _boltzmann(self, potential: Floats) -> tuple[Floats, float]:
        """The density exp(-V - potential)/Z and log Z."""
        exponent = -self.outer - potential
        largest = float(exponent.max())
        factors = np.exp(exponent - largest)
        total = float(factors.sum()) * self._cell_volume
        return factors / total, math.log(total) + largest

    def _image(self, density: Floats) -> Floats:
        """U*q/m, (na, ny, nx)."""
        if self._interaction is None:
            return np.zeros_like(density)
        # One potential for all angles that it does not tell apart.
        potential = self._interaction.potential(density)
        return np.tile(potential, (self.angles // len(potential), 1, 1))

    def advance(self, until: float) -> None:
        """A few steps of the descent; once in equilibrium, time is `until`."""
        problem = Problem(self._boltzmann, self._image, self._cell_volume)
        point = point_at(problem, self._potential)
        for _ in range(_STEPS_PER_CALL):
            self._clock[_RESIDUAL] = miss(problem, point)
            allowed = max(TOLERANCE, _ROUNDING * float(np.abs(point.image).max()))
            if self._clock[_RESIDUAL] <= allowed:
                self._clock[_TIME] = until
                break
            point = descend(problem, point)
            self._clock[_STEPS] += 1
        self._potential = point.potential
        if self._clock[_TIME] < until and not self._clock[_STEPS] < _MOST_STEPS:
            raise RunError(
                f"{self._setup.scene.name}, {self.name}: no equilibrium after {_MOST_STEPS} steps, "
                f"the residual is {self._clock[_RESIDUAL]:.3g}. {self.failure_site()} "
                "Weaken the interaction, or use a finer grid."
            )

    def snapshot(self) -> Arrays:
        """The density (na, ny, nx); velocities and angular velocity are 0."""
        density, _ = self._boltzmann(self._potential)
        still = np.zeros_like(density)
        return {
            "density": density,
            "velocity_x": still,
            "velocity_y": still.copy(),
            "angular_velocity": still.copy(),
        }

    def state(self) -> Arrays:
        """The potential U*q/m and the clock."""
        return {"potential": self._potential, "clock": self._clock}

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`."""
        self._potential = np.array(state["potential"], dtype=np.float64)
        self._clock[:] = state["clock"]

    def failure_site(self) -> FailureSite:
        """Where the interaction's potential is highest; nothing moves."""
        potential = self._image(self._boltzmann(self._potential)[0])
        a, j, i = np.unravel_index(int(potential.argmax()), potential.shape)
        place = float(self.grid.x[i]), float(self.grid.y[j]), 2.0 * math.pi / self.angles * a
        return FailureSite(place, {"the interaction's potential": float(potential[a, j, i])})

    def health(self) -> Health:
        """A density made positive and of mass 1; nothing moves."""
        return Health(1.0, 0.0, (0.0, 0.0), (0.0, 0.0))

    def counts(self) -> Counts:
        """Iterations, residual (integral of |q - exp(-V - U*q)/Z|), Z and the mass."""
        density, log_constant = self._boltzmann(self._potential)
        return {
            "steps": float(self._clock[_STEPS]),
            "rejected_steps": 0.0,
            "residual": float(self._clock[_RESIDUAL]),
            "normalising_constant": math.exp(min(log_constant, _LARGEST_LOG)),
            "mass_start": 1.0,
            "mass_end": float(density.sum()) * self._cell_volume,
            "mass_left": 0.0,
        }

    def coordinates(self) -> dict[str, Floats]:
        """Cell centres; angles are the multiples of 2 pi / na."""
        angle = 2.0 * np.pi / self.angles * np.arange(self.angles)
        return {"angle": np.asarray(angle, np.float64), "y": self.grid.y, "x": self.grid.x}


def _require_stationary(scene: Scene) -> None:
    particles = scene.particles
    if scene.flow is not None:
        found = "[flow]: a fluid drags particles round and round"
    elif scene.outer_potential is None:
        found = "no [outer_potential]: nothing keeps the particles together"
    elif scene.walls is not None:
        found = "[walls], whose ghosts this model does not have"
    elif scene.interaction is not None and particles.mass != particles.inertia:
        found = f"mass {particles.mass:g} and inertia {particles.inertia:g}, which differ"
    else:
        return
    raise InputError(
        f"scene {scene.name}, model stationary_state",
        "no [flow], no [walls], an [outer_potential] and, with [interaction], mass = inertia",
        found,
        "There is no stationary state of this form; choose another scene or model.",
    )


MODEL = StationaryState
