"""Parts of a particle's way off walls: its closed form, and how much of it few cells hold.

Between edges the force is linear in time, v' = f + s t - Gamma v, and the path has a closed form
(`linear`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.edge_grid import EdgeGrid, column_of, row_of
from ellipsoid_coupling.particles.linear import phi_functions

Vector = tuple[float, float]

# The cells that a part of a path may touch, and how far it may bend, in cells.
_MOST_CELLS, _BEND = 16, 0.25
# Halvings of a part, which end there for whatever numbers.
_MOST_HALVINGS = 60


class Path(NamedTuple):
    """A particle on its way.

    Attributes
    ----------
    position, velocity : (x, y)
        At the start of what is left of the step.
    force, slope : (x, y)
        The force then, and how it changes in a unit of time.
    noise : (x, y)
        What noise adds to the velocity at which the position moves.
    kick : (x, y)
        What is added to the velocity at the end of the step.
    damping : float
    """

    position: Vector
    velocity: Vector
    force: Vector
    slope: Vector
    noise: Vector
    kick: Vector
    damping: float


class Part(NamedTuple):
    """The next part of a path: how long it takes, position and velocity at its end, the cells about it.

    bend : how far it is from the straight way at most
    """

    time: float
    position: Vector
    velocity: Vector
    bend: float
    columns: tuple[int, int]
    rows: tuple[int, int]


@kernel
def later(path: Path, t: float) -> tuple[Vector, Vector]:
    """Position and velocity at t, the latter without noise."""
    z = path.damping * t
    phi1, phi2, phi3 = phi_functions(z)
    # The exact solution for a force f + s t, as in `exponential`.
    decay, push, change = math.exp(-z), t * phi2, t * t * phi3
    (x, y), (vx, vy), (fx, fy), (sx, sy) = path.position, path.velocity, path.force, path.slope
    position = (
        x + t * (phi1 * vx + push * fx + change * sx + path.noise[0]),
        y + t * (phi1 * vy + push * fy + change * sy + path.noise[1]),
    )
    velocity = (
        decay * vx + t * phi1 * fx + t * t * phi2 * sx,
        decay * vy + t * phi1 * fy + t * t * phi2 * sy,
    )
    return position, velocity


@kernel
def moved(path: Path, t: float, position: Vector, velocity: Vector) -> Path:
    """What is left of a path that is at this position, with this velocity, at t."""
    force = path.force[0] + t * path.slope[0], path.force[1] + t * path.slope[1]
    return Path(position, velocity, force, path.slope, path.noise, path.kick, path.damping)


@kernel
def _bend(path: Path, t: float) -> float:
    """A bound of how far the path is from the straight way to its position at t."""
    gamma = path.damping
    # A path is off its chord by t^2/8 max |r''| at most, and with Gamma = damping
    #     r'' = e^{-Gamma t} (f - Gamma v) + s (1 - e^{-Gamma t})/Gamma.
    fastest = 0.125 * t * t
    if gamma * gamma * fastest > 1.0:
        # The first term dies away: all that it ever does to the position is its size at 0 over Gamma^2.
        fastest = 1.0 / (gamma * gamma)
    lasting = t if gamma * t < 1.0 else 1.0 / gamma
    (vx, vy), (fx, fy), (sx, sy) = path.velocity, path.force, path.slope
    # Bounds of lengths that take no root.
    push = abs(fx - gamma * vx) + abs(fy - gamma * vy)
    return fastest * push + 0.125 * t * t * lasting * (abs(sx) + abs(sy))


@kernel
def next_part(edges: EdgeGrid, path: Path, left: float) -> Part:
    """The longest half, quarter, ... of what is left that few cells hold and that is nearly straight."""
    t, size = left, 1.0 / edges.per_length
    # Columns 0 to -1 are none.
    position, velocity, columns, rows = path.position, path.velocity, (0, -1), (0, -1)
    bend = np.inf
    for _ in range(_MOST_HALVINGS):
        position, velocity = later(path, t)
        # A position that is no number lies in no cell; the stepper reports it.
        if not abs(position[0]) + abs(position[1]) < np.inf:
            break
        bend = _bend(path, t)
        # The rectangle about both ends holds the straight way; the path is off it by the bend.
        rim = bend + 4.0 * edges.margin
        low, high = (
            min(path.position[0], position[0]) - rim,
            max(path.position[0], position[0]) + rim,
        )
        columns = column_of(edges, low), column_of(edges, high)
        low, high = (
            min(path.position[1], position[1]) - rim,
            max(path.position[1], position[1]) + rim,
        )
        rows = row_of(edges, low), row_of(edges, high)
        cells = (columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1)
        if cells <= _MOST_CELLS and bend <= _BEND * size:
            break
        t *= 0.5
    return Part(t, position, velocity, bend, columns, rows)
