"""The (angle, y, x) grid of the q-equations, and the window of it that holds mass.

    fields (4, na + 4, ny + 4, nx + 4), axis order (component, angle, y, x), two ghost layers a side

    angle cell a of na is centred on a k, k = 2 pi / na, and a = na is a = 0 again:

        g g | 0   1   2  ...  na - 1 | g g        pi/2 is a centre if 4 divides na

Cells outside the window are vacuum and stay so: nothing is computed there. A sweep moves mass by
one cell at most, so the window grows by one cell along an axis before that axis is swept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.kernels import parallel_kernel
from ellipsoid_coupling.schemes.grid import GHOSTS, Grid

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

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
    parts[low % grid.angles] += 1.0 - (place - low)
    parts[(low + 1) % grid.angles] += place - low
    return parts


class Window(NamedTuple):
    """The cells that may hold mass: all of `planes` times a rectangle, in interior indices.

    Attributes
    ----------
    planes : (m,) int64
        Angle cells, ascending.
    extent : (4,) int64
        y_first, y_end, x_first, x_end; the ends are not included.
    """

    planes: Indices
    extent: Indices


@parallel_kernel
def _extents(fields: Floats, out: Indices) -> None:
    """y_first, y_end, x_first, x_end of the mass of every plane: out (na, 4)."""
    for a in numba.prange(out.shape[0]):
        plane = fields[Q, a + GHOSTS]
        for j in range(plane.shape[0] - 2 * GHOSTS):
            first, end = plane.shape[1], 0
            for i in range(plane.shape[1] - 2 * GHOSTS):
                if plane[j + GHOSTS, i + GHOSTS] > 0.0:
                    first = min(first, i)
                    end = i + 1
            if end > 0:
                out[a, 0] = min(out[a, 0], j)
                out[a, 1] = j + 1
                out[a, 2] = min(out[a, 2], first)
                out[a, 3] = max(out[a, 3], end)


def occupied_window(fields: Floats) -> Window:
    """The smallest window that holds all mass of padded fields; empty for an empty grid."""
    extents = np.zeros((fields.shape[1] - 2 * GHOSTS, 4), dtype=np.int64)
    extents[:, 0::2] = np.iinfo(np.int64).max
    _extents(fields, extents)
    planes = np.flatnonzero(extents[:, 1] > 0)
    if planes.size == 0:
        return Window(planes, np.zeros(4, dtype=np.int64))
    held = extents[planes]
    low, high = held.min(axis=0), held.max(axis=0)
    return Window(planes, np.array([low[0], high[1], low[2], high[3]]))


def grown(window: Window, shape: tuple[int, int, int], axis: int) -> Window:
    """The window with one more cell at both ends of an axis; the angle is periodic, x and y end."""
    planes, extent = window
    if axis == -3:
        held = np.zeros(shape[0], dtype=bool)
        held[planes] = True
        return Window(np.flatnonzero(held | np.roll(held, 1) | np.roll(held, -1)), extent)
    first = 2 if axis == -1 else 0
    wider = extent.copy()
    wider[first] = max(extent[first] - 1, 0)
    wider[first + 1] = min(extent[first + 1] + 1, shape[axis])
    return Window(planes, wider)


def runs(planes: Indices) -> list[tuple[int, int]]:
    """First plane and number of planes of every run of neighbours, without wrapping round."""
    if planes.size == 0:
        return []
    ends = np.flatnonzero(np.diff(planes) > 1)
    first = planes[np.concatenate([[0], ends + 1])]
    last = planes[np.concatenate([ends, [planes.size - 1]])]
    return [(int(a), int(b - a + 1)) for a, b in zip(first, last, strict=True)]
