"""Order of axes that have neither head nor tail: the moment <e^{2 i theta}> of particles and cells.

    M = sum w e^{2 i theta} / sum w,    S = |M|,    mean axis = arg(M) / 2  in (-pi/2, pi/2]

S is 1 where all axes are parallel and 0 where none is preferred; theta and theta + pi count alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ellipsoid_coupling.geometry.histograms import Range, overlap_matrix

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
Complexes = NDArray[np.complex128]
# Bins along y and along x.
Shape = tuple[int, int]

# The bin of what lies in none.
NOWHERE = -1


def axis_moment(angles: ArrayLike, weights: ArrayLike, where: ArrayLike, bins: int) -> Complexes:
    """M of each bin, (bins,); 0 where a bin has no weight.

    Parameters
    ----------
    angles : any shape, in radian
    weights : of a shape that broadcasts with it, 0 or more
    where : whole numbers, likewise: the bin of each angle; below 0 for those in none
    bins : how many there are
    """
    parts = np.broadcast_arrays(angles, weights, where)
    angle, weight, index = (np.ravel(part) for part in parts)
    inside = index >= 0
    turned = 2.0 * angle[inside].astype(np.float64)
    weight, index = weight[inside].astype(np.float64), index[inside].astype(np.int64)
    total = np.bincount(index, weight, bins)
    cosine = np.bincount(index, weight * np.cos(turned), bins)
    sine = np.bincount(index, weight * np.sin(turned), bins)
    return np.asarray((cosine + 1j * sine) / np.where(total > 0.0, total, 1.0))


def mean_axis(moment: Complexes) -> Floats:
    """arg(M) / 2, the angle of the mean axis, in (-pi/2, pi/2]; 0 where M is 0."""
    return np.asarray(0.5 * np.angle(moment))


def as_axis(angle: Floats) -> Floats:
    """Angles modulo pi, in [-pi/2, pi/2)."""
    wrapped = np.mod(angle + 0.5 * np.pi, np.pi)
    # A small negative number plus pi may round to pi itself.
    return np.asarray(np.where(wrapped < np.pi, wrapped, 0.0) - 0.5 * np.pi)


def bins_of(x: Floats, y: Floats, x_range: Range, y_range: Range, shape: Shape) -> Indices:
    """The bin of each position, row by row from (x_low, y_low) on; `NOWHERE` outside and for NaN."""
    rows, columns = shape
    row, column = _place(y, y_range, rows), _place(x, x_range, columns)
    inside = (row >= 0) & (column >= 0)
    return np.where(inside, row * columns + column, NOWHERE)


def _place(values: Floats, span: Range, count: int) -> Indices:
    """The interval of each value among `count` equal ones, the upper end in the last; else -1."""
    inside = (values >= span[0]) & (values <= span[1])
    part = np.where(inside, (values - span[0]) / (span[1] - span[0]), 0.0)
    index = np.minimum((part * count).astype(np.int64), count - 1)
    return np.where(inside, index, -1)


def cell_moment(angles: Floats, density: Floats, shape: Shape) -> Complexes:
    """M on `shape` bins of a grid whose cells each hand on their mass to the bins that they overlap.

    Parameters
    ----------
    angles : (ny, nx), the angle of each cell; or (angles, 1, 1), those of a density over angles
    density : (ny, nx) or (angles, ny, nx)

    Returns
    -------
    `shape`, 0 where a bin has no mass.
    """
    turned = 2.0 * angles
    if density.ndim == 3:
        # Sums of real numbers: no complex copy of a density over angles.
        parts = [np.tensordot(w(turned.ravel()), density, 1) for w in (np.cos, np.sin)]
        wave, total = parts[0] + 1j * parts[1], density.sum(axis=0)
    else:
        wave, total = density * np.exp(1j * turned), density
    to_y, to_x = (_to_bins(cells, bins) for cells, bins in zip(total.shape, shape, strict=True))
    mass = to_y @ total @ to_x.T
    return np.asarray(to_y @ wave @ to_x.T / np.where(mass > 0.0, mass, 1.0))


def _to_bins(cells: int, bins: int) -> Floats:
    """The part of each of `cells` equal cells in each of `bins` equal bins over the same range."""
    return overlap_matrix(np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, bins + 1))
