"""The nonlinear process `eq:ODE_mf` by samples: the microscopic model's limit of infinite N.

    dr = v dt        dv = [gamma (u - v) - 1/m int grad_r U f - grad V1 - (A^2/2) v] dt + A dW
    dtheta = omega dt
    domega = [gamma_bar (g - omega) - 1/I_c int dU/dtheta f - dV2/dtheta - (B^2/2) omega] dt + B dW

f is the density of S samples, S = particles.number * realisations. Without noise they start evenly
spread over the start box (a square number of them, as near to S as there is) or all lie at
start.points; their paths then are quadrature points of f, and the error falls like 1/S. With noise
they start at random and draw what realisation k, particle i of `microscopic` draws, so that the two
can be compared path by path, in the scheme `paper` step by step; the error falls like 1/sqrt(S).

Few samples, and slender ones, interact pair by pair, many by harmonics (`sample_choice`). Walls act as
in `microscopic`: by their ghost particles, summed exactly, and by reflection. By harmonics, samples
further out of an open domain than two ranges of the potential no longer interact.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import KeptArrays
from ellipsoid_coupling.compiled.jit import for_each
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.select import choose_samples, scene_samples
from ellipsoid_coupling.models.base import Arrays, Counts, Health, Setup
from ellipsoid_coupling.models.failure_site import Spot
from ellipsoid_coupling.models.from_scene import (
    freeze_again,
    none_frozen,
    particle_counts,
    particle_health,
    particle_snapshot,
    particle_spot,
    random_points,
    require_none_left,
    scene_drift,
    scene_limits,
    scene_rates,
    silence,
    start_at_rest,
)
from ellipsoid_coupling.models.periodic import require_no_period
from ellipsoid_coupling.particles.blocks import Alone, Forces
from ellipsoid_coupling.particles.noise import STEPS_PER_BLOCK, gaussian_block
from ellipsoid_coupling.particles.shared_clock import TOGETHER
from ellipsoid_coupling.particles.state import ParticleState
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.stepping.status import MEANING, RUNNING
from ellipsoid_coupling.stepping.step_control import GIVEN, STATUS, TIME, new_clock

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]

# Without noise a call of `advance` may take any number of steps; a few show progress often enough.
_STEPS_PER_CALL = 8
# A block costs as much besides as some fifty of its samples; this many fit into cache.
_BLOCK = 1024


def even_points(scene: Scene, samples: int) -> Floats:
    """Midpoints of side x side equal parts of the start box, row by row: (K, 2, B).

    As many rows are a block as make `_BLOCK` samples at most; two blocks at least, or a row.
    """
    side = max(1, round(np.sqrt(samples)))
    part = (np.arange(side) + 0.5) / side
    x = scene.start.x[0] + (scene.start.x[1] - scene.start.x[0]) * part
    y = scene.start.y[0] + (scene.start.y[1] - scene.start.y[0]) * part
    fitting = [rows for rows in range(1, side) if side % rows == 0 and rows * side <= _BLOCK]
    blocks = side // max(fitting, default=1)
    points = np.stack(np.meshgrid(x, y)).reshape(2, blocks, -1)
    return np.ascontiguousarray(points.swapaxes(0, 1))


def start_state(setup: Setup) -> ParticleState:
    """All samples at rest, at the start angle; blocks are rows of points or realisations."""
    scene, realisations = setup.scene, setup.realisations
    if setup.terms.noise or setup.terms.angular_noise:
        points = random_points(scene, setup.seed, realisations)
    else:
        points = even_points(scene, scene.particles.number * realisations)
    place, velocity = start_at_rest(setup, points)
    clock = new_clock(1, scene.numerics.time_step, GIVEN)
    frozen = none_frozen(setup, place)
    return ParticleState(place, velocity, velocity.copy(), clock, None, frozen)


def _interact(
    interaction: SampleInteraction | SamplePairs,
    weights: tuple[float, float],
    frozen: Flags | None,
    place: Floats,
    force: Floats,
) -> int:
    """Add what those that have not left the flow's mesh do to each other; each keeps its mass."""
    if frozen is None or not frozen.any():
        interaction.add_forces(place, weights, force)
        return 0
    moving = frozen == 0
    if moving.any():
        part = np.count_nonzero(moving) / moving.size
        some = np.ascontiguousarray(place.swapaxes(0, 1)[:, moving])[None]
        felt = np.zeros_like(some)
        interaction.add_forces(some, (part * weights[0], part * weights[1]), felt)
        force.swapaxes(0, 1)[:, moving] += felt[0]
    return 0


class McKeanVlasov:
    """`Model` of the nonlinear process."""

    names: ClassVar[tuple[str, ...]] = ("mckean_vlasov",)
    layout: ClassVar[Literal["particles", "rho", "q"]] = "particles"
    together: ClassVar[bool] = True

    def __init__(self, name: str, setup: Setup) -> None:
        self.name = name
        self._setup = setup
        self._stepper = TOGETHER[setup.scheme]
        drift = scene_drift(setup)
        particles = setup.scene.particles
        weights = 1.0 / particles.mass, 1.0 / particles.inertia
        self._rates = scene_rates(setup)
        self._state = start_state(setup)
        samples = self._state.place.shape[0] * self._state.place.shape[2]
        self._limits = scene_limits(setup, samples)
        asked = scene_samples(setup.scene, samples)
        self._interaction = None if asked is None else choose_samples(asked)
        alone = Alone(drift._replace(pairs=None), drift.pairs)
        # Not a method: a model that refers to itself keeps its memory until the garbage is collected.
        acting = self._interaction
        together = (
            None if acting is None else partial(_interact, acting, weights, self._state.frozen)
        )
        self._forces = Forces(alone, together, KeptArrays())
        self._blocks = np.zeros(1, np.int64)

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Raise InputError for periodic sides."""
        require_no_period(setup.scene, "mckean_vlasov")

    @property
    def time(self) -> float:
        """The time that all samples have reached."""
        return float(self._state.clock[0, TIME])

    def advance(self, until: float) -> None:
        """A few steps of all samples; as many as there is noise for in one block of it."""
        state = self._state._replace(noise=self._draw_noise())
        steps = _STEPS_PER_CALL if state.noise is None else STEPS_PER_BLOCK
        self._stepper.advance(state, self._forces, self._rates, self._limits, until, steps)
        self._check()

    def _draw_noise(self) -> Floats | None:
        """The next block of every realisation's noise; None without noise."""
        rates = self._rates
        components = (rates.last_noisy - rates.first_noisy) * self._stepper.noise_per_step
        if components == 0:
            return None
        realisations, _, number = self._state.place.shape
        noise = np.empty((realisations, STEPS_PER_BLOCK, components, number))
        block, seed = int(self._blocks[0]), self._setup.seed

        def draw(k: int) -> None:
            noise[k] = gaussian_block(seed, k, block, components, number)

        for_each(realisations, draw)
        self._blocks += 1
        silence(self._state, noise)
        return noise

    def _check(self) -> None:
        require_none_left(self._state, self._setup, self.name)
        status = int(self._state.clock[0, STATUS])
        if status != RUNNING:
            what, remedy = MEANING[status]
            raise RunError(
                f"{self._setup.scene.name}, {self.name}, t = {self.time:.6g}: {what}. "
                f"{self.spot()} {remedy}"
            )

    def snapshot(self) -> Arrays:
        """x, y, angle, velocity_x, velocity_y, angular_velocity, each (1, S)."""
        blocks = particle_snapshot(self._state, self._setup.scene)
        return {name: values.reshape(1, -1) for name, values in blocks.items()}

    def state(self) -> Arrays:
        """Positions, velocities, drift, clock and the number of noise blocks used."""
        fields = self._state
        return {
            "place": fields.place,
            "velocity": fields.velocity,
            "force": fields.force,
            "clock": fields.clock,
            "blocks": self._blocks,
        }

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`."""
        current = self.state()
        for name, array in state.items():
            current[name][...] = array
        freeze_again(self._state, self._setup.flow)

    def spot(self) -> Spot:
        """The particle that is pulled hardest."""
        return particle_spot(self._state, self._setup)

    def health(self) -> Health:
        """Speeds and forces of all particles, and whether all are inside."""
        return particle_health(self._state, self._limits.box)

    def counts(self) -> Counts:
        """The steps and samples; harmonics and nodes of their interaction, 0 where it is pair by pair."""
        return particle_counts(self._state) | {
            "samples": float(self._state.place[:, 0].size),
            "harmonics": float(self._interaction.harmonics if self._interaction else 0),
            "nodes_per_width": self._interaction.nodes_per_width if self._interaction else 0.0,
        }

    def coordinates(self) -> dict[str, Floats]:
        """Samples are plain counts."""
        return {}


MODEL = McKeanVlasov
