"""The spline of any plane mesh: fitted to psi, to U and to every wall, curved ones and plates included.

What the coefficients shall fit, each in units of velocity, h being the spline's step:

    psi / h            at the mesh points
    u                  in the cells' centres
    psi / h, u         on the walls, between the mesh points: no flux, and the wall's own velocity
    psi / h            on cyclic sides of the rectangle: the same but for a constant, slopes included
    third differences  nothing but what the others ask for

The last one is a regulariser: it leaves quadratic psi alone, so that shear at walls is as it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.fluid_cells import fluid_cells
from ellipsoid_coupling.flow.least_squares import (
    Equations,
    Nodes,
    solve,
    spline_rows,
    third_differences,
)
from ellipsoid_coupling.flow.mesh import MeshFlow
from ellipsoid_coupling.flow.openfoam.plane import SINGLE
from ellipsoid_coupling.flow.outline import Outline
from ellipsoid_coupling.flow.wall_curves import PLACES, WallEdges, WallPoints, wall_points

Array = NDArray[np.float64]

# Nodes per mesh width: as many as this, fewer where that makes more nodes in the fluid than `FEW`, but
# no fewer than the second number, unless that makes more than `MANY`.
FINER, FEW, MANY = (3.0, 2.0), 40_000, 100_000
# The least number of cells per direction, and the most nodes of all, those in solids included.
LEAST_CELLS, MOST_NODES = 8, 4_000_000
# Weights; with the last one in mesh widths the error beside a square obstacle is that of its mesh. A larger
# one hides wiggles, and thin layers with them: see tests/flow/test_fitted.py.
U_IN_CELLS, ON_WALLS, SMOOTH = 1.0, 3.0, 0.1
# Of a tie between two cyclic sides: firm, as nothing but the regulariser pulls at it.
AT_PERIODS = 300.0


def fitted(mesh: MeshFlow, psi: Array, outline: Outline, walls: WallEdges) -> FlowField:
    """The field that fits psi (P,) at the mesh points, U in the cells and the walls best.

    outline : relative to the mesh's corner
    walls : the edges that no fluid crosses
    """
    nodes, finer = mesh_nodes(mesh)
    x, y = nodes.lines()
    inside = fluid_cells(outline.ends, x, y)
    at_walls = wall_points(mesh.points, walls)
    # An arc may lie on the other side of its chord, where no cell holds any of the fluid.
    used = nodes.needed(inside | nodes.around(at_walls.at))
    h = np.sqrt(nodes.dx * nodes.dy)
    equations = [
        Equations(spline_rows(nodes, mesh.points, ""), psi).weighted(1.0 / h),
        *(part.weighted(U_IN_CELLS) for part in _in_cells(nodes, mesh)),
        *_on_walls(nodes, np.repeat(psi[walls.start], PLACES.size), at_walls),
        *periods(nodes, mesh, psi, outline, used),
        third_differences(used).weighted(SMOOTH * finer / h),
    ]
    return FlowField.from_coefficients(solve(equations, used), x, y, "", inside, outline)


def mesh_nodes(mesh: MeshFlow) -> tuple[Nodes, float]:
    """A grid over the mesh's rectangle, and how many times it is finer than the mean cell."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    width, height = (high - low).tolist()
    area = float(mesh.cells.areas(mesh.points).mean())
    count = len(mesh.velocity)
    finer = float(np.clip(np.sqrt(FEW / count), FINER[1], FINER[0]))
    finer = min(finer, np.sqrt(MANY / count), np.sqrt(MOST_NODES * area / (width * height)))
    step = np.sqrt(area) / finer
    most = MOST_NODES // LEAST_CELLS
    nx, ny = (int(np.clip(np.ceil(side / step), LEAST_CELLS, most)) for side in (width, height))
    return Nodes(float(low[0]), float(low[1]), width / nx, height / ny, nx, ny), finer


def _in_cells(nodes: Nodes, mesh: MeshFlow) -> tuple[Equations, Equations]:
    """u_x = d psi / dy and u_y = - d psi / dx in the cells' centres."""
    return (
        Equations(spline_rows(nodes, mesh.centres, "y"), mesh.velocity[:, 0]),
        Equations(spline_rows(nodes, mesh.centres, "x"), -mesh.velocity[:, 1]),
    )


def _on_walls(nodes: Nodes, psi: Array, points: WallPoints) -> tuple[Equations, Equations]:
    """Psi (n,) at points of walls; and u along them, where it is known how they move."""
    h = np.sqrt(nodes.dx * nodes.dy)
    known = np.isfinite(points.speed)
    at, way = points.at[known], points.way[known]
    along = diags_array(way[:, 0]) @ spline_rows(nodes, at, "y")
    along = along - diags_array(way[:, 1]) @ spline_rows(nodes, at, "x")
    return (
        Equations(spline_rows(nodes, points.at, ""), psi).weighted(ON_WALLS / h),
        Equations(csr_array(along), points.speed[known]).weighted(ON_WALLS),
    )


def periods(
    nodes: Nodes, mesh: MeshFlow, psi: Array, outline: Outline, used: NDArray[np.bool_]
) -> list[Equations]:
    """Psi is the same at cyclic sides of the mesh's rectangle, but for the flux between them.

    The rectangle is a whole number of cells wide, so these are the same coefficients at both ends.
    """
    cyclic = outline.ends[np.array(outline.types)[outline.patch] == "cyclic"]
    found = []
    for axis, cells in ((0, nodes.nx), (1, nodes.ny)):
        low, high = mesh.points[:, axis].min(), mesh.points[:, axis].max()
        tolerance = SINGLE * (high - low)
        if all(
            (np.abs(cyclic[..., axis] - end) <= tolerance).all(axis=1).any() for end in (low, high)
        ):
            ends = [
                psi[np.abs(mesh.points[:, axis] - end) <= tolerance].mean() for end in (low, high)
            ]
            tied = _tied(used, axis, cells, float(ends[1] - ends[0]))
            found.append(tied.weighted(AT_PERIODS / np.sqrt(nodes.dx * nodes.dy)))
    return found


def _tied(used: NDArray[np.bool_], axis: int, cells: int, step: float) -> Equations:
    """That three columns of coefficients (axis 0), or rows, are those `cells` before and a step more."""
    numbers = np.moveaxis(np.arange(used.size).reshape(used.shape), 1 - axis, 0)
    first, last = numbers[:3].ravel(), numbers[cells:].ravel()
    both = used.ravel()[first] & used.ravel()[last]
    pairs = np.stack((last[both], first[both]), axis=-1)
    rows = csr_array(
        (np.tile((1.0, -1.0), len(pairs)), pairs.ravel(), 2 * np.arange(len(pairs) + 1)),
        shape=(len(pairs), used.size),
    )
    return Equations(rows, np.full(len(pairs), step))
