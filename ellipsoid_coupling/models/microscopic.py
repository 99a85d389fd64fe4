"""The microscopic model `eq:micro`: N interacting particles, many realisations.

dr = v dt        dv = [gamma (u - v) - 1/(m N) sum_j grad_r U - grad V1 - (A^2/2) v] dt + A dW
dtheta = omega dt
domega = [gamma_bar (g - omega) - 1/(I_c N) sum_j dU/dtheta - dV2/dtheta - (B^2/2) omega] dt
         + B dW

Realisations know nothing of one another: each has its own clock. Small ones are shared among the
threads; a large one has all threads to itself, one realisation after another.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.compiled.tuning import (
    FREE_PARTICLE_STEPS_PER_CALL,
    LARGE_CLOUD,
    MANY_FREE_PARTICLE_STEPS_PER_CALL,
    MANY_FREE_PARTICLES,
    PAIR_STEPS_PER_CALL,
)
from ellipsoid_coupling.interaction.pairs.threaded_pair_sum import LargeCloud
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.models.from_scene import scene_drift, scene_edges
from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.particle_model import ParticleModel, random_points, start_state
from ellipsoid_coupling.models.start_state import earlier_realisations
from ellipsoid_coupling.models.summation import pair_by_pair
from ellipsoid_coupling.particles.forces import BlockForces, Forces
from ellipsoid_coupling.particles.own_clock import advance_own_clocks
from ellipsoid_coupling.particles.shared_clock import advance_shared_clock
from ellipsoid_coupling.particles.state import ParticleState, realisation

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]


class Microscopic(ParticleModel):
    """`Model` of the microscopic system."""

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "microscopic",
            label="microscopic",
            layout="particles",
            rank=1,
            solves="N interacting particles with noise, in independent realisations",
            style=LineStyle("#0072B2", "-", "o"),
            independent_realisations=True,
            random_motion=True,
            summation=pair_by_pair,
        ),
    )

    def __init__(self, name: str, setup: Setup) -> None:
        scene, realisations = setup.scene, setup.realisations
        number = scene.particles.number
        points = random_points(scene, setup.seed, realisations, setup.first_realisation)
        edges = scene_edges(setup)
        earlier = earlier_realisations(setup)
        start = start_state(setup, edges, points, realisations, earlier=earlier)
        super().__init__(name, setup, edges, start, number)
        self._drift = scene_drift(setup, edges)
        slots = start.position.shape[2]
        self._large = LargeCloud(self._drift, slots) if slots >= LARGE_CLOUD else None
        self._workspace = BufferPool()

    def _steps_per_call(self) -> int:
        if self._drift.pairs is not None:
            return PAIR_STEPS_PER_CALL
        many = self._state.position[:, 0].size >= MANY_FREE_PARTICLES
        return MANY_FREE_PARTICLE_STEPS_PER_CALL if many else FREE_PARTICLE_STEPS_PER_CALL

    def _step(self, state: ParticleState, until: float, steps: int) -> None:
        stepper, rates, limits = self._stepper, self._rates, self._limits
        if self._large is None:
            forces = BlockForces(self._drift, None)
            advance_own_clocks(stepper, state, forces, rates, limits, until, steps)
            return
        for k in range(len(state.position)):
            one = plain(realisation)(state, k)
            frozen = None if one.frozen is None else one.frozen[0]
            cloud = Forces(None, partial(self._large.set_forces, frozen=frozen), self._workspace)
            advance_shared_clock(stepper, one, cloud, rates, limits, until, steps)


MODEL = Microscopic
