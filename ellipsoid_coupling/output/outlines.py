"""Polygons: particles as ellipses to scale, cells as squares, the outline of the fluid.

L and D are the ellipse's full length and full width, so its semi-axes are L/2 and D/2: the paper
calls L the length, its sketch draws semi-axes 0.5 and 0.25 for the L = 1, D = 0.5 of its first
scene, and particles that touch end to end then have centres L = l/2 apart, like a wall's ghosts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import Outline, polygon_outline
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]

CORNERS = 32


def ellipse_outlines(
    x: Floats, y: Floats, angle: Floats, size: tuple[float, float], corners: int = CORNERS
) -> Floats:
    """The polygon of each particle's ellipse, anticlockwise.

    Parameters
    ----------
    x, y, angle : (n,) float64
        Centres, and main axes against the x axis in radian.
    size : (L, D), full length and width
    corners : int

    Returns
    -------
    (n, corners, 2) float64, the last axis (x, y).
    """
    turn = 2.0 * np.pi * np.arange(corners) / corners
    along, across = 0.5 * size[0] * np.cos(turn), 0.5 * size[1] * np.sin(turn)
    cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack(
        [
            np.asarray(x)[:, None] + cosine * along - sine * across,
            np.asarray(y)[:, None] + sine * along + cosine * across,
        ],
        axis=-1,
    )


def square_outlines(x: Floats, y: Floats, width: float) -> Floats:
    """The corners of squares around centres (n,), anticlockwise, (n, 4, 2)."""
    corners = 0.5 * width * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return np.asarray(np.stack([x, y], axis=-1)[:, None, :] + corners)


def drawn_outline(scene: Scene, flow: FlowField | None) -> Outline:
    """Where the fluid of a scene ends: at the edges of its flow's case, else at the sides of its domain.

    Sides at which particles bounce are walls there, others are open.
    """
    if flow is not None and flow.outline is not None:
        return flow.outline
    (left, right), (low, high) = scene.domain.x, scene.domain.y
    corners = {
        "bottom": ((left, low), (right, low)),
        "right": ((right, low), (right, high)),
        "top": ((right, high), (left, high)),
        "left": ((left, high), (left, low)),
    }
    return polygon_outline(
        (
            name,
            "wall" if side.particles == "reflect" else "patch",
            np.array(corners[name]),
            False,
        )
        for name, side in scene.sides.items()
    )


def joined(ends: Floats) -> list[Floats]:
    """Edges (E, 2, 2) as lines of corners (n, 2), joined where one stops and another one starts.

    A closed line returns to its first corner.
    """
    # Ends of edges that meet may differ by rounding.
    size = 1e-9 * float(np.abs(ends).max(initial=1e-300))
    rounded = np.round(ends / size).astype(np.int64).tolist()
    corners = [(tuple(start), tuple(stop)) for start, stop in rounded]
    beginning: dict[tuple[int, ...], list[int]] = {}
    for e in reversed(range(len(corners))):
        beginning.setdefault(corners[e][0], []).append(e)
    stops = {stop for _, stop in corners}
    taken, lines = np.zeros(len(corners), np.bool_), []
    # Open lines from their first corner, where no edge stops; those that are left are closed.
    for start in sorted(range(len(corners)), key=lambda edge: corners[edge][0] in stops):
        e, line = start, []
        while e >= 0 and not taken[e]:
            taken[e] = True
            line.append(e)
            going_on = beginning.get(corners[e][1], [])
            e = next((f for f in going_on if not taken[f]), -1)
        if line:
            lines.append(np.vstack((ends[line, 0], ends[line[-1], 1])))
    return lines
