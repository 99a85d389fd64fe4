"""The exact solution where particles do not interact: sample points pushed at high order.

Without interaction and noise every particle follows an ordinary differential equation of its own. Evenly
spread sample points of the start box, pushed by the classical fourth-order Runge-Kutta rule with a step
that resolves the drag, give the density and the distribution of angles that all models approximate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compare.resolutions import has_noise
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.threads import for_each
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, FlowSeries, Window, open_window, require_covered
from ellipsoid_coupling.geometry.even_points import even_points
from ellipsoid_coupling.interaction.particle_forces import Drift, particle_forces
from ellipsoid_coupling.models import ADAPTIVE_SCHEME, Arrays, Setup
from ellipsoid_coupling.models.even_start import flow_map_columns
from ellipsoid_coupling.models.flow_fit import require_fitting
from ellipsoid_coupling.models.from_scene import scene_drift, scene_edges, scene_rates
from ellipsoid_coupling.models.particle_model import placed, scene_limits
from ellipsoid_coupling.models.particle_reports import particle_snapshot
from ellipsoid_coupling.particles.at_edges import straight_at_edges
from ellipsoid_coupling.particles.frozen import freeze, frozen_row, positions_before
from ellipsoid_coupling.particles.state import Limits, ParticleState, bounce, wrap_positions
from ellipsoid_coupling.result import SAMPLES_ACROSS, Result
from ellipsoid_coupling.scenes import Scene, terms_of

Floats = NDArray[np.float64]
Flags = NDArray[np.uint8]

_POINTS_PER_TASK = 1024
# RK4 errs by (Gamma dt)^5/120 a step: 1e-7 relative at 0.1.
_LARGEST_DAMPED_STEP = 0.1
_LARGEST_STEP = 0.01


def has_exact_reference(scene: Scene) -> bool:
    """Whether `exact_reference` can solve the scene."""
    if scene.has_inflow:
        return False
    box = scene.start.points is None and scene.start.file is None
    return scene.interaction is None and not has_noise(scene) and box


@kernel
def _slope(
    drift: Drift,
    t: float,
    damping: Floats,
    position: Floats,
    velocity: Floats,
    slope: Floats,
    frozen: Flags | None,
) -> None:
    """Slope = F(position) - Gamma velocity, (D, N)."""
    particle_forces(drift, t, position, slope, frozen)
    for d in range(position.shape[0]):
        for i in range(position.shape[1]):
            slope[d, i] -= damping[d] * velocity[d, i]


@kernel
def _runge_kutta(
    drift: Drift,
    t: float,
    damping: Floats,
    position: Floats,
    velocity: Floats,
    dt: float,
    frozen: Flags | None,
    periods: Floats | None,
) -> None:
    """A classical fourth-order step of r' = v, v' = F - Gamma v from time t on, in place."""
    slopes = np.empty((4, *position.shape))
    speeds = np.empty((4, *position.shape))
    for stage in range(4):
        part = dt * (0.0 if stage == 0 else 1.0 if stage == 3 else 0.5)
        trial = position.copy()
        speeds[stage] = velocity
        if stage > 0:
            trial += part * speeds[stage - 1]
            speeds[stage] += part * slopes[stage - 1]
            wrap_positions(periods, trial)
        _slope(drift, t + part, damping, trial, speeds[stage], slopes[stage], frozen)
    position += dt / 6.0 * (speeds[0] + 2.0 * speeds[1] + 2.0 * speeds[2] + speeds[3])
    velocity += dt / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])


@kernel
def _push(
    drift: Drift,
    damping: Floats,
    limits: Limits,
    state: ParticleState,
    k: int,
    times: tuple[float, float],
    steps: int,
) -> None:
    """Steps of length times[1] from time times[0] on, of the points of task k."""
    t, dt = times
    position, velocity, frozen = state.position[k], state.velocity[k], frozen_row(state.frozen, k)
    for step in range(steps):
        before, start = (
            positions_before(limits.mesh, position),
            positions_before(limits.edges, position),
        )
        now = t + step * dt
        _runge_kutta(drift, now, damping, position, velocity, dt, frozen, limits.periods)
        bounce(limits.box, position, velocity)
        straight_at_edges(limits.edges, state, k, start, (now, dt))
        freeze(state, k, limits, before)
        wrap_positions(limits.periods, position)


def _push_all(
    terms: tuple[Drift, Floats, Limits],
    state: ParticleState,
    times: tuple[float, float],
    steps: int,
) -> None:
    """All tasks' points by `steps` steps; terms = (drift, damping, limits), times as in `_push`."""
    drift, damping, limits = terms

    def push(k: int) -> None:
        _push(drift, damping, limits, state, k, times, steps)

    for_each(state.position.shape[0], push)


def _sample_points(scene: Scene, side: int, degrees: int) -> Floats:
    """Side x side midpoints of the start box and the start angle, (tasks, D, points)."""
    x, y = even_points(scene.start.x, scene.start.y, side, side).reshape(2, -1)
    points = np.array([x, y, np.full(side * side, scene.start.own_angle)])[:degrees]
    return np.ascontiguousarray(points.reshape(degrees, -1, _POINTS_PER_TASK).transpose(1, 0, 2))


def exact_reference(scene: Scene, flow: FlowField | None, side: int = 256) -> Result:
    """The solution of a scene without interaction and noise by side x side sample points.

    Parameters
    ----------
    scene : Scene
    flow : FlowField, FlowSeries or None
        None for a scene without fluid.
    side : int
        A multiple of 32.

    Raises
    ------
    InputError
        For a scene with interaction, noise or an inlet, whose particles are not those of the start alone;
        or a start in a solid or beyond the flow's mesh.
    """
    if not has_exact_reference(scene):
        raise InputError(
            f"scene {scene.name}",
            "no interaction, no noise, no inlet and a start box",
            "interaction, noise, an inlet, start.points or start.file",
            "Compare with the microscopic ensemble instead.",
        )
    require_fitting(scene, flow)
    if isinstance(flow, FlowSeries):
        require_covered(f"scene {scene.name}, key times", flow.covers, scene.times[-1])
    with open_window(flow) as window:
        return _exact(scene, window, side)


def _exact(scene: Scene, window: Window, side: int) -> Result:
    setup = Setup(scene, terms_of(scene), ADAPTIVE_SCHEME, window.field, 0, 1)
    edges = scene_edges(setup)
    limits = scene_limits(setup, edges, scene.particles.number)
    terms = scene_drift(setup, edges), scene_rates(setup).damping, limits
    damping = terms[1]
    position = _sample_points(scene, side, damping.size)
    state = placed(setup, edges, position, np.empty((1, 0)))
    longest = min(_LARGEST_STEP, _LARGEST_DAMPED_STEP / max(float(damping.max()), 1e-9))
    snapshots: list[Arrays] = []
    before = 0.0
    for until in scene.times:
        while before < until:
            stop = min(until, window.until)
            steps = int(np.ceil((stop - before) / longest))
            _push_all(terms, state, (before, (stop - before) / steps), steps)
            window.move_to(stop)
            before = stop
        snapshots.append(particle_snapshot(state, scene))
    return _as_result(scene, snapshots, flow_map_columns(setup, edges, side))


def _as_result(scene: Scene, snapshots: list[Arrays], across: int) -> Result:
    """All points as one realisation; across : see `flow_map_columns`."""
    variables = {
        name: np.array([snapshot[name].reshape(1, -1) for snapshot in snapshots])
        for name in snapshots[0]
    }
    return Result(
        scene=scene,
        model="exact",
        scheme="runge_kutta_4",
        layout="particles",
        times=np.array(scene.times),
        variables=variables,
        coordinates={},
        attributes={"status": "completed", SAMPLES_ACROSS: float(across)},
    )
