"""The (angle, y, x) grid of the q-equations, and which part of every row holds mass.

    fields (4, na + 4, ny + 4, nx + 4), axis order (component, angle, y, x), two ghost layers a side

    angle cell a of na is centred on a k, k = 2 pi / na, and a = na is a = 0 again:

        g g | 0   1   2  ...  na - 1 | g g        pi/2 is a centre if 4 divides na

Cells outside the extents are vacuum and stay so: nothing is computed there. A sweep moves mass by
one cell at most, so the extents grow by one cell along an axis before that axis is swept:

    row j + 1   . . . . # # # . . .        . . . # # # # . . .
    row j       . . # # # # . . . .   y    . . # # # # # # . .
    row j - 1   . . . . . . # # . .        . . # # # # # # . .
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
# Row by row, see `occupied_extents`.
Extents = NDArray[np.int64]

FULL_TURN = 2.0 * np.pi

# Components of the fields; the angular velocity's is left out where nothing turns.
Q, QVX, QVY, QOMEGA = range(4)
# The component of the momentum along an axis (-1: x, -2: y, -3: angle).
NORMAL = {-1: QVX, -2: QVY, -3: QOMEGA}

# Fewer would make a cell its own neighbour's neighbour.
_LEAST_ANGLES = 3


@dataclass(frozen=True)
class QGrid:
    """Square cells of `plane` times `angles` cells of [0, 2 pi)."""

    plane: Grid
    angles: int

    angle_resolved: ClassVar[bool] = True

    @property
    def shape(self) -> tuple[int, int, int]:
        """Interior cells, (na, ny, nx)."""
        return self.angles, *self.plane.shape

    @property
    def padded(self) -> tuple[int, int, int]:
        """Cells with ghosts, (na + 4, ny + 4, nx + 4)."""
        return self.angles + 2 * GHOSTS, *self.plane.padded

    @property
    def angle_width(self) -> float:
        """k, radian."""
        return FULL_TURN / self.angles

    @property
    def angle(self) -> Floats:
        """Cell centres in angle, (na,)."""
        return np.asarray(self.angle_width * np.arange(self.angles), dtype=np.float64)

    @property
    def volume(self) -> float:
        """h^2 k."""
        return self.plane.cell**2 * self.angle_width

    def width(self, axis: int) -> float:
        """The cell width along an axis (-1: x, -2: y, -3: angle)."""
        return self.angle_width if axis == -3 else self.plane.cell

    @property
    def everywhere(self) -> Extents:
        """Extents as if all cells held mass, (na, ny, 2)."""
        rows = self.shape[:2]
        # A copy, for broadcast memory is one row's.
        return np.broadcast_to(np.array([0, self.plane.nx]), (*rows, 2)).copy()


@dataclass(frozen=True)
class RGrid(QGrid):
    """An r-grid as an (angle, y, x) grid of one plane: no ghosts along the angle, a density per area."""

    angles: int = 1

    angle_resolved: ClassVar[bool] = False

    @property
    def padded(self) -> tuple[int, int, int]:
        """Cells with ghosts, (1, ny + 4, nx + 4)."""
        return 1, *self.plane.padded

    @property
    def angle_width(self) -> float:
        """A radian: a carried angle has no cells."""
        return 1.0


def check_angles(scene: str, angles: int) -> None:
    """Raise InputError for too few angle cells to sweep over."""
    if angles < _LEAST_ANGLES:
        raise InputError(
            f"scene {scene}, key numerics.angle_cells",
            f"at least {_LEAST_ANGLES} angle cells",
            f"{angles}",
            "Take more; a multiple of 4 centres a cell on pi/2.",
        )


def inside(padded: Floats) -> Floats:
    """The view of the last three axes without ghosts."""
    inner = slice(GHOSTS, -GHOSTS)
    return padded[..., inner, inner, inner]


def start_angles(grid: QGrid, angle: float) -> Floats:
    """The part of the mass in every angle cell, (na,): all at `angle`, which lies in one or two."""
    place = (angle / grid.angle_width) % grid.angles
    # An angle that misses a centre by rounding belongs to that centre.
    nearest = np.round(place)
    place = nearest if abs(place - nearest) < 1e-9 else place
    low = int(np.floor(place))
    parts = np.zeros(grid.angles)
    # Between two centres both share the mass, so that its mean direction is the angle.
    parts[low % grid.angles] += 1.0 - (place - low)
    parts[(low + 1) % grid.angles] += place - low
    return parts


@parallel_kernel
def _find_extents(fields: Floats, extents: Extents) -> None:
    rows = extents.shape[1]
    for task in numba.prange(extents.shape[0] * rows):
        a, j = task // rows, task % rows
        row = fields[Q, a + GHOSTS, j + GHOSTS, GHOSTS:-GHOSTS]
        first, end = extents[a, j]
        # Written so that NaN counts as mass: it shall be found, not be left out.
        while first < end and row[first] <= 0.0:
            first += 1
        while end > first and row[end - 1] <= 0.0:
            end -= 1
        # The first column of an empty row is beyond all others, so that a minimum over rows leaves it out.
        if first == end:
            first, end = row.size, 0
        extents[a, j, 0], extents[a, j, 1] = first, end


def occupied_extents(fields: Floats, within: Extents | None = None) -> Extents:
    """First and end column of the mass of every row of padded fields, (na, ny, 2).

    The end is not included; a row of vacuum has the end 0. `within` are extents that hold all mass.
    """
    _, na, ny, nx = inside(fields).shape
    whole = np.broadcast_to(np.array([0, nx]), (na, ny, 2))
    # One layout whatever the grid, for one compiled kernel.
    extents = np.array(whole if within is None else within, order="C")
    _find_extents(fields, extents)
    return extents


def grown(extents: Extents, columns: int, axis: int, periodic: bool = False) -> Extents:
    """One more cell at both ends along an axis.

    The angle is periodic; x (`columns` cells) and y end, or are periodic as well. A row of a periodic x
    whose mass comes to an end of it is taken as a whole: an interval cannot go on at the other end.
    """
    wider = np.empty(extents.shape, np.int64)
    _grow(extents, columns, axis, periodic, wider)
    return wider


@kernel
def _grow(extents: Extents, columns: int, axis: int, periodic: bool, wider: Extents) -> None:
    angles, rows = extents.shape[:2]
    for a in range(angles):
        for j in range(rows):
            first, end = extents[a, j, 0], extents[a, j, 1]
            # Nothing moves out of an empty row.
            if axis == -1 and end > 0:
                whole = periodic and (first == 0 or end == columns)
                first, end = max(first - 1, 0), min(end + 1, columns)
                if whole:
                    first, end = 0, columns
            # A row has one interval, which has to cover whatever comes from the rows beside it.
            for step in (-1, 1):
                if axis == -3:
                    beside = extents[(a + step) % angles, j]
                    first, end = min(first, beside[0]), max(end, beside[1])
                elif axis == -2 and (periodic or 0 <= j + step < rows):
                    beside = extents[a, (j + step) % rows]
                    first, end = min(first, beside[0]), max(end, beside[1])
            wider[a, j, 0], wider[a, j, 1] = first, end
