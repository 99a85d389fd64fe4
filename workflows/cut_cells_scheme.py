"""A density that a fluid carries, on the grids of cut_cells_grids.py; see cut_cells.py."""

from __future__ import annotations

import numpy as np
from cut_cells_flows import Floats
from cut_cells_grids import Cells
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from ellipsoid_coupling.finite_volume.fluxes.ballistic import DENSITY_LIMIT, smooth_part

Indices = NDArray[np.int64]

# The largest part of a whole cell that leaves it in a step.
CFL = 0.5
# Of a whole cell's area: what is smaller is joined with another cell.
_SMALL = 0.4
# Of a whole cell's area: so much more or less is another one.
_ROUNDING = 1e-9
_BESIDE = [(0, -1), (0, 1), (-1, 0), (1, 0)]
_AROUND = [*_BESIDE, (-1, -1), (-1, 1), (1, -1), (1, 1)]


class Planes:
    """Limited planes through the values of some points and of up to eight around each, least squares.

    Parameters
    ----------
    which : (n,) int64, the points among all.
    around : (n, 8) int64, those around; -1 where there is none.
    places : (2, all) float64
    reach : (n, 2, m) float64, from each point to where its plane shall stay within the values around.
    allowed : part of a value by which it may leave them, for smooth extrema.
    """

    def __init__(
        self, which: Indices, around: Indices, places: Floats, reach: Floats, allowed: float
    ) -> None:
        self.which, self._around, self._reach, self._allowed = which, around, reach, allowed
        self._known = around >= 0
        offsets = np.where(self._known, places[:, around] - places[:, which, None], 0.0)
        self._inverse = np.linalg.pinv(offsets.transpose(1, 2, 0), rcond=1e-6)

    def slopes(self, values: Floats) -> Floats:
        """(2, n), of values (all,)."""
        here = values[self.which, None]
        rise = np.where(self._known, values[self._around] - here, 0.0)
        slope = np.einsum("nab,nb->na", self._inverse, rise)
        reached = np.einsum("na,nam->nm", slope, self._reach)
        spare = 0.5 * self._allowed * np.abs(here)
        top = np.maximum(rise.max(axis=1, keepdims=True), 0.0) + spare
        bottom = np.minimum(rise.min(axis=1, keepdims=True), 0.0) - spare
        bound = np.where(reached > 0.0, top, bottom)
        part = np.where(
            np.abs(reached) > np.abs(bound), bound / np.where(reached, reached, 1.0), 1.0
        )
        return np.asarray((slope * part.min(axis=1, keepdims=True)).T)


def _neighbours(cells: Cells, which: Indices) -> Indices:
    """The eight cells around each, flat, (n, 8); -1 where there is no fluid or no cell."""
    shape = cells.area.shape
    j, i = np.unravel_index(which, shape)
    found = np.full((which.size, len(_AROUND)), -1)
    for k, (dj, di) in enumerate(_AROUND):
        inside = (j + dj >= 0) & (j + dj < shape[0]) & (i + di >= 0) & (i + di < shape[1])
        flat = (j + dj) * shape[1] + i + di
        found[:, k] = np.where(inside & cells.fluid.ravel()[np.where(inside, flat, 0)], flat, -1)
    return found


class _Sharing:
    """State redistribution: a small cell's value is that of it and its largest neighbour, shared out again.

    With N how many of these pairs and single cells a cell is in, a pair's value is the mean of its two
    with the weights area/N, and a cell's new value is the mean of its N at its centre.
    """

    def __init__(self, cells: Cells, allowed: float | None) -> None:
        area, centre = cells.area.ravel(), cells.centre.reshape(2, -1)
        small = np.flatnonzero((area > 0.0) & (area < _SMALL * cells.width**2))
        beside = _neighbours(cells, small)[:, : len(_BESIDE)]
        size = np.where(beside >= 0, area[beside], 0.0)
        self._small = small
        self._other = beside[np.arange(small.size), size.argmax(axis=1)]
        self._count = 1.0 + np.bincount(self._other, minlength=area.size)
        own, other = ((area / self._count)[which] for which in (small, self._other))
        self._part = own / (own + other)
        middle = centre.copy()
        middle[:, small] = self._mean(centre)
        ways = [centre[:, which] - middle[:, small] for which in (small, self._other)]
        self._ways = np.stack(ways, axis=-1).transpose(1, 0, 2)
        self._planes = None
        if allowed is not None:
            around = _neighbours(cells, small)
            self._planes = Planes(small, around, middle, self._ways, allowed)

    def _mean(self, values: Floats) -> Floats:
        """Of pairs, values (.., all)."""
        own, other = values[..., self._small], values[..., self._other]
        return np.asarray(self._part * own + (1.0 - self._part) * other)

    def __call__(self, density: Floats) -> Floats:
        """(ny, nx), of the same mass."""
        values = density.ravel().copy()
        values[self._small] = self._mean(values)
        at = np.repeat(values[self._small, None], 2, axis=1)
        if self._planes is not None:
            at += np.einsum("an,nam->nm", self._planes.slopes(values), self._ways)
        values[self._small] = at[:, 0]
        np.add.at(values, self._other, at[:, 1])
        return (values / self._count).reshape(density.shape)


class Transport:
    """Steps of a density (ny, nx).

    Parameters
    ----------
    cells : Cells
    order : 1 (upwind, Euler's step) or 2 (limited slopes, Heun's step)
    carried : the density of what comes in through the sides of the square
    """

    def __init__(self, cells: Cells, order: int, carried: float = 0.0) -> None:
        self._cells, self._order, self._carried = cells, order, carried
        self._allowed = smooth_part(max(cells.area.shape))
        self._share = _Sharing(cells, self._allowed if order == 2 else None)
        # Beside cells that are not whole slopes are those of planes.
        whole = np.abs(cells.area - cells.width**2) < _ROUNDING * cells.width**2
        odd = binary_dilation(cells.fluid & ~whole, np.ones((3, 3), bool))
        which = np.flatnonzero(odd & cells.fluid)
        places = cells.centre.reshape(2, -1)
        ways = [
            (face - cells.centre) * (through != 0.0)
            for face, through in zip(_faces_of(cells), _through_of(cells), strict=True)
        ]
        reach = np.stack([way.reshape(2, -1)[:, which] for way in ways], axis=-1)
        self._planes = Planes(
            which, _neighbours(cells, which), places, reach.transpose(1, 0, 2), self._allowed
        )

    @property
    def largest_step(self) -> float:
        """That of whole cells."""
        left, right, down, up = _through_of(self._cells)
        out = sum(np.maximum(part, 0.0) for part in (-left, right, -down, up))
        return float(CFL * self._cells.width**2 / np.max(out))

    def step(self, density: Floats, dt: float) -> Floats:
        """The density after a step."""
        one = self._share(density + dt * self._rate(density))
        if self._order == 1:
            return one
        return 0.5 * (density + self._share(one + dt * self._rate(one)))

    def _slopes(self, density: Floats) -> Floats:
        """(2, ny, nx): limited along x and y, with the cell itself for a neighbour that is no fluid."""
        found = np.zeros((2, *density.shape))
        for which, axis in enumerate((1, 0)):
            low, high = (self._rise(density, axis, way) for way in (-1, 1))
            centred = 0.5 * (high - low)
            same = low * high < 0.0
            bound = same * DENSITY_LIMIT * np.minimum(np.abs(low), np.abs(high))
            smooth = np.abs(high + low) <= self._allowed * density
            bound = np.where(smooth, np.abs(centred), bound)
            found[which] = np.copysign(np.minimum(np.abs(centred), bound), centred)
        found /= self._cells.width
        found.reshape(2, -1)[:, self._planes.which] = self._planes.slopes(density.ravel())
        return found

    def _rise(self, density: Floats, axis: int, way: int) -> Floats:
        """To the next cell along an axis; 0 where there is none."""
        here: list[slice] = [slice(None), slice(None)]
        there = list(here)
        here[axis], there[axis] = (slice(1, None), slice(None, -1))[::-way]
        rise = np.zeros(density.shape)
        both = self._cells.fluid[tuple(here)] & self._cells.fluid[tuple(there)]
        rise[tuple(here)] = both * (density[tuple(there)] - density[tuple(here)])
        return rise

    def _rate(self, density: Floats) -> Floats:
        cells = self._cells
        slopes = self._slopes(density) if self._order == 2 else None
        at = [
            density if slopes is None else density + (slopes * (face - cells.centre)).sum(axis=0)
            for face in _faces_of(cells)
        ]
        gone = np.zeros(density.shape)
        for axis, through in ((1, cells.through[0]), (0, cells.through[1])):
            lower, upper = at[2 * (1 - axis) : 2 * (1 - axis) + 2]
            before, after = np.zeros((2, 2), np.int64), np.zeros((2, 2), np.int64)
            before[axis, 0] = after[axis, 1] = 1
            below = np.pad(upper, before, constant_values=self._carried)
            above = np.pad(lower, after, constant_values=self._carried)
            gone += np.diff(through * np.where(through > 0.0, below, above), axis=axis)
        return -gone / np.where(cells.fluid, cells.area, 1.0)


def _faces_of(cells: Cells) -> tuple[Floats, Floats, Floats, Floats]:
    """The middles of the cells' left, right, lower and upper faces, (2, ny, nx) each."""
    x, y = cells.faces
    return x[..., :-1], x[..., 1:], y[..., :-1, :], y[..., 1:, :]


def _through_of(cells: Cells) -> tuple[Floats, Floats, Floats, Floats]:
    """What flows through them."""
    x, y = cells.through
    return x[:, :-1], x[:, 1:], y[:-1], y[1:]
