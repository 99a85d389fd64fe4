"""A channel that an inlet feeds: its scene, and what has become of its particles at each save."""

from __future__ import annotations

from typing import Any

import ellipsoid_coupling as ec
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene

# Everywhere at the start, and in the inlet.
DENSITY = 0.25


def channel_scene(times: tuple[float, ...], settings: dict[str, Any]) -> Scene:
    """The channel [0, 4] x [0, 1] of `outlined_flows`, filled at the start; `settings` on top.

    Particles of length 0.05, so damped that they follow the fluid.
    """
    shared = {
        "domain.x": [0.0, 4.0], "domain.y": [0.0, 1.0], "domain.boundary": "open",
        "start.x": [0.0, 4.0], "start.y": [0.0, 1.0], "particles.length": 0.05,
        "particles.inertia": 0.001, "times": list(times), "numerics.cell": 0.125,
        "flow.drag": 200.0, "flow.angular_drag": 200.0, "numerics.time_step": 0.004,
        "boundaries.inlet.kind": "inlet", "boundaries.inlet.density": DENSITY,
        "numerics.tolerance": 1e-3,
    }  # fmt: skip
    return ec.load_scene("cavity_free", shared | settings)


def balance(result: Result) -> tuple[Any, Any, Any]:
    """Particles that came in, that are inside, and that ended, at each save."""
    fate, start = result.variables["fate"], int(result.attributes["particles_at_start"])
    inside, ended = (fate == 0).sum(axis=(1, 2)), (fate > 0).sum(axis=(1, 2))
    return fate[0].size - (fate == -1).sum(axis=(1, 2)) - start, inside, ended
