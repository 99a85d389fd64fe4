"""A particle's way in the plane within a step, off curved walls: from edge to edge of an `EdgeGrid`.

Between edges the force is linear in time, v' = f + s t - Gamma v, and the path has a closed form
(`linear`). Its distance to the line of an edge is a coordinate of its own (`bounces.Flight`), so the time
at which it meets an edge is found as at a straight wall. There all that has a direction is mirrored,

    v -> v - 2 (v . n) n,

the velocity, what noise adds to it and to the position. The force keeps its direction and goes on in time.

A path is followed in parts that few cells hold and that are nearly straight. Where no part of it meets an
edge by its closed form, the straight way to the part's end may not cross one either: so whatever the step,
nothing gets through a wall, a thin plate or a corner.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.geometry.edge_grid import (
    ALONG_X,
    ALONG_Y,
    ENDS,
    GAP,
    LENGTH,
    SHIFTS,
    EdgeGrid,
    X,
    Y,
)
from ellipsoid_coupling.particles.bounces import Flight, first_exit, time_of
from ellipsoid_coupling.particles.path_parts import Part, Path, Vector, later, moved, next_part

Floats = NDArray[np.float64]

# Parts of a path and edges met on it that are followed in a step.
_MOST_PARTS = 4096
# A path that comes back to the edge that it left within this part of the step slides along it.
_HOP = 1e-6
# The sine of the angle between edges of one direction.
_PARALLEL = 1e-9
# So near to an edge, in gaps, ways end; from there an edge is met below the other one,
# so that rounding meets none.
_AT_THE_GAP, _BELOW_THE_GAP = 1.5, 0.5


class End(NamedTuple):
    """Where a path led.

    Attributes
    ----------
    position, velocity : (x, y)
        The velocity with the kick.
    time : float
        That it took, less than the step's where it ended.
    edge : int
        The edge that ended it; -1 for none.
    first : int
        The first edge that it met, apart from those that just shift it; -1 for none.
    corner : bool
        Whether it met edges of other directions as well.
    """

    position: Vector
    velocity: Vector
    time: float
    edge: int
    first: int
    corner: bool


@kernel
def _meets(edges: EdgeGrid, e: int, path: Path, part: Part, gap: float) -> float:
    """When the path comes to edge e, of whose line it is `gap` away; infinite if it does not."""
    line = edges.lines[e]
    # The fluid lies on the left of an edge, and there the normal points.
    nx, ny = -line[ALONG_Y], line[ALONG_X]
    (vx, vy), (fx, fy), (sx, sy) = path.velocity, path.force, path.slope
    # Ways end a gap before the line: this is the coordinate's wall at 0.
    above = gap - line[GAP]
    flight = Flight(
        # Where a way has ended, rounding decides on which side of 0 it is: it is at it.
        0.0 if gap < _AT_THE_GAP * line[GAP] else above,
        nx * vx + ny * vy,
        nx * fx + ny * fy,
        nx * sx + ny * sy,
        nx * path.noise[0] + ny * path.noise[1],
        path.damping,
    )
    _, beyond = first_exit(flight, part.time, 0.0, np.inf)
    if beyond == 0.0:
        return np.inf
    # It stands at the edge and moves against it, so that no time has to be searched.
    at_once = flight.position == 0.0 and flight.velocity + flight.noise <= 0.0
    t = 0.0 if at_once else time_of(flight, 0.0, False, beyond)
    x, y = later(path, t)[0]
    along = line[ALONG_X] * (x - line[X]) + line[ALONG_Y] * (y - line[Y])
    # Longer by the margin: no path slips through between two edges.
    within = -edges.margin <= along <= line[LENGTH] + edges.margin
    return t if within else np.inf


@kernel
def _crosses(edges: EdgeGrid, e: int, path: Path, part: Part, gaps: Vector) -> float:
    """When the straight way to the part's end comes to edge e, `gaps` away first and last, or infinite."""
    line = edges.lines[e]
    before, after = gaps
    if not after < before:
        return np.inf
    (x, y), (end_x, end_y) = path.position, part.position
    # Who crosses an edge from its own side has the edge's start on the right and its end on the left.
    dx, dy = end_x - x, end_y - y
    ax, ay = line[X] - x, line[Y] - y
    bx, by = ax + line[LENGTH] * line[ALONG_X], ay + line[LENGTH] * line[ALONG_Y]
    wide = edges.margin * (abs(dx) + abs(dy))
    if dx * ay - dy * ax > wide or dx * by - dy * bx < -wide:
        return np.inf
    # 0 for a way that begins nearer than where ways end.
    return float(part.time * max(0.0, (before - line[GAP]) / (before - after)))


@kernel
def _passes_beside(edges: EdgeGrid, line: Floats, path: Path, part: Part) -> bool:
    """Whether all of a part lies before an edge's start or behind its stop, along its line: often so.

    A wall of many edges on one line is met at one of them, and the search for the time costs most.
    """
    ax, ay = line[ALONG_X], line[ALONG_Y]
    first = ax * (path.position[0] - line[X]) + ay * (path.position[1] - line[Y])
    last = ax * (part.position[0] - line[X]) + ay * (part.position[1] - line[Y])
    rim = part.bend + 4.0 * edges.margin
    return bool(max(first, last) + rim < 0.0 or min(first, last) - rim > line[LENGTH])


@kernel
def _edge_time(edges: EdgeGrid, e: int, path: Path, part: Part) -> float:
    """When a part of a path comes to edge e from its own side; infinite if it does not."""
    line = edges.lines[e]
    nx, ny = -line[ALONG_Y], line[ALONG_X]
    before = nx * (path.position[0] - line[X]) + ny * (path.position[1] - line[Y])
    # From behind it is no wall. A thin plate is two edges, one for either side.
    if before < 0.0:
        return np.inf
    after = nx * (part.position[0] - line[X]) + ny * (part.position[1] - line[Y])
    (ux, uy), (vx, vy), (wx, wy) = path.noise, path.velocity, part.velocity
    nearest = line[GAP] * (_BELOW_THE_GAP if before < _AT_THE_GAP * line[GAP] else 1.0)
    # Between two positions before an edge only a path that turns round may have met it.
    turns = nx * (vx + ux) + ny * (vy + uy) < 0.0 < nx * (wx + ux) + ny * (wy + uy)
    if after >= nearest and not turns:
        return np.inf
    if _passes_beside(edges, line, path, part):
        return np.inf
    t = _meets(edges, e, path, part, before)
    if t < np.inf or after >= nearest:
        return t
    # Behind the line without having met the edge: rounding at one of its ends, or a bend, let it pass.
    return _crosses(edges, e, path, part, (before, after))


@kernel
def _first_edge(edges: EdgeGrid, path: Path, part: Part) -> tuple[int, float]:
    """The edge that a part of a path comes to first, and when; -1 for none."""
    found, first = -1, np.inf
    for row in range(part.rows[0], part.rows[1] + 1):
        for column in range(part.columns[0], part.columns[1] + 1):
            cell = row * edges.columns + column
            for member in range(edges.first[cell], edges.first[cell + 1]):
                e = edges.members[member]
                # The nearest one often lies in several of the cells.
                t = _edge_time(edges, e, path, part) if e != found else first
                # Of two that are met at one time the one that comes first in the cells, always the same.
                if t < first:
                    found, first = e, t
    return found, first


@kernel
def edge_normal(edges: EdgeGrid, edge: int) -> Vector:
    """Of length 1, into the fluid."""
    return -edges.lines[edge, ALONG_Y], edges.lines[edge, ALONG_X]


@kernel
def _parallel(edges: EdgeGrid, one: int, other: int) -> bool:
    a, b = edges.lines[one], edges.lines[other]
    return bool(abs(a[ALONG_X] * b[ALONG_Y] - a[ALONG_Y] * b[ALONG_X]) < _PARALLEL)


@kernel
def _mirrored(vector: Vector, normal: Vector) -> Vector:
    across = 2.0 * (vector[0] * normal[0] + vector[1] * normal[1])
    return vector[0] - across * normal[0], vector[1] - across * normal[1]


@kernel
def _reflected(edges: EdgeGrid, path: Path, edge: int) -> Path:
    """The path after an elastic bounce; a million of them keep the speed to a few hundred roundings."""
    normal = edge_normal(edges, edge)
    vx, vy = _mirrored(path.velocity, normal)
    before, after = math.hypot(path.velocity[0], path.velocity[1]), math.hypot(vx, vy)
    # A mirror image is as long to rounding only, and roundings of many bounces would add up.
    same = before / after if after > 0.0 and before != after else 1.0
    noise, kick = _mirrored(path.noise, normal), _mirrored(path.kick, normal)
    velocity = vx * same, vy * same
    return Path(path.position, velocity, path.force, path.slope, noise, kick, path.damping)


@kernel
def _tangential(vector: Vector, normal: Vector) -> Vector:
    across = vector[0] * normal[0] + vector[1] * normal[1]
    return vector[0] - across * normal[0], vector[1] - across * normal[1]


@kernel
def _sliding(edges: EdgeGrid, path: Path, edge: int) -> Path:
    """The path along a wall that it is pressed against; its speed across is kept and added at the end."""
    normal, line, (x, y) = edge_normal(edges, edge), edges.lines[edge], path.position
    # Rounding must not lead it closer and closer.
    lift = line[GAP] - normal[0] * (x - line[X]) - normal[1] * (y - line[Y])
    position = x + lift * normal[0], y + lift * normal[1]
    velocity = _tangential(path.velocity, normal)
    kick = (
        path.kick[0] + path.velocity[0] - velocity[0],
        path.kick[1] + path.velocity[1] - velocity[1],
    )
    force, slope = _tangential(path.force, normal), _tangential(path.slope, normal)
    noise = _tangential(path.noise, normal)
    return Path(position, velocity, force, slope, noise, kick, path.damping)


@kernel
def _shifted(edges: EdgeGrid, path: Path, edge: int) -> Path:
    """The path from the opposite periodic side on, where it is to the bit."""
    (x, y), shift, line = path.position, edges.shifts[edge], edges.lines[edge]
    # From the side's own coordinate: the particle's would land beside the other side by a rounding.
    x = line[X] + shift[0] if shift[0] != 0.0 else x
    y = line[Y] + shift[1] if shift[1] != 0.0 else y
    return Path((x, y), path.velocity, path.force, path.slope, path.noise, path.kick, path.damping)


@kernel
def _with_kick(path: Path, time: float, edge: int, first: int, corner: bool) -> End:
    velocity = path.velocity[0] + path.kick[0], path.velocity[1] + path.kick[1]
    return End(path.position, velocity, time, edge, first, corner)


@kernel
def follow(edges: EdgeGrid, path: Path, time: float) -> End:
    """Where a path leads in `time`; it starts on the fluid's side of all edges.

    A path of more parts than anybody can mean stays where it is for the rest of the step, with the
    velocity that it has there: that keeps the energy.
    """
    # `last` is the edge of the last bounce, `since` how long ago that was.
    left, last, since, first, corner = time, -1, 0.0, -1, False
    for _ in range(_MOST_PARTS):
        part = next_part(edges, path, left)
        edge, t = _first_edge(edges, path, part)
        if edge < 0:
            path = moved(path, part.time, part.position, part.velocity)
            # The last part is all that is left: the difference is then 0 to the bit.
            left, since = left - part.time, since + part.time
            if not left > 0.0:
                return _with_kick(path, time, -1, first, corner)
            continue
        position, velocity = later(path, t)
        path = moved(path, t, position, velocity)
        left, since = left - t, since + t
        if edges.acts[edge] == SHIFTS:
            path, last = _shifted(edges, path, edge), -1
            continue
        first = edge if first < 0 else first
        # Edges of one direction, as two walls of a channel, have one normal up to its sign.
        corner |= not _parallel(edges, first, edge)
        if edges.acts[edge] == ENDS:
            return _with_kick(path, time - left, edge, first, corner)
        # Before it slides: the speed across that is kept then leads away from the wall.
        path = _reflected(edges, path, edge)
        if edge == last and since < _HOP * time:
            path = _sliding(edges, path, edge)
        last, since = edge, 0.0
    return _with_kick(path, time, -1, first, corner)
