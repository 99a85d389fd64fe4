"""The nonlinear process `eq:ODE_mf` by samples: the microscopic model's limit of infinite N.

    dr = v dt        dv = [gamma (u - v) - 1/m int grad_r U f - grad V1 - (A^2/2) v] dt + A dW
    dtheta = omega dt
    domega = [gamma_bar (g - omega) - 1/I_c int dU/dtheta f - dV2/dtheta - (B^2/2) omega] dt + B dW

f is the density of S samples, S = particles.number * realisations. Without noise they start evenly
spread over the start box (in rows and columns, as near to S as there are: `even_start`) or all lie at
start.points; their paths then are quadrature points of f, and the error falls like 1/S. Results are
binned by the flow map that they are points of (`geometry.flow_map`), where no patch can catch them and
no side is periodic. With noise they start at random and draw what realisation k, particle i of
`microscopic` draws, so that the two can be compared path by path, in the scheme `paper` step by step;
the error falls like 1/sqrt(S).

Few samples, and slender ones, interact pair by pair, many by harmonics (`sample_choice`). Walls act as
in `microscopic`: by their ghost particles, summed exactly, and by reflection. By harmonics, samples
further out of an open domain than two ranges of the potential no longer interact.
"""

from __future__ import annotations

import math
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.tuning import SAMPLE_STEPS_PER_CALL
from ellipsoid_coupling.geometry.even_points import even_points
from ellipsoid_coupling.interaction.particle_mesh.direct_pairs import SamplePairs
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.select import choose_samples, scene_samples
from ellipsoid_coupling.models.base import Arrays, Counts, Setup
from ellipsoid_coupling.models.bounded import start_count
from ellipsoid_coupling.models.even_start import Lattice, flow_map_columns, sample_lattice
from ellipsoid_coupling.models.from_scene import scene_drift, scene_edges
from ellipsoid_coupling.models.kind import LineStyle, ModelKind
from ellipsoid_coupling.models.particle_model import ParticleModel, random_points, start_state
from ellipsoid_coupling.models.start_state import earlier_samples
from ellipsoid_coupling.models.summation import among_samples
from ellipsoid_coupling.particles.forces import BlockForces, Forces
from ellipsoid_coupling.particles.shared_clock import advance_shared_clock
from ellipsoid_coupling.particles.state import ParticleState
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]

# Samples a block: this many fit into cache, and a block costs as much besides as some fifty of them. Not a
# mere matter of speed: the error of all samples is a sum over blocks, which rounds by how they are cut.
_BLOCK = 1024


def _blocks_of_points(scene: Scene, lattice: Lattice) -> Floats:
    """Midpoints of rows x columns equal parts of the start box, row by row: (K, 2, B).

    As many rows are a block as make `_BLOCK` samples at most; two blocks at least, or a row.
    """
    rows, columns = lattice
    fitting = [n for n in range(1, rows) if rows % n == 0 and n * columns <= _BLOCK]
    blocks = rows // max(fitting, default=1)
    points = even_points(scene.start.x, scene.start.y, columns, rows).reshape(2, blocks, -1)
    return np.ascontiguousarray(points.swapaxes(0, 1))


def is_noisy(setup: Setup) -> bool:
    """Whether samples move at random, so that they start and come in at random, too."""
    return setup.terms.noise or setup.terms.angular_noise


def start_points(setup: Setup) -> Floats:
    """Where samples start, (K, 2, B): blocks are realisations, or without noise rows of even points."""
    scene, realisations = setup.scene, setup.realisations
    if is_noisy(setup):
        return random_points(scene, setup.seed, realisations)
    return _blocks_of_points(scene, lattice_of(setup))


def lattice_of(setup: Setup) -> Lattice:
    """How the samples of a run without noise start."""
    return sample_lattice(setup, setup.scene.particles.number * setup.realisations)


def _interact(
    interaction: SampleInteraction | SamplePairs,
    weights: tuple[float, float],
    frozen: Flags | None,
    samples: int,
    t: float,
    position: Floats,
    force: Floats,
) -> None:
    """`forces.BlockInteraction` of all samples that take part, each with the mass 1/samples."""
    del t  # the potential does not depend on it
    if frozen is None or not frozen.any():
        interaction.add_forces(position, weights, force)
        return
    moving = frozen == 0
    if moving.any():
        part = np.count_nonzero(moving) / samples
        some = np.ascontiguousarray(position.swapaxes(0, 1)[:, moving])[None]
        felt = np.zeros_like(some)
        interaction.add_forces(some, (part * weights[0], part * weights[1]), felt)
        force.swapaxes(0, 1)[:, moving] += felt[0]


class McKeanVlasov(ParticleModel):
    """`Model` of the nonlinear process."""

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "mckean_vlasov",
            label="McKean-Vlasov",
            layout="particles",
            rank=2,
            solves="their limit of infinite N, by samples of one density",
            style=LineStyle("#000000", (0.0, (1.0, 1.0)), "*"),
            random_motion=True,
            summation=among_samples,
        ),
    )

    def __init__(self, name: str, setup: Setup) -> None:
        edges, evenly = scene_edges(setup), not is_noisy(setup)
        points, earlier = start_points(setup), earlier_samples(setup)
        state = start_state(setup, edges, points, 1, earlier=earlier, evenly=evenly)
        samples = start_count(state)
        # Points of a density have no neighbour to pass: all of them together bound a step.
        super().__init__(name, setup, edges, state, math.inf if evenly else samples)
        # Of the flow map that results are points of; 0 where they are points of none.
        self._columns = flow_map_columns(setup, edges, lattice_of(setup).columns) if evenly else 0
        asked = scene_samples(setup.scene, samples)
        self._interaction = None if asked is None else choose_samples(asked)
        self._forces = self._forces_of(setup, state.frozen, samples)

    def _forces_of(self, setup: Setup, frozen: Flags | None, samples: int) -> Forces:
        particles, drift = setup.scene.particles, scene_drift(setup, self._edges)
        block, workspace = BlockForces(drift._replace(pairs=None), drift.pairs), BufferPool()
        if self._interaction is None:
            return Forces(block, None, workspace)
        weights = 1.0 / particles.mass, 1.0 / particles.inertia
        # A bound method would make a cycle of references, which delays that the model is freed.
        acting = partial(_interact, self._interaction, weights, frozen, samples)
        return Forces(block, acting, workspace)

    def _steps_per_call(self) -> int:
        return SAMPLE_STEPS_PER_CALL

    def _step(self, state: ParticleState, until: float, steps: int) -> None:
        forces, rates, limits = self._forces, self._rates, self._limits
        advance_shared_clock(self._stepper, state, forces, rates, limits, until, steps)

    def snapshot(self) -> Arrays:
        """x, y, angle, velocity_x, velocity_y, angular_velocity, each (1, S)."""
        return {name: values.reshape(1, -1) for name, values in super().snapshot().items()}

    def counts(self) -> Counts:
        """The steps and samples; harmonics and nodes of their interaction, 0 where it is pair by pair.

        `samples_across`: see `flow_map_columns`.
        """
        return super().counts() | {
            "samples": float(self._state.position[:, 0].size),
            "harmonics": float(self._interaction.harmonics if self._interaction else 0),
            "nodes_per_width": self._interaction.nodes_per_width if self._interaction else 0.0,
            "samples_across": float(self._columns),
        }


MODEL = McKeanVlasov
