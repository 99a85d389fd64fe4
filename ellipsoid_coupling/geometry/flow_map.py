"""Bins of a density that a flow map carries along: few samples, and what lies between them.

X(a) is where the sample that started at a is now. With a constant density over the start box the mass of
a bin A is

    M(A) = 1/|box| int 1[X(a) in A] da

X is known at the midpoints of rows x columns equal parts of the box. Cubics through four of them along
each axis (error h^4 X'''') lead to the corners of finer parts. Every fine part is taken for the
parallelogram that its corners' mean and mean edges span: a line cuts off exactly the part of it that the
sum of two uniform numbers has below (`part_below`), so that for an affine map nothing is left to chance
where a bin's side cuts it. Counted points would err by a row of them at every side that they lie along.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import inline_kernel, kernel
from ellipsoid_coupling.geometry.histograms import FULL_TURN, Range
from ellipsoid_coupling.geometry.reflection import reflect

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Floats = NDArray[np.float64]

# Points of an interpolation along an axis.
_POINTS = 4
# Fine parts along a side of the start box, and of a sample's own part, at least. What parallelograms miss
# falls like the square of their size: with 257 x 257 samples it is 0.005 of the angles of `rotation` at two
# parts a sample, 0.001 at four, 0.0002 at eight.
_FINE, _PARTS = 1500, 2
# Corners that are in memory at a time, of each field.
_STRIP = 1_000_000
# A parallelogram narrower than this part of its place is a point: its width is rounding. So is one that
# spans more than so many turns: neighbours that have parted that far say nothing of what lies between.
_POINT = 1e-12
_MOST_TURNS = 8.0


def fine_parts(across: int) -> int:
    """In how many fine parts a sample's own is divided along each axis, with so many samples across."""
    return max(_PARTS, -(-_FINE // across))


def _interpolation(across: int, parts: Floats) -> csr_array[np.float64, tuple[int, int]]:
    """The matrix from the midpoints of `across` equal parts of [0, 1] to other `parts` of it.

    By Lagrange's formula through the nearest four midpoints, also beyond the outer ones.
    """
    from scipy.sparse import csr_array

    points = min(_POINTS, across)
    # In samples, of which the first lies at 0.
    places = parts * across - 0.5
    first = np.clip(np.floor(places).astype(np.int64) - points // 2 + 1, 0, across - points)
    offsets, weights = places - first, np.ones((places.size, points))
    for j in range(points):
        for k in range(points):
            if k != j:
                weights[:, j] *= (offsets - k) / (j - k)
    columns = first[:, None] + np.arange(points)
    starts = np.arange(places.size + 1) * points
    return csr_array((weights.ravel(), columns.ravel(), starts), shape=(places.size, across))


def corner_strips(fields: Floats) -> Iterator[list[Floats]]:
    """Fields at midpoints, (D, rows, columns), interpolated to the corners of the finer parts.

    Some rows at a time: D arrays (m + 1, N + 1) for m of M rows of N finer parts.
    """
    up, along = (_corner_parts(count) for count in fields.shape[1:])
    rows = max(1, _STRIP // along.size)
    for first in range(0, up.size - 1, rows):
        some = up[first : first + rows + 1]
        yield [_at_parts(values, some, along) for values in fields]


def _corner_parts(across: int) -> Floats:
    """Where the corners of the finer parts are on a side of length 1."""
    count = across * fine_parts(across)
    return np.arange(count + 1) / count


def midpoint_values(values: Floats, rows: int, columns: int) -> Floats:
    """Values at midpoints, interpolated to those of rows x columns equal parts of the same box."""
    return _at_parts(values, *((np.arange(count) + 0.5) / count for count in (rows, columns)))


def _at_parts(values: Floats, up: Floats, along: Floats) -> Floats:
    """Values at parts `up` and `along` of the sides of the box, (up, along)."""
    rows, columns = (
        _interpolation(count, parts) for count, parts in zip(values.shape, (up, along), strict=True)
    )
    return np.ascontiguousarray((columns @ np.ascontiguousarray((rows @ values).T)).T)


@inline_kernel
def part_below(distance: float, one: float, other: float) -> float:
    """The probability that one U + other V < distance, with U and V uniform in (-1/2, 1/2).

    With p >= q the lengths and T(z) = max(z, 0)^2/2

        [T(d + (p+q)/2) - T(d + (p-q)/2) - T(d - (p-q)/2) + T(d - (p+q)/2)] / (p q)
    """
    long, short = max(abs(one), abs(other)), min(abs(one), abs(other))
    outer, inner = 0.5 * (long + short), 0.5 * (long - short)
    if distance <= -outer:
        return 0.0
    if distance >= outer:
        return 1.0
    if abs(distance) <= inner:
        return 0.5 + distance / long
    # What a corner cuts off: a triangle.
    missing = outer - abs(distance)
    corner = 0.5 * missing * missing / (long * short)
    return corner if distance < 0.0 else 1.0 - corner


@inline_kernel
def _tile(corners: Floats, j: int, i: int) -> tuple[float, float, float, float]:
    """Centre, both edges and half the extent of the fine part (j, i) along one axis of space."""
    low_left, low_right = corners[j, i], corners[j, i + 1]
    high_left, high_right = corners[j + 1, i], corners[j + 1, i + 1]
    centre = 0.25 * (low_left + low_right + high_left + high_right)
    along = 0.5 * (low_right + high_right - low_left - high_left)
    across = 0.5 * (high_left + high_right - low_left - low_right)
    extent = 0.5 * (abs(along) + abs(across))
    return centre, along, across, extent if extent > _POINT * abs(centre) else 0.0


@inline_kernel
def _bin_of(edges: Floats, place: float) -> int:
    """The bin that holds a place, -1 or the number of bins beyond them."""
    low, high = 0, edges.size
    while low < high:
        middle = (low + high) // 2
        if edges[middle] <= place:
            low = middle + 1
        else:
            high = middle
    return low - 1


@inline_kernel
def _share(edges: Floats, k: int, centre: float, one: float, other: float) -> float:
    """The part of a parallelogram between the edges of bin k."""
    below = part_below(edges[k] - centre, one, other)
    return part_below(edges[k + 1] - centre, one, other) - below


@kernel
def _add_tiles(x: Floats, y: Floats, x_edges: Floats, y_edges: Floats, masses: Floats) -> None:
    """Add the mass 1 of every fine part to the bins (rows, columns) that it lies in.

    x, y : (M + 1, N + 1), at the corners
    """
    rows, columns = masses.shape
    for j in range(x.shape[0] - 1):
        for i in range(x.shape[1] - 1):
            x_centre, x_one, x_other, wide = _tile(x, j, i)
            y_centre, y_one, y_other, high = _tile(y, j, i)
            left, right = _bin_of(x_edges, x_centre - wide), _bin_of(x_edges, x_centre + wide)
            low, top = _bin_of(y_edges, y_centre - high), _bin_of(y_edges, y_centre + high)
            for row in range(max(low, 0), min(top, rows - 1) + 1):
                part = 1.0 if low == top else _share(y_edges, row, y_centre, y_one, y_other)
                for k in range(max(left, 0), min(right, columns - 1) + 1):
                    share = 1.0 if left == right else _share(x_edges, k, x_centre, x_one, x_other)
                    masses[row, k] += part * share


@kernel
def _add_arcs(angle: Floats, masses: Floats) -> None:
    """Add the mass 1 of every fine part to the bins of a full turn that its angles lie in.

    angle : (M + 1, N + 1), at the corners, without jumps
    """
    bins = masses.size
    width = FULL_TURN / bins
    for j in range(angle.shape[0] - 1):
        for i in range(angle.shape[1] - 1):
            centre, one, other, half = _tile(angle, j, i)
            centre %= FULL_TURN
            half = half if half < _MOST_TURNS * FULL_TURN else 0.0
            first, last = np.floor((centre - half) / width), np.floor((centre + half) / width)
            below = 0.0
            for k in range(int(first), int(last) + 1):
                until = part_below((k + 1) * width - centre, one, other) if k < last else 1.0
                masses[k % bins] += until - below
                below = until


@kernel
def _fold(corners: Floats, low: float, high: float) -> None:
    for j in range(corners.shape[0]):
        for i in range(corners.shape[1]):
            corners[j, i], _ = reflect(corners[j, i], low, high)


def mapped_density(
    places: Floats, ranges: tuple[Range, Range], cells: int, box: Floats | None
) -> Floats:
    """The density that a flow map carries, on cells x cells bins: (cells, cells), axis order (y, x).

    Parameters
    ----------
    places : (2, rows, columns) float64
        x and y of the samples that started at the midpoints of so many equal parts, row by row.
    ranges : ((x_low, x_high), (y_low, y_high))
        Of the bins; mass beyond them is in no bin.
    box : (2, 2) or None
        Reflecting sides [[x_low, x_high], [y_low, y_high]], which no mass passes; infinite where there
        are none.
    """
    edges = [np.linspace(low, high, cells + 1, dtype=np.float64) for low, high in ranges]
    for d, (low, high) in enumerate(ranges):
        if box is not None:
            # What the parallelograms reach beyond a wall belongs to the bin beside it.
            edges[d][0], edges[d][-1] = (
                end if np.isinf(wall) else side * np.inf
                for end, wall, side in zip((low, high), box[d], (-1.0, 1.0), strict=True)
            )
    masses = np.zeros((cells, cells))
    for x, y in corner_strips(places):
        if box is not None:
            _fold(x, box[0, 0], box[0, 1])
            _fold(y, box[1, 0], box[1, 1])
        _add_tiles(x, y, edges[0], edges[1], masses)
    area = (ranges[0][1] - ranges[0][0]) * (ranges[1][1] - ranges[1][0]) / cells**2
    return masses / (_tiles(places[0]) * area)


def mapped_angles(angle: Floats, bins: int) -> Floats:
    """The angle distribution that a flow map carries on [0, 2 pi), (bins,), integral 1.

    angle : (rows, columns), as `places` in `mapped_density`; not wrapped, so that neighbours differ little
    """
    masses = np.zeros(bins)
    for (corners,) in corner_strips(angle[None]):
        _add_arcs(corners, masses)
    return np.asarray(masses * bins / (FULL_TURN * _tiles(angle)))


def _tiles(values: Floats) -> int:
    """How many finer parts there are."""
    rows, columns = (int(count) for count in values.shape)
    return rows * fine_parts(rows) * columns * fine_parts(columns)
