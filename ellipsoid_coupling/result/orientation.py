"""Means of the angle of any result: over the domain, or on bins that all models have in common."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ellipsoid_coupling.geometry.histograms import Floats
from ellipsoid_coupling.geometry.orientation import (
    Complex,
    Moments,
    grid_moments,
    particle_moments,
    summed_over_angles,
)

if TYPE_CHECKING:
    from ellipsoid_coupling.result.result import Result


def mean_wave(result: Result, order: int, cells: int | None) -> Complex:
    """m_k = <e^{i k theta}>, (T,), or (T, cells, cells) on bins; NaN where there is no mass."""
    if result.layout == "particles":
        moments = [_of_particles(result, t, order, cells) for t in range(result.times.size)]
    else:
        ranges = result.scene.domain.x, result.scene.domain.y
        moments = [
            grid_moments(density, _summed(result, t, order, density), ranges, cells)
            for t, density in enumerate(result.cell_density())
        ]
    shape = () if cells is None else (cells, cells)
    means = np.array([one.mean() for one in moments], np.complex128)
    return means.reshape(len(moments), *shape)


def _of_particles(result: Result, time: int, order: int, cells: int | None) -> Moments:
    x, y, angle = (result.variables[name][time] for name in ("x", "y", "angle"))
    domain, frozen = result.scene.domain, result.frozen
    gone = None if frozen is None else frozen[time]
    return particle_moments((x, y, angle), order, (domain.x, domain.y), cells, gone)


def _summed(result: Result, time: int, order: int, density: Floats) -> Complex:
    """(ny, nx): the density of each cell times its mean of e^{i k theta}."""
    if result.layout == "rho":
        return np.asarray(density * np.exp(1j * order * result.variables["mean_angle"][time]))
    if result.holds_all_angles:
        return np.asarray(density * np.exp(1j * order * result.held_angles()).mean())
    angles = result.coordinates["angle"]
    return summed_over_angles(result.variables["density"][time], angles, order)
