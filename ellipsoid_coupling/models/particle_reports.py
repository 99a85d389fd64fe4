"""What a run says of its particles: snapshots, the place of a failure, and what the monitors check."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.diagnostics import survey_particles
from ellipsoid_coupling.geometry.fate_codes import FIRST_PATCH, NOT_YET
from ellipsoid_coupling.models.base import Arrays, Health, Setup
from ellipsoid_coupling.models.failure_site import FLUID, OUTER, PAIRS, TORQUE, FailureSite, worst
from ellipsoid_coupling.particles.state import ParticleState
from ellipsoid_coupling.physics.outer import outer_force, scene_outer
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.stepping.step_control import LARGEST_FORCE, LARGEST_TORQUE, TIME

Floats = NDArray[np.float64]


def count_frozen(state: ParticleState) -> int:
    """How many particles have left the flow's mesh."""
    return 0 if state.frozen is None else int(np.count_nonzero(state.frozen))


def _still_angles(scene: Scene, number: int) -> Floats:
    """Where nothing turns, (number,): each point's own angle, or that of all."""
    angles = np.full(number, scene.start.own_angle)
    if positions := scene.start.places():
        angles[: len(positions)] = [angle for _, _, angle in positions]
    return angles


def particle_snapshot(state: ParticleState, scene: Scene) -> Arrays:
    """x, y, angle, velocity_x, velocity_y, angular_velocity, each a copy (R, N).

    Where nothing turns, the angle is that of the start and the angular velocity 0. Where the flow's
    mesh can be left, `frozen` is 1 for those that have. Where particles can end at patches, `fate` is a
    code of `geometry.fate_codes`, and `end_time` tells when they ended, NaN before; before its birth a
    particle has no position.
    """
    position, velocity = state.position, state.velocity
    turns, still = position.shape[1] == 3, np.zeros(position[:, 0].shape)
    if not turns:
        still += _still_angles(scene, position.shape[2])
    values = {
        "x": position[:, 0].copy(),
        "y": position[:, 1].copy(),
        "angle": (position[:, 2] if turns else still) + scene.start.turns,
        "velocity_x": velocity[:, 0].copy(),
        "velocity_y": velocity[:, 1].copy(),
        "angular_velocity": velocity[:, 2].copy() if turns else np.zeros(still.shape),
    }
    if state.births is not None and state.fates is not None:
        for array in values.values():
            array[state.fates.code == NOT_YET] = np.nan
    return {**values, **_marks(state)}


def _marks(state: ParticleState) -> Arrays:
    """Which particles take no part, and why."""
    if state.fates is not None:
        code, time = state.fates
        return {"fate": code.copy(), "end_time": np.where(code >= FIRST_PATCH, time, np.nan)}
    return {} if state.frozen is None else {"frozen": state.frozen.astype(np.float64)}


def particle_failure_site(state: ParticleState, setup: Setup) -> FailureSite:
    """The particle that is pulled hardest."""
    position, force = (np.moveaxis(a, 1, 0).reshape(a.shape[1], -1) for a in state[:3:2])
    i = worst(force)
    x, y = float(position[0, i]), float(position[1, i])
    scene, fluid = setup.scene, np.zeros(2)
    if setup.flow is not None and scene.flow is not None:
        sample = setup.flow.at(float(state.clock[:, TIME].min())).evaluate(x, y)
        fluid = scene.flow.drag * np.array([float(sample.velocity_x), float(sample.velocity_y)])
    outer = np.array(outer_force(scene_outer(scene), x, y))
    terms = {
        FLUID: float(np.hypot(*fluid)),
        OUTER: float(np.hypot(*outer)),
        PAIRS: float(np.hypot(*(force[:2, i] - fluid - outer))),
        TORQUE: float(np.abs(force[2:, i]).max(initial=0.0)),
    }
    return FailureSite((x, y, *map(float, position[2:, i])), terms)


def particle_health(state: ParticleState, box: Floats | None) -> Health:
    """Of all realisations together; none may be outside of `box`, which reflects or wraps."""
    position, velocity, force = state[:3]
    v, omega, _, _, outside = survey_particles(position, velocity, force, box)
    clock = state.clock
    forces = float(clock[:, LARGEST_FORCE].max()), float(clock[:, LARGEST_TORQUE].max())
    inside = 1.0 - count_frozen(state) / state.position[:, 0].size
    return Health(inside, 0.0, (v, omega), forces, outside)
