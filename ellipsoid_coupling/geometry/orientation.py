"""How the main axes lie: moments of the angle over the whole domain, or bin by bin.

    m_k = <e^{i k theta}>,      k = 1 for directions (with a head), k = 2 for axes (without)

    S = |m_2|                   order parameter: 1 where all axes are parallel, 0 where none is preferred
    arg(m_2)/2 in [0, pi)       director, the mean axis
    arg(m_1) in [0, 2 pi)       mean angle

Particles count alike, cells by their mass; bins are those of `histograms`.
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
    grid_density,
    moving,
)

Complex = NDArray[np.complex128]


class Moments(NamedTuple):
    """Mass, and sum of mass times e^{i k theta}, of one shape: scalars of the domain, or of bins."""

    mass: Floats
    sums: Complex

    def mean(self) -> Complex:
        """m_k; NaN where there is no mass."""
        filled = self.mass > 0.0
        nothing = np.full(self.sums.shape, complex(np.nan, np.nan))
        return np.asarray(np.divide(self.sums, self.mass, out=nothing, where=filled))


def particle_moments(
    places: tuple[Floats, Floats, Floats],
    order: int,
    ranges: tuple[Range, Range],
    cells: int | None,
    frozen: Flags | None = None,
) -> Moments:
    """Of particles (x, y, angle), arrays of any shape; `frozen` as in `histograms`.

    Without `cells` all that take part count, else those in cells x cells bins, axis order (y, x).
    """
    x, y, angle = (moving(values, frozen) for values in places)
    waves = np.exp(1j * order * angle)
    if cells is None:
        return Moments(np.asarray(float(x.size)), np.asarray(waves.sum()))
    bounds = [list(ranges[1]), list(ranges[0])]
    weights = (np.ones(x.size), waves.real, waves.imag)
    mass, cosine, sine = (
        np.histogram2d(y, x, bins=cells, range=bounds, weights=weight)[0] for weight in weights
    )
    return Moments(mass, cosine + 1j * sine)


def grid_moments(
    density: Floats, sums: Complex, ranges: tuple[Range, Range], cells: int | None
) -> Moments:
    """Of a density (ny, nx) and the sums over its angles, handed on to cells x cells bins."""
    if cells is None:
        return Moments(np.asarray(density.sum()), np.asarray(sums.sum()))
    mass, cosine, sine = (
        grid_density(np.ascontiguousarray(part), *ranges, cells)
        for part in (density, sums.real, sums.imag)
    )
    return Moments(mass, cosine + 1j * sine)


def summed_over_angles(density: Floats, angles: Floats, order: int) -> Complex:
    """(ny, nx): the sum over theta of q e^{i k theta} d theta, of q (angle, y, x)."""
    waves = np.exp(1j * order * angles)
    return np.asarray(np.tensordot(waves, density, axes=(0, 0)) * FULL_TURN / angles.size)


def order_of(mean: Complex) -> Floats:
    """S = |m_2|."""
    return np.abs(mean)


def phase_of(mean: Complex, order: int) -> Floats:
    """arg(m_k)/k in [0, 2 pi/k)."""
    turn = FULL_TURN / order
    angle = np.mod(np.angle(mean) / order, turn)
    # A small negative angle is rounded up to the whole turn.
    return np.where(angle >= turn, 0.0, angle)
