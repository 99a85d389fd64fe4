"""The microscopic model `eq:micro`: N interacting particles, many realisations.

dr = v dt        dv = [gamma (u - v) - 1/(m N) sum_j grad_r U - grad V1 - (A^2/2) v] dt + A dW
dtheta = omega dt
domega = [gamma_bar (g - omega) - 1/(I_c N) sum_j dU/dtheta - dV2/dtheta - (B^2/2) omega] dt
         + B dW
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import KeptArrays
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.interaction.pairs.threaded_pair_sum import LEAST_LARGE, LargeCloud
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
from ellipsoid_coupling.particles import SCHEMES
from ellipsoid_coupling.particles.blocks import Forces
from ellipsoid_coupling.particles.noise import STEPS_PER_BLOCK, gaussian_block
from ellipsoid_coupling.particles.shared_clock import TOGETHER
from ellipsoid_coupling.particles.state import ParticleState
from ellipsoid_coupling.stepping.status import MEANING
from ellipsoid_coupling.stepping.step_control import GIVEN, STATUS, TIME, new_clock

Floats = NDArray[np.float64]

# Without noise a call of `advance` may take any number of steps. The monitors look after each, and
# progress is shown.
_STEPS_PER_CALL, _FREE_STEPS_PER_CALL = 16, 32
# So many free particles are stepped one realisation at a time, in the second cache, and looked at all
# together, from memory (128 x 1000 of them, `paper`: a look is 2.0 % of 32 steps, 1.3 % of 48).
_MANY, _MANY_STEPS_PER_CALL = 30_000, 48


def start_state(setup: Setup) -> ParticleState:
    """All realisations at rest, evenly random in the start box or at start.points."""
    scene, realisations = setup.scene, setup.realisations
    place, velocity = start_at_rest(setup, random_points(scene, setup.seed, realisations))
    clock = new_clock(realisations, scene.numerics.time_step, GIVEN)
    frozen = none_frozen(setup, place)
    return ParticleState(place, velocity, velocity.copy(), clock, None, frozen)


def one_of(state: ParticleState, k: int) -> ParticleState:
    """Realisation k, as views."""
    noise = None if state.noise is None else state.noise[k : k + 1]
    frozen = None if state.frozen is None else state.frozen[k : k + 1]
    place, velocity, force, clock = (array[k : k + 1] for array in state[:4])
    return ParticleState(place, velocity, force, clock, noise, frozen)


class Microscopic:
    """`Model` of the microscopic system."""

    names: ClassVar[tuple[str, ...]] = ("microscopic",)
    layout: ClassVar[Literal["particles", "rho", "q"]] = "particles"
    together: ClassVar[bool] = False

    def __init__(self, name: str, setup: Setup) -> None:
        self.name = name
        self._setup = setup
        self._stepper = SCHEMES[setup.scheme]
        self._drift = scene_drift(setup)
        self._rates = scene_rates(setup)
        self._limits = scene_limits(setup)
        self._state = start_state(setup)
        self._blocks = np.zeros(setup.realisations, np.int64)
        number = setup.scene.particles.number
        self._large = LargeCloud(self._drift, number) if number >= LEAST_LARGE else None
        self._room = KeptArrays()

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Raise InputError for periodic sides."""
        require_no_period(setup.scene, "microscopic")

    @property
    def time(self) -> float:
        """The time that the slowest realisation has reached."""
        return float(self._state.clock[:, TIME].min())

    def advance(self, until: float) -> None:
        """Some steps of every realisation; with noise, as many as a block of it is for."""
        state = self._state._replace(noise=self._draw_noise(until))
        steps = self._steps_per_call() if state.noise is None else STEPS_PER_BLOCK
        rates, limits = self._rates, self._limits
        if self._large is None:
            self._stepper.advance(state, self._drift, rates, limits, until, steps)
        else:
            together = TOGETHER[self._setup.scheme]
            for k in range(state.place.shape[0]):
                one = one_of(state, k)
                frozen = None if one.frozen is None else one.frozen[0]
                acting = partial(self._large.set_forces, frozen=frozen)
                forces = Forces(None, acting, self._room)
                together.advance(one, forces, rates, limits, until, steps)
        self._check()

    def _steps_per_call(self) -> int:
        """Without noise."""
        if self._drift.pairs is not None:
            return _STEPS_PER_CALL
        realisations, _, number = self._state.place.shape
        return _MANY_STEPS_PER_CALL if realisations * number >= _MANY else _FREE_STEPS_PER_CALL

    def _draw_noise(self, until: float) -> Floats | None:
        """The next block of noise of every realisation that is not there yet; None without noise."""
        rates = self._rates
        components = (rates.last_noisy - rates.first_noisy) * self._stepper.NOISE_PER_STEP
        if components == 0:
            return None
        realisations, _, number = self._state.place.shape
        noise = np.zeros((realisations, STEPS_PER_BLOCK, components, number))
        for k in np.flatnonzero(self._state.clock[:, TIME] < until):
            block = int(self._blocks[k])
            noise[k] = gaussian_block(self._setup.seed, int(k), block, components, number)
            self._blocks[k] += 1
        silence(self._state, noise)
        return noise

    def _check(self) -> None:
        require_none_left(self._state, self._setup, self.name)
        clock = self._state.clock
        status = clock[:, STATUS]
        if not status.any():
            return
        worst = int(np.flatnonzero(status)[0])
        what, remedy = MEANING[int(status[worst])]
        raise RunError(
            f"{self._setup.scene.name}, {self.name}, realisation {worst}, "
            f"t = {clock[worst, TIME]:.6g}: {what}. {self.spot()} {remedy}"
        )

    def snapshot(self) -> Arrays:
        """x, y, angle, velocity_x, velocity_y, angular_velocity, each (R, N)."""
        return particle_snapshot(self._state, self._setup.scene)

    def state(self) -> Arrays:
        """Positions, velocities, drift, clocks and the number of noise blocks used."""
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
        """The steps and the mass."""
        return particle_counts(self._state)

    def coordinates(self) -> dict[str, Floats]:
        """Realisations and particles are plain counts."""
        return {}


MODEL = Microscopic
