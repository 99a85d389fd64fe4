"""What the models of particles share; each of them is a short file that says what its equation is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.finite_volume.diagnostics import survey_particles
from ellipsoid_coupling.geometry.boundaries import box_of_sides
from ellipsoid_coupling.models.base import Arrays, Counts, Health, Setup
from ellipsoid_coupling.models.failure_site import FLUID, OUTER, PAIRS, TORQUE, FailureSite, worst
from ellipsoid_coupling.models.flow_fit import rectangle, require_start_inside
from ellipsoid_coupling.models.from_scene import scene_mesh, scene_rates
from ellipsoid_coupling.models.kind import ModelKind
from ellipsoid_coupling.models.periodic import require_wide_periods
from ellipsoid_coupling.particles import STEPPERS
from ellipsoid_coupling.particles.collisions import (
    GHOSTS_IN_REACH,
    contact_of,
    highest,
    steepest,
)
from ellipsoid_coupling.particles.noise import STEPS_PER_BLOCK, gaussian_block, start_positions
from ellipsoid_coupling.particles.state import Contact, Limits, ParticleState
from ellipsoid_coupling.physics.outer import outer_force
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.stepping.status import MEANING
from ellipsoid_coupling.stepping.step_control import (
    GIVEN,
    LARGEST_FORCE,
    LARGEST_TORQUE,
    STATUS,
    TIME,
    new_clock,
    step_log,
)

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]


class ParticleModel(ABC):
    """A `Model` of blocks of particles; a subclass declares what it is and steps the blocks.

    Parameters
    ----------
    name : str
    setup : Setup
    state : ParticleState
        At the scene's start; a row of clock for each block, or one for all of them.
    number : int
        How many particles share the interaction's strength.
    """

    kinds: ClassVar[tuple[ModelKind, ...]]

    def __init__(self, name: str, setup: Setup, state: ParticleState, number: int) -> None:
        self.name = name
        self._setup = setup
        self._stepper = STEPPERS[setup.scheme]
        self._rates = scene_rates(setup)
        self._limits = scene_limits(setup, number)
        self._state = state
        # How many blocks of noise each clock has used.
        self._noise_blocks = np.zeros(len(state.clock), np.int64)

    @classmethod
    def require_fit(cls, setup: Setup) -> None:
        """Raise InputError for periods that particles would interact around."""
        require_wide_periods(setup.scene)

    @property
    def time(self) -> float:
        """The time that the slowest clock has reached."""
        return float(self._state.clock[:, TIME].min())

    def advance(self, until: float) -> None:
        """Some steps of every block; with noise, as many as a block of it is for."""
        noise = self._draw_noise(until)
        steps = self._steps_per_call() if noise is None else STEPS_PER_BLOCK
        self._step(self._state._replace(noise=noise), until, steps)
        require_none_left(self._state, self._setup, self.name)
        self._require_running()

    @abstractmethod
    def _steps_per_call(self) -> int:
        """How many steps `advance` takes without noise; no result depends on it."""

    @abstractmethod
    def _step(self, state: ParticleState, until: float, steps: int) -> None:
        """Move all blocks by at most `steps` steps, in place and never beyond `until`."""

    def _draw_noise(self, until: float) -> Floats | None:
        """The next block of noise of every realisation that is not there yet; None without noise."""
        rates, state, seed = self._rates, self._state, self._setup.seed
        components = (rates.last_noisy - rates.first_noisy) * self._stepper.noise_per_step
        if components == 0:
            return None
        realisations, _, number = state.place.shape
        first = self._setup.first_realisation
        # A realisation that has arrived keeps its block number, so that its noise does not depend on how
        # long the others take.
        late = state.clock[:, TIME] < until
        used = np.broadcast_to(self._noise_blocks, realisations)
        waiting = np.flatnonzero(np.broadcast_to(late, realisations))
        noise = np.zeros((realisations, STEPS_PER_BLOCK, components, number))

        def draw(task: int) -> None:
            k = int(waiting[task])
            noise[k] = gaussian_block(seed, first + k, int(used[k]), components, number)

        # Philox is drawn in C without Python's lock, so that threads help.
        for_each(len(waiting), draw)
        self._noise_blocks += late
        if state.frozen is not None:
            np.moveaxis(noise, -1, 1)[state.frozen != 0] = 0.0
        return noise

    def _require_running(self) -> None:
        status = self._state.clock[:, STATUS]
        if not status.any():
            return
        row = int(np.flatnonzero(status)[0])
        what, remedy = MEANING[int(status[row])]
        where = _where(
            self._state,
            self._setup,
            self.name,
            row if self.kinds[0].independent_realisations else None,
        )
        raise RunError(f"{where}: {what}. {self.failure_site()} {remedy}")

    def snapshot(self) -> Arrays:
        """x, y, angle, velocity_x, velocity_y, angular_velocity, each (blocks, particles)."""
        return particle_snapshot(self._state, self._setup.scene)

    def state(self) -> Arrays:
        """Positions, velocities, drift, clocks and the number of noise blocks used."""
        fields = self._state
        return {
            "place": fields.place,
            "velocity": fields.velocity,
            "force": fields.force,
            "clock": fields.clock,
            "blocks": self._noise_blocks,
        }

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`; who has left the flow's mesh lies outside of it, all others inside."""
        current = self.state()
        for name, array in state.items():
            current[name][...] = array
        place, frozen, flow = self._state.place, self._state.frozen, self._setup.flow
        if frozen is not None and flow is not None:
            frozen[...] = ~flow.evaluate(place[:, 0], place[:, 1]).inside

    def failure_site(self) -> FailureSite:
        """The particle that is pulled hardest."""
        return particle_failure_site(self._state, self._setup)

    def health(self) -> Health:
        """Speeds and forces of all particles, and whether all are inside."""
        return particle_health(self._state, box_of_sides(self._setup.scene, "reflect", "wrap"))

    def counts(self) -> Counts:
        """The steps, how many particles have left the flow's mesh, and the mass, which these take along."""
        left, number = count_frozen(self._state), self._state.place[:, 0].size
        return step_log(self._state.clock) | {
            "particles_outside_flow": float(left),
            "mass_start": 1.0,
            "mass_end": (number - left) / number,
            "mass_left": left / number,
        }

    def coordinates(self) -> dict[str, Floats]:
        """Blocks and particles are plain counts."""
        return {}


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


def scene_limits(setup: Setup, number: int) -> Limits:
    """Step size, tolerance, reflecting box, mesh that can be left, contacts and periods of the steppers.

    number : how many particles share the interaction's strength
    """
    numerics = setup.scene.numerics
    scale = np.array([setup.scene.particles.length] * 2 + [1.0])[: 3 if setup.terms.angle else 2]
    box, periods = box_of_sides(setup.scene, "reflect"), box_of_sides(setup.scene, "wrap")
    contact = scene_contact(setup, scale, number)
    mesh = scene_mesh(setup)
    return Limits(numerics.time_step, numerics.tolerance, scale, box, mesh, contact, periods)


def random_points(scene: Scene, seed: int, realisations: int, first: int = 0) -> Floats:
    """Uniform over the start box, (realisations, 2, N): one stream of numbers a realisation.

    first : the number of the first realisation
    """
    low = np.array([scene.start.x[0], scene.start.y[0]])[:, None]
    high = np.array([scene.start.x[1], scene.start.y[1]])[:, None]
    number = scene.particles.number
    numbers = range(first, first + realisations)
    return np.array([low + (high - low) * start_positions(seed, k, number) for k in numbers])


def start_at_rest(setup: Setup, points: Floats, clocks: int) -> ParticleState:
    """Particles at rest at `points` (blocks, 2, n), at the start angle, with so many rows of clock.

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
    clock = new_clock(clocks, setup.scene.numerics.time_step, GIVEN)
    return ParticleState(
        place, np.zeros_like(place), np.zeros_like(place), clock, None, none_frozen(setup, place)
    )


def none_frozen(setup: Setup, place: Floats) -> Flags | None:
    """The flags (blocks, n) of particles at `place` (blocks, D, n), none of which has left the mesh."""
    if scene_mesh(setup) is None:
        return None
    return np.zeros((place.shape[0], place.shape[2]), np.uint8)


def count_frozen(state: ParticleState) -> int:
    """How many particles have left the flow's mesh."""
    return 0 if state.frozen is None else int(np.count_nonzero(state.frozen))


def _where(state: ParticleState, setup: Setup, name: str, block: int | None) -> str:
    """Scene, model, realisation unless it is None, and time; for the message of a failure."""
    row = 0 if block is None or len(state.clock) == 1 else block
    which = "" if block is None else f"realisation {setup.first_realisation + block}, "
    return f"{setup.scene.name}, {name}, {which}t = {state.clock[row, TIME]:.6g}"


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
    raise RunError(
        f"{_where(state, setup, name, block)}: "
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


def particle_failure_site(state: ParticleState, setup: Setup) -> FailureSite:
    """The particle that is pulled hardest."""
    place, force = (np.moveaxis(a, 1, 0).reshape(a.shape[1], -1) for a in state[:3:2])
    i = worst(force)
    x, y = float(place[0, i]), float(place[1, i])
    scene, fluid = setup.scene, np.zeros(2)
    if setup.flow is not None and scene.flow is not None:
        sample = setup.flow.evaluate(x, y)
        fluid = scene.flow.drag * np.array([float(sample.velocity_x), float(sample.velocity_y)])
    outer = np.array(outer_force(scene.outer_potential, x, y))
    terms = {
        FLUID: float(np.hypot(*fluid)),
        OUTER: float(np.hypot(*outer)),
        PAIRS: float(np.hypot(*(force[:2, i] - fluid - outer))),
        TORQUE: float(np.abs(force[2:, i]).max(initial=0.0)),
    }
    return FailureSite((x, y, *map(float, place[2:, i])), terms)


def particle_health(state: ParticleState, box: Floats | None) -> Health:
    """Of all realisations together; none may be outside of `box`, which reflects or wraps."""
    place, velocity, force = state[:3]
    v, omega, _, _, outside = survey_particles(place, velocity, force, box)
    clock = state.clock
    forces = float(clock[:, LARGEST_FORCE].max()), float(clock[:, LARGEST_TORQUE].max())
    inside = 1.0 - count_frozen(state) / state.place[:, 0].size
    return Health(inside, 0.0, (v, omega), forces, outside)
