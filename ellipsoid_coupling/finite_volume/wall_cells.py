"""Cells at stairs of a wall that is not along x or y: what is pressed against it slides along it.

Stairs turn round what reaches their faces along x and y, so mass that a force presses against a tilted wall
would stay in the corner of a stair. Before each direction of a step such a cell loses the part of its own
velocity w = v - U (U the fluid's, the mean of its faces) that goes into the wall, n the outer normal,

    w -> w - max(w.n, 0) n

and all of U counts as the fluid's, see `fluxes.in_fluid`: mass with w = 0 goes on with what flows through
the faces. Of systems without pressure only: pressure turns round at the stairs as it does on a wall.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.fluxes.in_fluid import FluidMotion
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.geometry.fluid_cells import FluidCells

if TYPE_CHECKING:
    from ellipsoid_coupling.finite_volume.fluid_lines import Ends, LineTable

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

# A component of a normal below this is 0: the wall is along x or y.
_ALONG_AXIS = 1e-6


class WallCells(NamedTuple):
    """See the module.

    Attributes
    ----------
    cell : (n,) int64
        Flat cells of a padded plane.
    normal : (2, n) float64
        Out of the fluid.
    slots : dict
        Where they stand in arrays of all lines along each axis, -1 and -2, (n,).
    whole : dict
        Which slots along each axis are theirs or of their ghosts, (size,).
    """

    cell: Indices
    normal: Floats
    slots: dict[int, Indices]
    whole: dict[int, Flags]

    def with_all_fluid(self, motion: FluidMotion, axis: int) -> FluidMotion:
        """With velocities of which `follows` times is all of the fluid's in these cells."""
        whole, follows = self.whole[axis], motion.follows
        faces = (motion.lower, motion.upper)
        lower, upper = (
            np.divide(face, follows, out=face.copy(), where=with_room(whole, face))
            for face in faces
        )
        return motion._replace(lower=lower, upper=upper)

    def crowd(self, density: Floats, inside: Flags) -> tuple[float, float]:
        """Which part of the mass lies in them, and which part of the fluid's cells they are.

        Parameters
        ----------
        density : (planes, ny + 4, nx + 4) float64, padded
        inside : (ny, nx) bool, the fluid's cells
        """
        total = float(density[:, GHOSTS:-GHOSTS, GHOSTS:-GHOSTS].sum())
        held = float(density.reshape(len(density), -1)[:, self.cell].sum())
        return (held / total if total > 0.0 else 0.0), self.cell.size / np.count_nonzero(inside)

    def slide(
        self,
        fields: Floats,
        velocities: tuple[int, ...],
        motion: dict[int, FluidMotion | None],
        in_fluid: bool,
    ) -> None:
        """Take what goes into the wall from padded fields (K, planes, ny + 4, nx + 4), in place.

        in_fluid : whether v is that of particles in the fluid, not a correction of it.
        """
        flat = fields.reshape(*fields.shape[:2], -1)
        density, into = flat[0][:, self.cell], np.zeros(self.cell.size)
        for axis, normal, k in zip((-1, -2), self.normal, velocities, strict=False):
            into = into + flat[k][:, self.cell] * normal
            fluid, slots = motion[axis] if in_fluid else None, self.slots[axis]
            if fluid is not None:
                into -= density * (0.5 * (fluid.lower[slots] + fluid.upper[slots]) * normal)
        into = np.maximum(into, 0.0)
        for normal, k in zip(self.normal, velocities, strict=False):
            flat[k][:, self.cell] -= into * normal


def with_room(whole: Flags, face: Floats) -> Flags:
    """As long as `face`, which whole vectors are read beyond."""
    return np.pad(whole, (0, face.size - whole.size))


def wall_cells(
    cells: FluidCells, ends: Ends, inwards: Floats, tables: dict[int, LineTable]
) -> WallCells | None:
    """Those of an outline whose edges have these normals (E, 2) into the fluid; None if there are none."""
    out, tilted = np.zeros((2, *cells.inside.shape)), np.zeros(cells.inside.shape, bool)
    for owner in (cells.x.lower, cells.x.upper, cells.y.lower, cells.y.upper):
        at = np.nonzero(owner >= 0)
        edge = owner[at]
        walls = ends.reflects(ends.edge[edge])
        at = at[0][walls], at[1][walls]
        normal = -inwards[edge[walls]]
        for k in (0, 1):
            np.add.at(out[k], at, normal[:, k])
        tilted[at] |= np.abs(normal).min(axis=1) > _ALONG_AXIS
    length = np.hypot(*out)
    row, column = np.nonzero(tilted & (length > _ALONG_AXIS))
    if not row.size:
        return None
    slots, whole = {}, {}
    for axis, place in ((-1, (row, column)), (-2, (column, row))):
        slots[axis] = _slots(tables[axis])[place]
        whole[axis] = _with_ghosts(tables[axis], slots[axis], ends)
    table = tables[-1]
    corner = GHOSTS * (table.row_stride + table.stride)
    cell = corner + row * table.row_stride + column * table.stride
    return WallCells(cell, out[:, row, column] / length[row, column], slots, whole)


def _slots(table: LineTable) -> Indices:
    """Where each cell stands in arrays of all lines, (rows, cells); -1 of a cell in none."""
    line, place = table.places()
    found = np.full((int(table.rows.max()) + 1, table.cells), -1)
    found[table.rows[line], place] = table.slots()
    return found


def _with_ghosts(table: LineTable, slots: Indices, ends: Ends) -> Flags:
    """Which of all slots are these, or ghosts of these."""
    whole = np.zeros(table.size, bool)
    whole[slots] = True
    reflects = ends.reflects(table.boundary)
    first = table.slot + GHOSTS
    last = first + table.length - 1
    for layer in range(GHOSTS):
        for end, (edge, other, inwards) in enumerate(((first, last, 1), (last, first, -1))):
            image = edge + inwards * np.where(
                reflects[:, end], np.minimum(layer, table.length - 1), 0
            )
            beyond = other - inwards * layer
            whole[edge - inwards * (layer + 1)] = whole[np.where(table.ring, beyond, image)]
    return whole
