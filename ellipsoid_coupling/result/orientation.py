"""Means of the angle of any result: over the domain, or on bins that all models have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ellipsoid_coupling.geometry.histograms import Floats
from ellipsoid_coupling.geometry.orientation import (
    Complexes,
    Moments,
    Shape,
    grid_moments,
    particle_moments,
    summed_over_angles,
)

if TYPE_CHECKING:
    from ellipsoid_coupling.result.result import Result


def mean_wave(result: Result, order: int, cells: int | None) -> Complexes:
    """m_k = <e^{i k theta}>, (T,), or (T, cells, cells) on bins; NaN where there is no mass."""
    shape = None if cells is None else (cells, cells)
    means = [moments_at(result, t, order, shape).mean() for t in range(result.times.size)]
    return np.array(means, np.complex128).reshape(len(means), *(shape or ()))


def moments_at(result: Result, time: int, order: int, shape: Shape | None) -> Moments:
    """At saved time number `time`: scalars of the domain, or of (rows, columns) bins of it."""
    if result.layout == "particles":
        x, y, angle = (result.variables[name][time] for name in ("x", "y", "angle"))
        domain, frozen = result.scene.domain, result.frozen
        gone = None if frozen is None else frozen[time]
        return particle_moments((x, y, angle), order, (domain.x, domain.y), shape, gone)
    density = result.variables["density"][time]
    if result.layout == "rho":
        waves = np.exp(1j * order * result.variables["mean_angle"][time])
        return grid_moments(density, density * waves, shape)
    angles = result.coordinates["angle"]
    mass = summed_over_angles(density, angles, 0).real
    return grid_moments(mass, _sums_of_q(result, density, mass, order), shape)


def _sums_of_q(result: Result, density: Floats, mass: Floats, order: int) -> Complexes:
    """(ny, nx): the density of each cell times its mean of e^{i k theta}."""
    if result.holds_all_angles:
        return np.asarray(mass * np.exp(1j * order * result.held_angles()).mean())
    return summed_over_angles(density, result.coordinates["angle"], order)
