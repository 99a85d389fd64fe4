"""Flows with an outline, by formula: a closed box, a channel with solids, a cylinder in potential flow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import Outline, polygon_outline

Floats = NDArray[np.float64]
Part = tuple[str, str, Floats, bool]

SQUARE = np.array([[1.0, 0.4], [1.0, 0.6], [1.2, 0.6], [1.2, 0.4]])
# Front and back of a plate without thickness, across the channel.
PLATE = np.array([[1.0, 0.3], [1.0, 0.7]])


def corners(x: tuple[float, float], y: tuple[float, float]) -> Floats:
    """Of a rectangle, counter-clockwise from the lower left one."""
    return np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])


def channel_outline(*inner: Part, width: float = 4.0) -> Outline:
    """Walls below and above, an inlet on the left, an outlet on the right, and what is in between."""
    points = corners((0.0, width), (0.0, 1.0))
    names = (("floor", "wall"), ("outlet", "patch"), ("ceiling", "wall"), ("inlet", "patch"))
    sides = [
        (*name, np.array([points[k], points[(k + 1) % 4]]), False) for k, name in enumerate(names)
    ]
    return polygon_outline([*sides, *inner])


def solid(points: Floats, name: str = "solid") -> Part:
    """A wall around a solid, clockwise."""
    return name, "wall", points, True


def circle(radius: float, edges: int, middle: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Points on a circle, counter-clockwise."""
    turn = 2.0 * np.pi * np.arange(edges) / edges
    return np.column_stack((middle[0] + radius * np.cos(turn), middle[1] + radius * np.sin(turn)))


def plug_flow(outline: Outline | None, width: float = 4.0) -> FlowField:
    """U = (1, 0) in [0, width] x [0, 1], through everything."""
    x, y = np.linspace(0.0, width, 65), np.linspace(0.0, 1.0, 17)
    return FlowField.from_stream_function(
        np.repeat(y[:, None], 65, axis=1), x, y, "plug flow", outline=outline
    )


def poiseuille(outline: Outline | None) -> FlowField:
    """U_x = 6 y (1 - y), mean 1, in [0, 4] x [0, 1]."""
    x, y = np.linspace(0.0, 4.0, 65), np.linspace(0.0, 1.0, 65)
    psi = np.repeat((3.0 * y**2 - 2.0 * y**3)[:, None], 65, axis=1)
    return FlowField.from_stream_function(psi, x, y, "Poiseuille flow", outline=outline)


def roll(outline: Outline | None) -> FlowField:
    """A closed vortex in [0, 4] x [0, 1]."""
    x, y = np.linspace(0.0, 4.0, 65), np.linspace(0.0, 1.0, 17)
    psi = np.outer(np.sin(np.pi * y) ** 2, np.sin(0.25 * np.pi * x) ** 2)
    return FlowField.from_stream_function(psi, x, y, "a roll", outline=outline)


def past_a_cylinder(edges: int = 1440) -> FlowField:
    """Potential flow past a cylinder of radius 1 in [-3, 1] x [-1.5, 1.5]: psi = y (1 - 1/r^2), speed 1."""
    x, y = np.linspace(-3.0, 1.0, 129), np.linspace(-1.5, 1.5, 97)
    across, along = np.meshgrid(x, y)
    psi = along * (1.0 - 1.0 / np.maximum(across**2 + along**2, 0.25))
    points = corners((-3.0, 1.0), (-1.5, 1.5))
    rim = [
        (name, "patch", np.array([points[k], points[(k + 1) % 4]]), False)
        for k, name in enumerate(("below", "outlet", "above", "inlet"))
    ]
    outline = polygon_outline([*rim, solid(circle(1.0, edges)[::-1], "cylinder")])
    return FlowField.from_stream_function(psi, x, y, "past a cylinder", outline=outline)
