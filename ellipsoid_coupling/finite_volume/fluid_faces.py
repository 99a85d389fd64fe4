"""The fluid's velocities at the faces of a staircase, whose sum over each cell's faces vanishes.

What flows through a face is the difference of psi at its corners, which makes the sum 0 to rounding; and
psi is one constant on all corners of a closed wall, so that nothing flows through its stairs:

      o---o---o---o       o   psi at the corner itself, all of whose faces are open
      |   |   *   |       *   psi at the nearest point of the outline, of a wall its mean value
      o---o---*###*
      |   |   *###*

Corners on sides of the domain that no outline closes keep their own psi. Where the flow has sources, the
mean of grad chi over each open face comes on top.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ellipsoid_coupling.compiled.simd_vectors import DOUBLES
from ellipsoid_coupling.finite_volume.fluid_lines import HIGH, LOW, Ends, LineTable
from ellipsoid_coupling.finite_volume.fluxes.in_fluid import FluidMotion
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.stream_values import chi_slopes, psi_coefficients, stream_values
from ellipsoid_coupling.geometry.boundaries import Inlet, at_side
from ellipsoid_coupling.geometry.fluid_cells import FluidCells, nearest_edges

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

# A wall whose psi varies by more than this part of all psi is none: fluid crosses it.
_TIGHT = 0.05
# Gauss' two points of a face, from its middle, in cells.
_GAUSS = 0.5 / np.sqrt(3.0)
# Of an edge's length: ends so near to one another are one point.
_SAME_POINT = 1e-6


def corner_values(flow: FlowField, cells: FluidCells, ends: Ends, grid: Grid) -> Floats:
    """Psi at the corners of cells, (ny + 1, nx + 1); see the module."""
    x, y = np.meshgrid(grid.x_edges, grid.y_edges)
    psi = stream_values(flow.arrays, x, y)
    if flow.outline is None or not len(flow.outline.ends):
        return psi
    at_outline = _touched(cells)
    points = np.stack((x[at_outline], y[at_outline]), axis=-1)
    nearest = nearest_edges(flow.outline, points, _fluid_beside(cells, grid)[at_outline])
    values = stream_values(flow.arrays, nearest.foot[:, 0], nearest.foot[:, 1])
    walls = _wall_values(flow, ends)[nearest.edge]
    psi[at_outline] = np.where(np.isnan(walls), values, walls)
    return psi


def _touched(cells: FluidCells) -> Flags:
    """The corners of faces that the outline closes, (ny + 1, nx + 1)."""
    ny, nx = cells.inside.shape
    touched = np.zeros((ny + 1, nx + 1), bool)
    for faces, axis in ((cells.x, 1), (cells.y, 0)):
        for owner, shift in ((faces.lower, 0), (faces.upper, 1)):
            # Edges have numbers from 0 on; the domain's sides, and open faces, have negative ones.
            j, i = np.nonzero(owner >= 0)
            # A face across x ends at the corners below and above it, one across y at those beside it.
            if axis == 1:
                touched[j, i + shift] = touched[j + 1, i + shift] = True
            else:
                touched[j + shift, i] = touched[j + shift, i + 1] = True
    return touched


def _fluid_beside(cells: FluidCells, grid: Grid) -> Floats:
    """For every corner the mean centre of those cells around it that lie in the fluid, (.., 2)."""
    inside = np.pad(cells.inside, 1).astype(np.float64)
    x, y = np.meshgrid(grid.x_edges, grid.y_edges)
    parts = (
        (inside[:-1, :-1], -1, -1), (inside[:-1, 1:], 1, -1),
        (inside[1:, :-1], -1, 1), (inside[1:, 1:], 1, 1),
    )  # fmt: skip
    # Without a cell of the fluid around it a corner is seen from where it is.
    count = np.maximum(sum(part[0] for part in parts), 1.0)
    half = 0.5 * grid.cell
    middle = [half * sum(part[0] * part[axis] for part in parts) / count for axis in (1, 2)]
    return np.stack((x + middle[0], y + middle[1]), axis=-1)


def _wall_values(flow: FlowField, ends: Ends) -> Floats:
    """The mean psi of the connected wall that an edge is part of, (E,); NaN of edges that are no wall."""
    outline = flow.outline
    assert outline is not None
    wall = ends.reflects(ends.edge) | np.isin(
        outline.patch, [k for k, kind in enumerate(outline.types) if kind == "wall"]
    )
    values = np.full(len(wall), np.nan)
    edges = np.flatnonzero(wall)
    if edges.size == 0:
        return values
    # psi is constant along a wall but for the error of the flow: its mean, each edge by its length.
    part = _connected(outline.ends[edges])
    at_ends = stream_values(flow.arrays, outline.ends[edges, :, 0], outline.ends[edges, :, 1])
    length = outline.lengths()[edges]
    mean = np.bincount(part, length * at_ends.mean(axis=1)) / np.bincount(part, length)
    far = np.zeros(mean.size)
    np.maximum.at(far, part, np.abs(at_ends - mean[part][:, None]).max(axis=1))
    spread = float(np.ptp(psi_coefficients(flow.arrays)))
    # A patch of type wall that fluid crosses keeps its psi from point to point.
    values[edges] = np.where(far[part] <= _TIGHT * spread, mean[part], np.nan)
    return values


def _connected(ends: Floats) -> Indices:
    """Which connected line each edge (n, 2, 2) is part of, (n,)."""
    # The bound is for edges that all are one point.
    unit = _SAME_POINT * max(float(np.ptp(ends.reshape(-1, 2), axis=0).max()), 1e-300)
    points = np.round(ends.reshape(-1, 2) / unit).astype(np.int64)
    _, number = np.unique(points, axis=0, return_inverse=True)
    start, stop = number.reshape(-1, 2).T
    count = int(number.max()) + 1
    graph = coo_array((np.ones(start.size), (start, stop)), shape=(count, count))
    _, part = connected_components(graph, directed=False)
    # Numbers without gaps, for sums by number.
    return np.asarray(np.unique(part[start], return_inverse=True)[1])


def chi_at_faces(flow: FlowField, grid: Grid, axis: int) -> Floats | None:
    """Grad chi through the faces across an axis, (ny, nx + 1) or (ny + 1, nx); None without sources.

    By Gauss' two points on each face; beyond the flow's rectangle as at its rim.
    """
    if flow.arrays.chi is None:
        return None
    x_low, x_high, y_low, y_high = flow.bounds
    found = []
    for aside in (-_GAUSS * grid.cell, _GAUSS * grid.cell):
        # Along the face, on both sides of its middle.
        places = (grid.x_edges, grid.y + aside) if axis == -1 else (grid.x + aside, grid.y_edges)
        x, y = np.meshgrid(*places)
        slopes = chi_slopes(flow.arrays, np.clip(x, x_low, x_high), np.clip(y, y_low, y_high))
        found.append(slopes[-1 - axis])
    return np.asarray(0.5 * (found[0] + found[1]))


class CellFaces:
    """The fluid's velocity at both faces of every cell along one axis, (2, ny, nx); 0 where no fluid is."""

    def __init__(
        self,
        corners: Floats,
        cells: FluidCells,
        ends: Ends,
        cell: float,
        axis: int,
        chi: Floats | None = None,
    ) -> None:
        # u = (d psi/dy, -d psi/dx): the mean over a face is the difference of its corners' psi over h.
        change = np.diff(corners, axis=0) if axis == -1 else -np.diff(corners, axis=1)
        change = change / cell
        change = change if chi is None else change + chi
        low = change[:, :-1] if axis == -1 else change[:-1]
        high = change[:, 1:] if axis == -1 else change[1:]
        faces, sides = (cells.x, (0, 1)) if axis == -1 else (cells.y, (2, 3))
        self.boundary = [ends.of_faces(faces.lower, sides[0]), ends.of_faces(faces.upper, sides[1])]
        walls = [ends.reflects(found) for found in self.boundary]
        # 0 to the bit through walls, also where the flow's psi is not quite constant.
        self.values = np.stack([np.where(walls[0], 0.0, low), np.where(walls[1], 0.0, high)])
        self.values *= cells.inside

    @property
    def mean(self) -> Floats:
        """In the middle of the cells, (ny, nx)."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def fastest(self) -> float:
        """The largest velocity by which a cell empties through both faces."""
        low, high = self.values
        return float((np.maximum(high, 0.0) + np.maximum(-low, 0.0)).max(initial=0.0))


def line_motion(
    faces: Floats, table: LineTable, kinds: tuple[object, ...], axis: int
) -> FluidMotion:
    """The face velocities (2, ny, nx) of cells along an axis in arrays of all lines, ghosts included.

    A ghost's fluid follows from that of its image as its contents do: mirrored where particles turn round
    or the fluid comes in, copied where they leave; behind an inlet it is that of the face.
    """
    # Lines along y are rows of the transposed.
    by_row = faces if axis == -1 else faces.transpose(0, 2, 1)
    line, place = table.places()
    row = table.rows[line]
    # Whole vectors are read beyond the last line.
    pairs = np.zeros((2, table.size + 2 * DOUBLES))
    pairs[:, table.slots()] = by_row[:, row, place]
    set_ghosts((pairs[0], pairs[1]), table, kinds)
    return FluidMotion(pairs[0], pairs[1], 0.0, 0.0)


def set_ghosts(faces: tuple[Floats, Floats], table: LineTable, kinds: tuple[object, ...]) -> None:
    """The ghosts' fluid at the lower and the upper faces of all lines, in place; see `line_motion`."""
    reflects = np.array([at_side(kind) == "reflect" for kind in kinds])[table.kind]
    feeds = np.array([isinstance(kind, Inlet) for kind in kinds])[table.kind]
    first = table.slot + GHOSTS
    last = first + table.length - 1
    # Layer by layer: the second one of a ring of one cell is the other end's first.
    for layer in range(GHOSTS):
        for end, edge, other, inwards in ((LOW, first, last, 1), (HIGH, last, first, -1)):
            # A line of one cell has one image for both ghosts.
            image = edge + inwards * np.minimum(layer, table.length - 1)
            beyond = other - inwards * layer
            through = faces[end][edge]
            # The fluid goes out there, or stands.
            copied = through * inwards <= 0.0
            # Mirrored, a cell's lower face is the ghost's upper one, and the velocity changes its sign.
            held = []
            for face in (LOW, HIGH):
                mirrored = -faces[1 - face][image]
                comes_in = np.where(feeds[:, end], through, mirrored)
                open_end = np.where(copied, faces[face][edge], comes_in)
                closed = np.where(reflects[:, end], mirrored, open_end)
                held.append(np.where(table.ring, faces[face][beyond], closed))
            for face in (LOW, HIGH):
                faces[face][edge - inwards * (layer + 1)] = held[face]
