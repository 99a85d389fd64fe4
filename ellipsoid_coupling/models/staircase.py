"""From a scene to the staircase of its grid, where patches bound the fluid or it carries particles in."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.fluid_faces import (
    CellFaces,
    chi_at_faces,
    corner_values,
    line_motion,
)
from ellipsoid_coupling.finite_volume.fluid_lines import Ends, FluidLines, LineTable, line_tables
from ellipsoid_coupling.finite_volume.fluxes.contract import in_order
from ellipsoid_coupling.finite_volume.grid import Grid, cell_of, first_centre
from ellipsoid_coupling.finite_volume.moving_lines import MovingLines
from ellipsoid_coupling.finite_volume.q_grid import QGrid, start_angles
from ellipsoid_coupling.finite_volume.system import DENSITY, MEAN_ANGLE, VELOCITIES, System
from ellipsoid_coupling.finite_volume.wall_cells import wall_cells
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.interval import MovingFlow
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.geometry.boundaries import Inlet, at_side, make_kind
from ellipsoid_coupling.geometry.fluid_cells import FluidCells, fluid_cells
from ellipsoid_coupling.geometry.fluid_edges import lying_on
from ellipsoid_coupling.geometry.patches import is_outlined, patch_parts
from ellipsoid_coupling.interaction import CurvedWalls, Walls
from ellipsoid_coupling.models.base import Setup
from ellipsoid_coupling.physics.jeffery import jeffery_coefficients, jeffery_rate
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene
from ellipsoid_coupling.scenes.sides import SIDES

Floats = NDArray[np.float64]
# The staircase of a scene as of a time; None where nothing but the domain bounds the fluid.
StairsAt = Callable[[float], "Staircase | None"]


class Staircase(NamedTuple):
    """The fluid's cells of a grid.

    Attributes
    ----------
    cells : FluidCells
    ends : Ends
        What closes them.
    faces : dict
        The fluid's velocity at the cells' faces along each axis, -1 and -2.
    outline : Outline or None
        None where the sides of the domain bound it.
    flow : FlowField
        As of the time that the faces are of.
    """

    cells: FluidCells
    ends: Ends
    faces: dict[int, CellFaces]
    outline: Outline | None
    flow: FlowField


def scene_staircase(setup: Setup, grid: Grid, t: float = 0.0) -> Staircase | None:
    """Of a scene whose fluid is bounded by patches, or carries particles in; None of all others.

    t : the time that the flow is taken at, where it changes

    Raises
    ------
    InputError
        Where an inlet has no fluid, no cell lies in the fluid, one lies beyond the flow's mesh, or a
        periodic patch is on no periodic side.
    """
    scene, flow = setup.scene, None if setup.flow is None else setup.flow.at(t)
    outlined = is_outlined(scene, flow)
    ends = _ends(scene, flow if outlined else None)
    carried = any(isinstance(kind, Inlet) for kind in ends.kinds)
    if not outlined and not carried:
        return None
    if flow is None:
        raise InputError(
            f"scene {scene.name}, key boundaries", "a fluid that carries particles in at an inlet",
            "no [flow]", "Add [flow], or choose another kind of boundary.",
        )  # fmt: skip
    outline = flow.outline if outlined else None
    cells = fluid_cells(outline, grid.x, grid.y, grid.cell)
    _require_cells(setup, flow, cells, grid)
    corners = corner_values(flow, cells, ends, grid)
    faces = {
        axis: CellFaces(corners, cells, ends, grid.cell, axis, chi_at_faces(flow, grid, axis))
        for axis in (-1, -2)
    }
    _require_periods(scene, ends, faces)
    return Staircase(cells, ends, faces, outline, flow)


def staircase_in_time(setup: Setup, grid: Grid) -> StairsAt:
    """`scene_staircase` at a time; the last one is kept, as tables and lines ask one after the other."""
    return lru_cache(maxsize=1)(partial(scene_staircase, setup, grid))


def _ends(scene: Scene, flow: FlowField | None) -> Ends:
    """Patches, if the flow's outline has any, and then the four sides."""
    outline = None if flow is None else flow.outline
    parts = {} if outline is None else patch_parts(scene, outline)
    names, known = (*parts, *SIDES), [*parts.values(), *scene.sides.values()]
    kinds = tuple(make_kind(part.kind, part.parameters) for part in known)
    edges = np.empty(0, np.int64) if outline is None else outline.patch
    return Ends(names, kinds, edges, np.arange(len(parts), len(names)))


def _require_cells(setup: Setup, flow: FlowField, cells: FluidCells, grid: Grid) -> None:
    x, y = np.meshgrid(grid.x, grid.y)
    x_low, x_high, y_low, y_high = flow.bounds
    known = (x_low <= x) & (x <= x_high) & (y_low <= y) & (y <= y_high)
    if flow.outline is None:
        known &= flow.evaluate(x, y).inside
    outside = cells.inside & ~known
    where, remedy = f"scene {setup.scene.name}, key flow.field", "Change the domain, or the flow."
    if outside.any():
        raise InputError(
            where, "a flow that covers all cells within its outline",
            f"{np.count_nonzero(outside)} cells outside it, the first at "
            f"({x[outside][0]:.6g}, {y[outside][0]:.6g})", remedy,
        )  # fmt: skip
    if not cells.inside.any():
        raise InputError(
            where, f"cells in the fluid of the domain {setup.scene.domain.x} x {setup.scene.domain.y}",
            "none: all are in solids or beyond the mesh", remedy,
        )  # fmt: skip


def _require_periods(scene: Scene, ends: Ends, faces: dict[int, CellFaces]) -> None:
    """Refuse periodic patches elsewhere than on periodic sides."""
    for axis, sides in ((-1, (0, 1)), (-2, (2, 3))):
        for side, boundary in zip(sides, faces[axis].boundary, strict=True):
            wraps = ends.wraps(boundary)
            on_side = np.zeros(wraps.shape, bool)
            place = 0 if side in (0, 2) else -1
            on_side[(slice(None), place) if axis == -1 else (place,)] = True
            periodic = at_side(ends.kinds[ends.sides[side]]) == "wrap"
            wrong = wraps & ~(on_side & periodic)
            if wrong.any():
                name = ends.names[boundary[wrong][0]]
                raise InputError(
                    f"scene {scene.name}, key boundaries.{name}",
                    "periodic patches on two opposite sides of the domain that are periodic, too",
                    f"{name} elsewhere, or on a side of another kind",
                    f'Let the domain end there and give boundaries.{SIDES[side]}.kind = "periodic".',
                )


def staircase_lines(setup: Setup, stairs: Staircase, grid: QGrid, system: System) -> FluidLines:
    """The lines that a grid is swept along."""
    rates = setup.scene.flow
    assert rates is not None
    tables, kinds = line_tables(stairs.cells, stairs.ends, grid.plane)
    carried: dict[int, Floats] = {}
    for axis in tables:
        tables[axis], carried[axis] = _carried(setup, stairs, grid, system, (axis, tables[axis]))
    noise = setup.scene.noise.noise if setup.scene.noise else 0.0
    # Particles drift with the fluid less what noise damps.
    share = rates.drag / (rates.drag + 0.5 * noise**2) if rates.drag > 0.0 else 0.0
    motion = {
        axis: line_motion(share * stairs.faces[axis].values, table, kinds, axis) if share else None
        for axis, table in tables.items()
    }
    fastest = share * max(faces.fastest for faces in stairs.faces.values())
    walls = None
    if stairs.outline is not None:
        walls = wall_cells(stairs.cells, stairs.ends, stairs.outline.normals(), tables)
    return FluidLines(
        stairs.cells.inside, stairs.ends.names, kinds, tables, carried, motion, fastest,
        walls, slides=system.pressure == 0.0,
    )  # fmt: skip


def scene_moving_lines(
    setup: Setup, stairs_at: StairsAt, grid: QGrid, system: System
) -> MovingLines | None:
    """What brings the lines of a staircase to a time; None where nothing changes, or without one."""
    moving = setup.flow
    if not isinstance(moving, MovingFlow) or stairs_at(0.0) is None:
        return None

    def lines_at(t: float) -> FluidLines:
        stairs = stairs_at(t)
        assert stairs is not None
        return staircase_lines(setup, stairs, grid, system)

    return MovingLines(lines_at, moving.interval)


def _carried(
    setup: Setup, stairs: Staircase, grid: QGrid, system: System, lines: tuple[int, LineTable]
) -> tuple[LineTable, Floats]:
    """Numbers the ends at inlets, and what the fluid carries there, see `FluidLines`.

    Whether it comes in there or leaves says its velocity alone, which may turn round.
    """
    axis, table = lines
    rows, planes = table.carried.copy(), grid.shape[0]
    found = [np.zeros((len(system.components), planes))]
    places = table.rows, table.start, (table.start + table.length - 1) % table.cells
    for line, end in np.argwhere(~table.ring[:, None] & (table.boundary >= 0)):
        kind = stairs.ends.kinds[table.boundary[line, end]]
        if isinstance(kind, Inlet):
            cell = places[0][line], places[1 + end][line]
            along = stairs.faces[axis].values[(end, *(cell if axis == -1 else cell[::-1]))]
            rows[line, end] = len(found)
            face = axis, along, table.faces[line, end]
            found.append(_state((setup.scene, stairs.flow), grid, system, kind, face))
    carried = np.stack(found, axis=1)[list(in_order(len(system.components), -axis))]
    return table._replace(carried=rows), carried.reshape(len(system.components), -1)


def _state(
    scene_in: tuple[Scene, FlowField],
    grid: QGrid,
    system: System,
    kind: Inlet,
    face: tuple[int, float, Floats],
) -> Floats:
    """What the fluid carries of a density 1, component by component and plane by plane.

    scene_in : the scene, and its flow.
    face : the axis across it, the fluid's velocity through it, and its middle.
    """
    axis, along, (x, y) = face
    scene, flow = scene_in
    rates = scene.flow
    assert rates is not None
    sample = flow.continued(x, y)
    angle = scene.start.own_angle if np.isnan(kind.angle) else kind.angle
    resolved = grid.angle_resolved
    density = start_angles(grid, angle) / grid.angle_width if resolved else np.ones(1)
    angles = grid.angle if resolved and grid.angles > 1 else np.full(grid.shape[0], angle)
    shape = potential_shape(scene.particles.length, scene.particles.width).shape_factor
    gradient = float(sample.stretch), float(sample.dux_dy), float(sample.duy_dx)
    # Where the fluid turns nothing, particles come in as they start: without a spin.
    turning = jeffery_coefficients(1.0 if rates.angular_drag > 0.0 else 0.0, *gradient, shape)
    spin = [jeffery_rate(math.cos(2 * one), math.sin(2 * one), *turning) for one in angles]
    values: dict[str, Any] = dict(
        zip(VELOCITIES, (sample.velocity_x, sample.velocity_y, np.array(spin)), strict=True)
    )
    values |= {DENSITY: 1.0, MEAN_ANGLE: angle, VELOCITIES[-1 - axis]: along}
    return np.array([density * values.get(name, 0.0) for name in system.components])


def curved_walls(
    scene: Scene, stairs: Staircase | None, grid: Grid, walls: Walls
) -> CurvedWalls | None:
    """The walls of an outline: patches and sides that reflect, or those of them that [walls] names.

    As of particles a side that is named stands for the patches that lie on it, too. None where the sides
    of the domain bound the fluid.

    Raises
    ------
    InputError
        If there is no such wall.
    """
    if stairs is None or stairs.outline is None or scene.walls is None:
        return None
    outline, ends = stairs.outline, stairs.ends
    named = scene.walls.sides
    chosen = np.array([named is None or name in named for name in outline.names], bool)[ends.edge]
    parts = []
    (left, right), (bottom, top) = scene.domain.x, scene.domain.y
    corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    for side, (name, start) in enumerate(zip(SIDES, (3, 1, 0, 2), strict=True)):
        if named is not None and name not in named:
            continue
        chosen |= lying_on(outline.ends, scene.domain, name)
        faces = stairs.faces[-1 if side < 2 else -2].boundary[side % 2]
        # A side that no fluid reaches is no wall.
        if (faces == ends.sides[side]).any() and ends.reflects(ends.sides[side : side + 1])[0]:
            parts.append(corners[None, [start, (start + 1) % 4]])
    parts.append(outline.ends[chosen & ends.reflects(ends.edge)])
    if not sum(map(len, parts)):
        raise InputError(
            f"scene {scene.name}, key walls.sides",
            "walls that reflect, on sides of the domain or patches of the case",
            ", ".join(named or ("none",)), "Name others, or leave out [walls].",
        )  # fmt: skip
    centres = grid.x, grid.y
    entries = walls.table(grid.cell).entries
    return CurvedWalls(np.concatenate(parts), entries, centres, stairs.cells.inside, grid.cell)


def require_start_in_fluid(
    scene: Scene, inside: NDArray[np.bool_], grid: Grid, density: Floats
) -> Floats:
    """The density at the start without what lies in solids, of mass 1 again.

    Raises
    ------
    InputError
        Where a point lies in a solid, or all of the start box.
    """
    lost = (density > 0.0) & ~inside
    kept = density * inside
    places = scene.start.places()
    if not lost.any() or (not places and kept.any()):
        return np.asarray(kept / (kept.sum() * grid.cell**2)) if lost.any() else density
    first = next(
        (place[:2] for place in places if lost[cell_of(grid, place[0], place[1])]),
        first_centre(grid, lost),
    )
    raise InputError(
        f"scene {scene.name}, key start", "a start in the fluid",
        f"cells in a solid or beyond the mesh, the first at ({first[0]:.6g}, {first[1]:.6g})",
        "Move the start.",
    )  # fmt: skip
