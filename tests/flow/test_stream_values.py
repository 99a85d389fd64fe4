"""Psi at points: the spline that velocities are the derivatives of."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.flow.stream_values import stream_values
from tests.staircase_flows import past_cylinder


def test_velocity_is_its_derivative_and_nodes_are_met() -> None:
    """Central differences over 1e-4, which err by 1e-8 times third derivatives; nodes to rounding."""
    flow = past_cylinder(nodes=40)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-1.9, 1.9, (2, 50))
    sample, d = flow.evaluate(x, y), 1e-4
    up, down = (stream_values(flow.arrays, x, y + s) for s in (d, -d))
    right, left = (stream_values(flow.arrays, x + s, y) for s in (d, -d))
    np.testing.assert_allclose((up - down) / (2 * d), sample.velocity_x, atol=1e-6)
    np.testing.assert_allclose((left - right) / (2 * d), sample.velocity_y, atol=1e-6)
    nodes = np.linspace(-2.0, 2.0, 41)
    assert abs(stream_values(flow.arrays, nodes, np.zeros(41))).max() < 1e-14
