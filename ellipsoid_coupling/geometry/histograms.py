"""Densities and angle distributions of particles, r-grids and (r, theta) grids on the same bins.

Particles are counted; cells hand their mass to the bins that they overlap, so that every model's
result can be subtracted from every other's. Particles that have left the flow's mesh are in no bin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Range = tuple[float, float]
Flags = NDArray[np.bool_]

FULL_TURN = 2.0 * np.pi


def overlap_matrix(edges: Floats, bin_edges: Floats) -> Floats:
    """The part of each cell (columns) that lies in each bin (rows), (bins, cells)."""
    low = np.maximum(edges[None, :-1], bin_edges[:-1, None])
    high = np.minimum(edges[None, 1:], bin_edges[1:, None])
    return np.asarray(np.clip(high - low, 0.0, None) / np.diff(edges)[None, :])


def particle_density(
    x: Floats,
    y: Floats,
    x_range: Range,
    y_range: Range,
    cells: int,
    frozen: Flags | None = None,
) -> Floats:
    """Histogram density of particles (any shape, all counted alike) on cells x cells bins.

    frozen : of the shape of x, those that have left the flow's mesh; None where none can

    Returns (cells, cells), axis order (y, x); its integral is the part of the particles inside.
    """
    inside_x, inside_y = moving(x, frozen), moving(y, frozen)
    counts, _, _ = np.histogram2d(
        inside_y, inside_x, bins=cells, range=[list(y_range), list(x_range)]
    )
    area = (x_range[1] - x_range[0]) * (y_range[1] - y_range[0]) / cells**2
    return np.asarray(counts / (x.size * area))


def grid_density(density: Floats, x_range: Range, y_range: Range, cells: int) -> Floats:
    """A cell density (ny, nx) that covers the ranges, handed on to cells x cells bins."""
    ny, nx = density.shape
    to_y = overlap_matrix(np.linspace(*y_range, ny + 1), np.linspace(*y_range, cells + 1))
    to_x = overlap_matrix(np.linspace(*x_range, nx + 1), np.linspace(*x_range, cells + 1))
    return np.asarray(to_y @ density @ to_x.T * (cells / ny) * (cells / nx))


def particle_angles(angle: Floats, bins: int, frozen: Flags | None = None) -> Floats:
    """Angle distribution of particles on [0, 2 pi), (bins,), integral 1; all 0 where none is left.

    frozen : as in `particle_density`
    """
    kept = np.mod(moving(angle, frozen), FULL_TURN)
    counts, _ = np.histogram(kept, bins=bins, range=(0.0, FULL_TURN))
    return np.asarray(counts * bins / (FULL_TURN * max(kept.size, 1)))


def moving(values: Floats, frozen: Flags | None) -> Floats:
    """The values (n,) of the particles that have not left the flow's mesh."""
    return values.ravel() if frozen is None else values[~frozen]


def field_angles(mean_angle: Floats, mass: Floats, bins: int) -> Floats:
    """Angle distribution of a field of angles (ny, nx) weighted with each cell's mass, (bins,).

    An angle varies across its cell: sixteen points a cell follow the centred slopes towards those
    neighbours that hold mass too.
    """
    parts = (-0.375, -0.125, 0.125, 0.375)
    slope_y, slope_x = (_slope(mean_angle, mass, axis) for axis in (0, 1))
    width = FULL_TURN / bins
    total = np.zeros(bins)
    for part_y in parts:
        for part_x in parts:
            angle = mean_angle + part_y * slope_y + part_x * slope_x
            index = (np.mod(angle, FULL_TURN) // width).astype(np.int64)
            total += np.bincount(np.minimum(index, bins - 1).ravel(), mass.ravel(), bins)
    return np.asarray(total / (16 * width * max(float(mass.sum()), 1e-300)))


def _slope(values: Floats, mass: Floats, axis: int) -> Floats:
    """Difference of `values` a cell along an axis, centred, one-sided beside vacuum and the rim."""
    lines, filled = np.moveaxis(values, axis, 0), np.moveaxis(mass, axis, 0)
    step = np.diff(lines, axis=0)
    counted = np.minimum(filled[1:], filled[:-1]) > 1e-3 * np.maximum(filled[1:], filled[:-1])
    total, count = np.zeros_like(lines), np.zeros_like(lines)
    for part in (slice(None, -1), slice(1, None)):
        total[part] += np.where(counted, step, 0.0)
        count[part] += counted
    return np.moveaxis(total / np.maximum(count, 1.0), 0, axis)


def regrid_angles(distribution: Floats, bins: int) -> Floats:
    """An angle distribution on cells centred on multiples of their width, handed on to bins.

    Cell a of n covers ((a - 1/2) w, (a + 1/2) w) with w = 2 pi / n; bins start at 0.
    """
    n = distribution.size
    width = FULL_TURN / n
    edges: Floats = (np.arange(n + 1, dtype=np.float64) - 0.5) * width
    bin_edges = np.linspace(0.0, FULL_TURN, bins + 1, dtype=np.float64)
    weights = overlap_matrix(edges, bin_edges) + overlap_matrix(edges + FULL_TURN, bin_edges)
    return np.asarray(weights @ distribution * (bins / n))
