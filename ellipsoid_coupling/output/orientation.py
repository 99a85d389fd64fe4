"""Order and mean axes of a result of any model, see `geometry.orientation`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.geometry.orientation import (
    NOWHERE,
    Complexes,
    Shape,
    axis_moment,
    bins_of,
    cell_moment,
)
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

# Particles in a bin below which its order is chance: that of n random axes is about 1/sqrt(n).
FEWEST = 4
# Angles of a distribution that nothing changes.
_HELD = 720


class OrderSeries(NamedTuple):
    """S at the saved times (T,), and its standard error over realisations, 0 where there is one at most."""

    order: Floats
    error: Floats


def axis_moments(result: Result, shape: Shape) -> Complexes:
    """<e^{2 i theta}> on `shape` (rows, columns) bins of the domain at the saved times, (T, rows, columns).

    0 in empty bins, and in those of fewer than `FEWEST` particles.
    """
    if result.layout == "particles":
        return _particle_moments(result, shape)
    moments = [grid_moment(result, t, shape) for t in range(result.times.size)]
    return np.array(moments).reshape(-1, *shape)


def grid_moment(result: Result, t: int, shape: Shape | None = None) -> Complexes:
    """<e^{2 i theta}> of a grid at one saved time, on its own cells or on `shape` bins.

    Of angles that nothing turns a q grid has one cell; their distribution, everywhere the same, tells
    then.
    """
    density = result.variables["density"][t]
    shape = shape or (density.shape[-2], density.shape[-1])
    if result.layout == "rho":
        return cell_moment(result.variables["mean_angle"][t], density, shape)
    if len(density) > 1:
        return cell_moment(result.coordinates["angle"][:, None, None], density, shape)
    angles = (np.arange(_HELD) + 0.5) * 2.0 * np.pi / _HELD
    moment = result.angle_distribution(_HELD)[t] @ np.exp(2j * angles) * 2.0 * np.pi / _HELD
    filled = cell_moment(np.zeros(density[0].shape), density[0], shape) != 0.0
    return np.where(filled, moment, 0.0)


def _particle_moments(result: Result, shape: Shape) -> Complexes:
    domain, count = result.scene.domain, shape[0] * shape[1]
    moments = np.zeros((result.times.size, count), np.complex128)
    for t in range(result.times.size):
        x, y, angle = (result.variables[name][t] for name in ("x", "y", "angle"))
        where = bins_of(x, y, domain.x, domain.y, shape)
        if result.frozen is not None:
            where = np.where(result.frozen[t], NOWHERE, where)
        number = np.bincount(where[where >= 0].ravel(), minlength=count)
        # Those that an inlet has not fed in have no angle; their weight of 0 would not remove NaN.
        moments[t] = axis_moment(np.where(where >= 0, angle, 0.0), 1.0, where, count)
        moments[t, number < FEWEST] = 0.0
    return moments.reshape(-1, *shape)


def order_series(result: Result) -> OrderSeries:
    """The order parameter S = |<e^{2 i theta}>| of all that moves, at the saved times.

    The error is that of the jackknife: how S spreads where one realisation after the other is left out.
    """
    if result.layout != "particles":
        whole = [np.abs(grid_moment(result, t, (1, 1)))[0, 0] for t in range(result.times.size)]
        return OrderSeries(np.array(whole, np.float64), np.zeros(len(whole)))
    angle = result.variables["angle"]
    frozen = result.frozen
    moving = np.ones(angle.shape, np.bool_) if frozen is None else ~frozen
    wave = np.where(moving, np.exp(2j * np.where(moving, angle, 0.0)), 0.0).sum(axis=2)
    number = moving.sum(axis=2)
    order = np.abs(wave.sum(axis=1)) / np.maximum(number.sum(axis=1), 1)
    count = number.shape[1]
    if count < 2:
        return OrderSeries(order, np.zeros(order.shape))
    left = wave.sum(axis=1, keepdims=True) - wave
    without = np.abs(left) / np.maximum(number.sum(axis=1, keepdims=True) - number, 1)
    return OrderSeries(order, np.sqrt((count - 1.0) * without.var(axis=1)))
