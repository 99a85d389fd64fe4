"""Plane flows whose stream function is known, with the outline of the fluid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import polygon_outline

Floats = NDArray[np.float64]


def circle(radius: float, points: int, turn: int) -> Floats:
    """Points of a circle about 0, (n, 2); turn : 1 counter-clockwise (fluid within), -1 clockwise."""
    angle = turn * 2.0 * np.pi * (np.arange(points) + 0.5) / points
    return radius * np.stack((np.cos(angle), np.sin(angle)), axis=-1)


def box(half_x: float, half_y: float) -> Floats:
    """The corners of a rectangle about 0, counter-clockwise."""
    return np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]])


INNER, OUTER = 0.4, 0.97


def couette_ring(nodes: int = 160, points: int = 720) -> FlowField:
    """u_theta = a r + b/r in a ring within [-1, 1]^2: the inner wall at rest, the outer one at speed 1."""
    a = 1.0 / (OUTER - INNER**2 / OUTER)
    b = -a * INNER**2
    x = np.linspace(-1.0, 1.0, nodes + 1)
    # Beyond the walls the formula goes on, so that the spline has no kink.
    r = np.maximum(np.hypot(*np.meshgrid(x, x)), 0.2)
    psi = -(0.5 * a * r**2 + b * np.log(r))
    outline = polygon_outline(
        [("outer", "wall", circle(OUTER, points, 1), True),
         ("inner", "wall", circle(INNER, points, -1), True)]
    )  # fmt: skip
    return FlowField.from_stream_function(psi, x, x, "Couette ring", outline=outline)


RADIUS = 0.5


def past_cylinder(half: float = 2.0, nodes: int = 160, points: int = 720) -> FlowField:
    """Potential flow u = (1, 0) past a cylinder, psi = y (1 - R^2/r^2), in [-half, half]^2.

    Patches: cylinder (a wall), outlet (the right side) and far (the others). In this order walls, outlets
    and inlets come one after the other as in the ring and the channels: a grid compiles for the order.
    """
    x = np.linspace(-half, half, nodes + 1)
    X, Y = np.meshgrid(x, x)
    square = np.maximum(X**2 + Y**2, 0.3 * RADIUS**2)
    psi = Y * (1.0 - RADIUS**2 / square)
    corners = box(half, half)
    outline = polygon_outline(
        [("cylinder", "wall", circle(RADIUS, points, -1), True),
         ("outlet", "patch", corners[[1, 2]], False),
         ("far", "patch", corners[[2, 3, 0, 1]], False)]
    )  # fmt: skip
    return FlowField.from_stream_function(psi, x, x, "potential flow", outline=outline)
