"""What the models of particles share; each of them is a short file that says what its equation is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.geometry.boundaries import box_of_sides
from ellipsoid_coupling.geometry.fate_codes import INSIDE
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges
from ellipsoid_coupling.models.base import Arrays, Counts, Health, Setup
from ellipsoid_coupling.models.bounded import (
    health_at_edges,
    off_the_edges,
    require_fluid_at_inlets,
    require_start_in_fluid,
    restore_fates,
    start_count,
    with_fates,
)
from ellipsoid_coupling.models.ended import fate_log
from ellipsoid_coupling.models.failure_site import FailureSite
from ellipsoid_coupling.models.flow_fit import rectangle, require_start_inside
from ellipsoid_coupling.models.from_scene import scene_mesh, scene_rates
from ellipsoid_coupling.models.kind import ModelKind
from ellipsoid_coupling.models.particle_reports import (
    count_frozen,
    particle_failure_site,
    particle_health,
    particle_snapshot,
)
from ellipsoid_coupling.models.periodic import require_wide_periods
from ellipsoid_coupling.models.start_state import Moving, start_velocity
from ellipsoid_coupling.particles import STEPPERS
from ellipsoid_coupling.particles.collisions import (
    GHOSTS_IN_REACH,
    contact_of,
    highest,
    steepest,
)
from ellipsoid_coupling.particles.fates import all_inside
from ellipsoid_coupling.particles.noise import STEPS_PER_BLOCK, gaussian_block, start_positions
from ellipsoid_coupling.particles.state import Contact, Limits, ParticleState
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.stepping.status import MEANING
from ellipsoid_coupling.stepping.step_control import (
    GIVEN,
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
    edges : FluidEdges or None
        As of `scene_edges`.
    state : ParticleState
        At the scene's start; a row of clock for each block, or one for all of them.
    number : float
        How many particles share the interaction's strength; inf for a density.
    """

    kinds: ClassVar[tuple[ModelKind, ...]]

    def __init__(
        self,
        name: str,
        setup: Setup,
        edges: FluidEdges | None,
        state: ParticleState,
        number: float,
    ) -> None:
        self.name = name
        self._setup = setup
        self._edges = edges
        self._stepper = STEPPERS[setup.scheme]
        self._rates = scene_rates(setup)
        self._limits = scene_limits(setup, edges, number)
        self._state = state
        # Those of the start, which hold a mass of 1.
        self._start = start_count(state)
        # How many blocks of noise each clock has used.
        self._noise_blocks = np.zeros(len(state.clock), np.int64)

    @classmethod
    def require_fit(cls, setup: Setup) -> None:
        """Raise InputError for periods that particles would interact around, or an inlet without fluid."""
        require_wide_periods(setup.scene)
        require_fluid_at_inlets(setup.scene)

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
        realisations, _, number = state.position.shape
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
        if state.fates is not None:
            np.moveaxis(noise, -1, 1)[state.fates.code > INSIDE] = 0.0
        elif state.frozen is not None:
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
        arrays: Arrays = {
            "place": fields.position,  # its name in checkpoints
            "velocity": fields.velocity,
            "force": fields.force,
            "clock": fields.clock,
            "blocks": self._noise_blocks,
        }
        if fields.fates is not None:
            arrays |= {"fate": fields.fates.code, "fate_time": fields.fates.time}
        return arrays

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`: who takes part follows from fates, or else from the flow's mesh.

        Who has left that mesh lies outside of it, all others inside.

        Raises
        ------
        InputError
            For fates that no run has.
        """
        current = self.state()
        for name, array in state.items():
            current[name][...] = array
        position, frozen, flow = self._state.position, self._state.frozen, self._setup.flow
        if self._state.fates is not None:
            assert self._edges is not None
            restore_fates(self._state, len(self._edges.names))
        elif frozen is not None and flow is not None:
            frozen[...] = ~flow.at(self.time).evaluate(position[:, 0], position[:, 1]).inside

    def failure_site(self) -> FailureSite:
        """The particle that is pulled hardest."""
        return particle_failure_site(self._state, self._setup)

    def health(self) -> Health:
        """Speeds and forces of all particles, and whether all are inside."""
        if self._edges is not None:
            return health_at_edges(self._state, self._edges, self._start)
        return particle_health(self._state, box_of_sides(self._setup.scene, "reflect", "wrap"))

    def counts(self) -> Counts:
        """The steps, how many particles have left the flow's mesh, and the mass, which these take along.

        Where patches bound the fluid: how many have ended at each, and how much mass has come in.
        """
        if self._edges is not None:
            fates = self._state.fates or all_inside(1, self._start)
            log = fate_log(fates, self._state.births, self._edges, self._start)
            return step_log(self._state.clock) | log
        left, number = count_frozen(self._state), self._state.position[:, 0].size
        return step_log(self._state.clock) | {
            "particles_outside_flow": float(left),
            "mass_start": 1.0,
            "mass_end": (number - left) / number,
            "mass_left": left / number,
        }

    def coordinates(self) -> dict[str, Floats]:
        """Blocks and particles are plain counts."""
        return {}


def scene_contact(setup: Setup, scale: Floats, number: float) -> Contact | None:
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


def scene_limits(setup: Setup, edges: FluidEdges | None, number: float) -> Limits:
    """Step size, tolerance, contacts and periods of the steppers, and what bounds the particles.

    edges : as of `scene_edges`; without them a reflecting box, and a mesh that can be left
    number : how many particles share the interaction's strength; inf for a density
    """
    numerics = setup.scene.numerics
    scale = np.array([setup.scene.particles.length] * 2 + [1.0])[: 3 if setup.terms.angle else 2]
    box, periods = box_of_sides(setup.scene, "reflect"), box_of_sides(setup.scene, "wrap")
    contact = scene_contact(setup, scale, number)
    mesh = scene_mesh(setup)
    if edges is not None:
        box = None
    return Limits(
        numerics.time_step,
        numerics.tolerance,
        scale,
        box,
        mesh,
        contact,
        periods,
        None if edges is None else edges.grid,
    )


def random_points(scene: Scene, seed: int, realisations: int, first: int = 0) -> Floats:
    """Uniform over the start box, (realisations, 2, N): one stream of numbers a realisation.

    first : the number of the first realisation
    """
    low = np.array([scene.start.x[0], scene.start.y[0]])[:, None]
    high = np.array([scene.start.x[1], scene.start.y[1]])[:, None]
    number = scene.particles.number
    numbers = range(first, first + realisations)
    return np.array([low + (high - low) * start_positions(seed, k, number) for k in numbers])


def start_state(
    setup: Setup,
    edges: FluidEdges | None,
    points: Floats,
    clocks: int,
    *,
    earlier: Moving | None = None,
    evenly: bool = False,
) -> ParticleState:
    """Particles at `points` (blocks, 2, n), at the start angle, with so many rows of clock.

    With start.points these are where all realisations start, whatever `points` are, and likewise
    `earlier`, those of start.file. Behind them stand slots for those that inlets feed in, at random or
    `evenly`.

    Raises
    ------
    InputError
        If one starts in a solid or beyond the flow's mesh.
    """
    start = setup.scene.start
    clock = new_clock(clocks, setup.scene.numerics.time_step, GIVEN)
    if earlier is not None:
        return placed(setup, edges, earlier.position, clock, earlier.velocity, evenly=evenly)
    positions = np.array(start.places())
    if positions.size:
        points = np.broadcast_to(positions[:, :2].T, (setup.realisations, 2, len(positions)))
    blocks, _, size = points.shape
    position = np.full((blocks, 3 if setup.terms.angle else 2, size), start.own_angle)
    position[:, :2] = points
    if positions.size:
        position[:, 2:] = positions[:, 2]
    return placed(setup, edges, position, clock, evenly=evenly)


def placed(
    setup: Setup,
    edges: FluidEdges | None,
    position: Floats,
    clock: Floats,
    velocity: Floats | None = None,
    *,
    evenly: bool = False,
) -> ParticleState:
    """Particles at `position` (blocks, D, n) with that velocity, or the scene's; see `start_state`."""
    scene = setup.scene
    if edges is None:
        require_start_inside(scene, setup.flow, position[:, 0], position[:, 1])
    else:
        require_start_in_fluid(setup, edges, position[:, 0], position[:, 1])
        position[:, :2] = off_the_edges(edges, position[:, :2])
    moving = start_velocity(setup, position) if velocity is None else velocity
    still, frozen = np.zeros_like(position), None
    if edges is None and scene_mesh(setup) is not None:
        frozen = np.zeros((position.shape[0], position.shape[2]), np.uint8)
    state = ParticleState(position, moving, still, clock, None, frozen)
    return state if edges is None else with_fates(state, setup, edges, evenly)


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
    x, y = (float(value) for value in state.position[block, :2, i])
    raise RunError(
        f"{_where(state, setup, name, block)}: "
        f"a particle has left the flow at ({x:.6g}, {y:.6g}). Its mesh lies in "
        f"{rectangle(setup.flow)}, less the solids in it, which do not reflect. "
        'Use a smaller time step, a flow without solids, or domain.boundary = "open".'
    )
