"""How the main axes lie: moments of the angle over the whole domain, or bin by bin.

    m_k = <e^{i k theta}>,      k = 1 for directions (with a head), k = 2 for axes (without)

    S = |m_2|                   order parameter: 1 where all axes are parallel, 0 where none is preferred
    arg(m_2)/2 in [0, pi)       director, the mean axis
    arg(m_1) in [0, 2 pi)       mean angle

Particles count alike, cells by their mass, which they hand on to the bins that they overlap.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.geometry.histograms import (
    FULL_TURN,
    Flags,
    Floats,
    Range,
    moving,
    overlap_matrix,
)

Complexes = NDArray[np.complex128]
# Bins along y and along x.
Shape = tuple[int, int]


class Moments(NamedTuple):
    """Mass, and sum of mass times e^{i k theta}, of one shape: scalars of the domain, or of bins."""

    mass: Floats
    sums: Complexes

    def mean(self) -> Complexes:
        """m_k; NaN where there is no mass."""
        filled = self.mass > 0.0
        nothing = np.full(self.sums.shape, complex(np.nan, np.nan))
        return np.asarray(np.divide(self.sums, self.mass, out=nothing, where=filled))


def particle_moments(
    places: tuple[Floats, Floats, Floats],
    order: int,
    ranges: tuple[Range, Range],
    shape: Shape | None,
    frozen: Flags | None = None,
) -> Moments:
    """Of particles (x, y, angle), arrays of any shape; `frozen` as in `histograms`.

    Without a `shape` all that take part count, else those in so many bins of the ranges (x, y).
    """
    x, y, angle = (moving(values, frozen) for values in places)
    waves = np.exp(1j * order * angle)
    if shape is None:
        return Moments(np.asarray(float(x.size)), np.asarray(waves.sum()))
    bounds = [list(ranges[1]), list(ranges[0])]
    weights = (np.ones(x.size), waves.real, waves.imag)
    mass, cosine, sine = (
        np.histogram2d(y, x, bins=shape, range=bounds, weights=weight)[0] for weight in weights
    )
    return Moments(mass, cosine + 1j * sine)


def grid_moments(density: Floats, sums: Complexes, shape: Shape | None) -> Moments:
    """Of a density (ny, nx) and the sums over its angles, over the domain or on so many bins of it."""
    if shape is None:
        return Moments(np.asarray(density.sum()), np.asarray(sums.sum()))
    to_y, to_x = (_to_bins(cells, bins) for cells, bins in zip(density.shape, shape, strict=True))
    return Moments(np.asarray(to_y @ density @ to_x.T), np.asarray(to_y @ sums @ to_x.T))


def _to_bins(cells: int, bins: int) -> Floats:
    """The part of each of `cells` equal cells in each of `bins` equal bins over the same range."""
    return overlap_matrix(np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, bins + 1))


def summed_over_angles(density: Floats, angles: Floats, order: int) -> Complexes:
    """(ny, nx): the sum over theta of q e^{i k theta} d theta, of q (angle, y, x)."""
    # Sums of real numbers: no complex copy of a density over angles.
    cosine, sine = (np.tensordot(wave(order * angles), density, 1) for wave in (np.cos, np.sin))
    return np.asarray((cosine + 1j * sine) * FULL_TURN / angles.size)


def order_of(mean: Complexes) -> Floats:
    """S = |m_2|."""
    return np.abs(mean)


def phase_of(mean: Complexes, order: int) -> Floats:
    """arg(m_k)/k in [0, 2 pi/k)."""
    turn = FULL_TURN / order
    angle = np.mod(np.angle(mean) / order, turn)
    # A small negative angle is rounded up to the whole turn.
    return np.where(angle >= turn, 0.0, angle)


def as_axis(angle: Floats) -> Floats:
    """Angles modulo pi, in [-pi/2, pi/2)."""
    wrapped = np.mod(angle + 0.5 * np.pi, np.pi)
    # A small negative number plus pi may round to pi itself.
    return np.asarray(np.where(wrapped < np.pi, wrapped, 0.0) - 0.5 * np.pi)


def mean_axis(moment: Complexes) -> Floats:
    """arg(m_2)/2, the angle of the mean axis, in (-pi/2, pi/2]; 0 where m_2 is 0."""
    return np.asarray(0.5 * np.angle(moment))
