"""Whether a flow and a scene fit together; if not, the run is refused before anything is computed.

A particle or cell is in the fluid where `FlowSample.inside` is True: within the flow's rectangle, and
not in one of its cells that lies in a solid or beyond the mesh. Where a domain reflects there must be a
wall: a side of the flow's rectangle that no fluid crosses.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.scales import normal_speed
from ellipsoid_coupling.geometry.edge_grid import REFLECTS, edge_ends
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges, fluid_edges
from ellipsoid_coupling.geometry.patches import is_outlined, require_patches
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.sides import SideName

Floats = NDArray[np.float64]

# Relative; meshes may be saved in single precision.
_SAME_PLACE = 1e-5
# Largest mean speed across a wall, relative to the largest speed. Walls are tight to rounding, except
# where the spline meets a solid beside them: 2 % at single points, 0.1 % on the mean.
_TIGHT = 5e-3
# Points on a side, and along each axis for the largest speed.
_POINTS = 401

# Name, axis, and which end of it.
_SIDES: tuple[tuple[SideName, int, int], ...] = (
    ("left", 0, 0),
    ("right", 0, 1),
    ("bottom", 1, 0),
    ("top", 1, 1),
)


def rectangle(flow: FlowField) -> str:
    """Where a flow lies, in words: "[0, 4] x [0, 1]"."""
    x_low, x_high, y_low, y_high = flow.bounds
    return f"[{x_low:.9g}, {x_high:.9g}] x [{y_low:.9g}, {y_high:.9g}]"


def can_be_left(scene: Scene, flow: FlowField | None) -> bool:
    """Whether particles of the scene can leave the region in which the flow is known."""
    if flow is None or math.isinf(flow.bounds[0]):
        return False
    if scene.has_sides("leave") or not flow.arrays.mask.all():
        return True
    x, y, arrays = scene.domain.x, scene.domain.y, flow.arrays
    within_x = arrays.x_low <= x[0] and x[1] <= arrays.x_high
    return not (within_x and arrays.y_low <= y[0] and y[1] <= arrays.y_high)


def require_fitting(scene: Scene, flow: FlowField | None) -> None:
    """Refuse a flow without [flow], [flow] without a flow, names of no patch, and walls that are none.

    Of a flow at several times each of them is looked at.

    Raises
    ------
    InputError
    """
    if (flow is None) != (scene.flow is None):
        found = "none" if flow is None else f"{flow.origin}, and no [flow] section"
        expected = "a flow for its [flow] section" if flow is None else "no flow"
        remedy = "Give the scene's flow." if flow is None else "Leave out the flow."
        raise InputError(f"scene {scene.name}", expected, found, remedy)
    outline = None if flow is None else flow.outline
    require_patches(scene, () if outline is None else outline.names)
    if flow is None:
        return
    for field in flow.steady_fields():
        _require_edges(scene, field)


def _require_edges(scene: Scene, flow: FlowField) -> None:
    """Refuse a flow that is not the same on two periodic sides, and walls that are none."""
    _require_periodic(scene, flow)
    if is_outlined(scene, flow):
        _require_tight(scene, flow)
        return
    if math.isinf(flow.bounds[0]):
        return
    for name, axis, end in _SIDES:
        reflects = scene.sides[name].particles == "reflect"
        wrong = _no_wall(scene, flow, axis, end) if reflects else ""
        if wrong:
            raise InputError(
                f"scene {scene.name}, key domain.boundary",
                "a domain that reflects where the flow has walls",
                f"none on the {name}: {wrong}",
                'Set domain.boundary = "open", make the domain the flow\'s rectangle '
                f"{rectangle(flow)}, or give another flow.",
            )


def _require_tight(scene: Scene, flow: FlowField) -> None:
    """Refuse patches, and sides of the domain that cut the fluid, which reflect where fluid crosses."""
    assert flow.outline is not None
    edges = fluid_edges(scene, flow.outline)
    reflecting = np.unique(edges.grid.patches[edges.grid.acts == REFLECTS])
    largest = flow.largest_speed
    for p in reflecting:
        if p < len(flow.outline.names):
            across = _through_patch(flow.outline, int(p))
        else:
            across = _through_side(edges, flow, int(p))
        if across > _TIGHT * largest:
            raise InputError(
                f"scene {scene.name}, key boundaries.{edges.names[p]}.kind",
                "a boundary that reflects where the flow has a wall",
                f"none on {edges.names[p]}: fluid crosses it with {across:.3g} on the mean, the largest "
                f"speed is {largest:.3g}",
                "Take another kind of boundary there, or give another flow.",
            )


def _through_patch(outline: Outline, patch: int) -> float:
    """The mean speed across a patch, by the case's own fluxes."""
    own = outline.patch == patch
    return float(np.abs(outline.outflow[own]).sum() / outline.lengths()[own].sum())


def _through_side(edges: FluidEdges, flow: FlowField, side: int) -> float:
    """The mean speed across what a side of the domain cuts of the fluid."""
    ends = edge_ends(edges.grid)[edges.grid.patches == side]
    middle, way = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    # As many points on each edge as make `_POINTS` in all.
    part = (np.arange(max(1, _POINTS // len(ends))) + 0.5) / max(1, _POINTS // len(ends)) - 0.5
    place = middle[:, None] + part[:, None] * way[:, None]
    sample = flow.evaluate(place[..., 0], place[..., 1])
    length = np.hypot(way[:, 0], way[:, 1])[:, None]
    across = np.abs(sample.velocity_y * way[:, None, 0] - sample.velocity_x * way[:, None, 1])
    # Just before the edge, where it is clear which side is the fluid.
    before = place + 1e-6 * np.stack((-way[:, 1], way[:, 0]), axis=-1)[:, None]
    weight = length * edges.inside(before[..., 0], before[..., 1])
    return float((across / length * weight).sum() / max(weight.sum(), 1e-300))


def _require_periodic(scene: Scene, flow: FlowField) -> None:
    """Refuse a flow that is not the same on both of two periodic sides."""
    boxes = scene.domain.x, scene.domain.y
    lower: tuple[SideName, SideName] = ("left", "bottom")
    for axis, name in enumerate(lower):
        if scene.sides[name].particles != "wrap":
            continue
        along = np.linspace(*boxes[1 - axis], _POINTS)
        ends = [
            flow.evaluate(*((at, along) if axis == 0 else (along, at)))
            for at in (np.full(_POINTS, end) for end in boxes[axis])
        ]
        velocities = np.array([(end.velocity_x, end.velocity_y) for end in ends])
        jump = float(np.abs(velocities[1] - velocities[0]).mean())
        if jump > _TIGHT * np.abs(velocities).max():
            raise InputError(
                f"scene {scene.name}, key boundaries.{name}.kind (or domain.boundary)",
                "a flow that is the same on both periodic sides",
                f"velocities that differ by {jump:.3g} on the mean",
                "Take another kind of boundary, or give a flow with this period.",
            )


def _no_wall(scene: Scene, flow: FlowField, axis: int, end: int) -> str:
    """Why a side of the domain is not a wall of the flow; "" if it is one."""
    low, high = flow.bounds[2 * axis : 2 * axis + 2]
    at, wall = (scene.domain.x, scene.domain.y)[axis][end], (low, high)[end]
    letter = "xy"[axis]
    if abs(at - wall) > _SAME_PLACE * (high - low):
        return f"the domain's side lies at {letter} = {at:.9g}, the flow's at {wall:.9g}"
    across, largest = normal_speed(flow, 2 * axis + end), flow.largest_speed
    if across > _TIGHT * largest:
        return (
            f"fluid crosses that side of its mesh with {across:.3g} on the mean, "
            f"the largest speed is {largest:.3g}"
        )
    return ""


def require_start_inside(scene: Scene, flow: FlowField | None, x: Floats, y: Floats) -> None:
    """Refuse particles that start in a solid or beyond the mesh.

    Parameters
    ----------
    scene : Scene
    flow : FlowField or None
    x, y : float64 of one shape
        Their start positions.

    Raises
    ------
    InputError
        With the position of the first one.
    """
    if flow is None:
        return
    outside = ~flow.at(0.0).evaluate(x, y).inside
    if outside.any():
        first = float(x[outside][0]), float(y[outside][0])
        raise InputError(
            f"scene {scene.name}, key start",
            f"particles that start in the fluid, whose mesh lies in {rectangle(flow)}",
            f"{np.count_nonzero(outside)} of {x.size} in a solid or beyond the mesh, the first at "
            f"({first[0]:.6g}, {first[1]:.6g})",
            "Move the start, or give another flow.",
        )
