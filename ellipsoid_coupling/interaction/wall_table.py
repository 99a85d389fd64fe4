"""What an endless wall of ghost cells does to a cell: a small table, made once per grid spacing.

The wall's frame: the wall along x, main axes of its ghost cells at angle 0, the domain above it.

    y = (i + 1/2) h    . . o . .      cell of distance index i, angle theta to the wall
    ------------------------------
                       + + + + +      ghost cells at y = -(k + 1/2) h, k = 0, 1, ...

Row d = i + k + 1 of ghost cells pushes the cell with sum_j grad U((j, -d) h, theta, 0), which
depends on d alone, so that the whole wall is the sum of rows d > i. The force along the wall
vanishes, for it is the derivative of a sum that does not change along it.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel, parallel_kernel
from ellipsoid_coupling.interaction.grid_forces import Array, Forces
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential

# Allowed error, relative to the largest entry, of interpolation before the angles are doubled for
# the last time; the doubling takes another factor of 16 off.
INTERPOLATION_TOLERANCE = 1e-6
LEAST_ANGLES = 128
NORMAL, TORQUE = range(2)


class WallFrame(NamedTuple):
    """A side's unit normal into the domain and the angle of its wall."""

    normal_x: float
    normal_y: float
    angle: float


WALL_FRAMES = {
    "left": WallFrame(1.0, 0.0, 0.5 * np.pi),
    "right": WallFrame(-1.0, 0.0, 0.5 * np.pi),
    "bottom": WallFrame(0.0, 1.0, 0.0),
    "top": WallFrame(0.0, -1.0, 0.0),
}


class WallTable:
    """Force and torque of the walls, interpolated to fourth order between tabulated angles.

    The error is at most 1e-6 of the largest normal force and of the largest torque in the table.

    Parameters
    ----------
    sides : tuple of str
        The sides of the domain that are walls, keys of `WALL_FRAMES`.
    entries : (2, depth, angles) float64
        Normal force (into the domain) and torque; axis order (quantity, distance index, angle to
        the wall), angles in steps of pi / angles. For circles there is one angle.
    """

    def __init__(self, sides: tuple[str, ...], entries: Array) -> None:
        self.sides = sides
        self.entries = entries

    @property
    def depth(self) -> int:
        """Number of cells from a wall on that feel it."""
        return int(self.entries.shape[1])

    def force(self, distance_index: NDArray[np.int64], angle: Array) -> tuple[Array, Array]:
        """Normal force and torque at any angles to the wall.

        Parameters
        ----------
        distance_index : integers >= 0
            Cells between the cell and the wall; from `depth` on the wall is not felt.
        angle : float64
            Main axis against the wall, `theta - WALL_FRAMES[side].angle`, radians; any shape that
            broadcasts with `distance_index`.
        """
        index, at = np.broadcast_arrays(distance_index, angle)
        felt = index < self.depth
        out = np.zeros((2, *index.shape))
        # A wall that reaches less than a cell has no rows to look up in.
        values = np.zeros((2, int(np.count_nonzero(felt))))
        _look_up_all(
            self.entries, index[felt].astype(np.int64), at[felt].astype(np.float64), values
        )
        out[:, felt] = values
        return out[NORMAL], out[TORQUE]

    def add_to(self, forces: Forces, density: Array, angle: Array) -> None:
        """Add the walls' forces, in place, to `forces` in occupied cells of a grid up to the walls.

        Parameters
        ----------
        forces : Forces of (ny, nx) float64
        density, angle : (ny, nx) float64
        """
        for side in self.sides:
            normal_x, normal_y, wall_angle = WALL_FRAMES[side]
            pull = forces.x if normal_x else forces.y
            _add_strip(
                self.entries,
                WallFrame(normal_x, normal_y, wall_angle),
                self._strip(side, pull),
                None if forces.torque is None else self._strip(side, forces.torque),
                self._strip(side, density),
                self._strip(side, angle),
            )

    def _strip(self, side: str, field: Array) -> Array:
        """A view of the part of `field` (ny, nx) that feels a wall; distance index first."""
        from_wall = field.T if side in ("left", "right") else field
        # Distance index 0 is the row of cells at the wall.
        return (from_wall[::-1] if side in ("right", "top") else from_wall)[: self.depth]


def tabulate_wall(
    sides: tuple[str, ...],
    h: float,
    widths: NDArray[np.int64],
    shape: PotentialShape,
    scale: float,
) -> WallTable:
    """The table for ghost cells of strength `scale` (eps0 rho h^2) each.

    `widths` (R + 1,) is the disc of offsets within reach. The angles are doubled until cubic
    interpolation half-way between them was within the tolerance before the last doubling.
    """
    if shape.shape_factor == 0.0:
        return WallTable(sides, _entries(h, widths, shape, scale, np.zeros(1)))
    angles = LEAST_ANGLES
    entries = _entries(h, widths, shape, scale, np.pi * np.arange(angles) / angles)
    while True:
        between = _entries(h, widths, shape, scale, np.pi * (np.arange(angles) + 0.5) / angles)
        # Cubic interpolation half-way between four even angles; the torque and the force are pi-periodic.
        near = entries + np.roll(entries, -1, axis=2)
        far = np.roll(entries, 1, axis=2) + np.roll(entries, -2, axis=2)
        error = np.abs((9.0 * near - far) / 16.0 - between).max(axis=(1, 2), initial=0.0)
        angles *= 2
        # What was made for the comparison is every second angle of the next table.
        entries = np.stack([entries, between], axis=3).reshape(2, -1, angles)
        if np.all(error <= INTERPOLATION_TOLERANCE * np.abs(entries).max(axis=(1, 2), initial=0.0)):
            return WallTable(sides, entries)


def _entries(
    h: float, widths: NDArray[np.int64], shape: PotentialShape, scale: float, angles: Array
) -> Array:
    """Normal force and torque of the whole wall: (2, R, angles) at distance indices 0 .. R - 1."""
    # Rows d = 1 .. R: row 0 of the disc is the cell's own.
    rows = np.zeros((2, widths.size - 1, angles.size))
    # Shared loops take plain tuples of numbers, no named ones.
    _row_forces(h, widths, tuple(shape), np.cos(2.0 * angles), np.sin(2.0 * angles), rows)
    # A cell at distance index i feels the rows d > i, added up from the farthest one on.
    return -scale * np.cumsum(rows[:, ::-1], axis=1)[:, ::-1]


@parallel_kernel
def _row_forces(
    h: float,
    widths: NDArray[np.int64],
    shape: tuple[float, ...],
    cosines: Array,
    sines: Array,
    out: Array,
) -> None:
    """sum_j of dU/dy and dU/dtheta over the row of ghost cells d = 1 .. R rows below."""
    shape_factor, size, reach, bluntness = shape
    for k in numba.prange(out.shape[1]):
        constants = PotentialShape(shape_factor, size, reach, bluntness)
        d = k + 1
        for j in range(-widths[d], widths[d] + 1):
            for a in range(cosines.size):
                # The ghost's main axis lies along the wall: its angle is 0.
                _, _, slope, turning = pair_potential(
                    j * h, -d * h, cosines[a], sines[a], 1.0, 0.0, constants
                )
                out[0, k, a] += slope
                out[1, k, a] += turning


@inline_kernel
def look_up(entries: Array, row: int, angle: float) -> tuple[float, float]:
    """Normal force and torque by cubic interpolation over four neighbouring angles."""
    angles = entries.shape[2]
    place = angle * (angles / np.pi)
    cell = np.floor(place)
    t = place - cell
    before, after = 1.0 + t, 2.0 - t
    # Lagrange's weights of the points -1, 0, 1 and 2 at t. They add up to 1, so that the single
    # angle of circles is itself.
    w0 = -t * (1.0 - t) * after / 6.0
    w1 = before * (1.0 - t) * after / 2.0
    w2 = before * t * after / 2.0
    w3 = -before * t * (1.0 - t) / 6.0
    # The remainder is not negative, whatever the angle is.
    first = int(cell) % angles
    i0, i2, i3 = (first - 1) % angles, (first + 1) % angles, (first + 2) % angles
    n, m = entries[0, row], entries[1, row]
    return (
        w0 * n[i0] + w1 * n[first] + w2 * n[i2] + w3 * n[i3],
        w0 * m[i0] + w1 * m[first] + w2 * m[i2] + w3 * m[i3],
    )


@kernel
def _look_up_all(entries: Array, rows: NDArray[np.int64], angle: Array, out: Array) -> None:
    for k in range(rows.size):
        out[0, k], out[1, k] = look_up(entries, rows[k], angle[k])


@kernel
def _add_strip(
    entries: Array,
    frame: WallFrame,
    pull: Array,
    torque: Array | None,
    density: Array,
    angle: Array,
) -> None:
    """Add to `pull`, the force's component across, and to `torque`; all fields are strips."""
    # One of both is 0.
    direction = frame.normal_x + frame.normal_y
    for i in range(density.shape[0]):
        for j in range(density.shape[1]):
            # Forces are 0 in vacuum, those of walls as well.
            if density[i, j] != 0.0:
                normal, turning = look_up(entries, i, angle[i, j] - frame.angle)
                pull[i, j] += direction * normal
                if torque is not None:
                    torque[i, j] += turning
