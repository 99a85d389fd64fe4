"""Order and mean axes of a result of any model as figures show them, see `geometry.orientation`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.geometry.orientation import Complexes, Shape
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.result.orientation import moments_at

Floats = NDArray[np.float64]

# Particles in a bin below which its order is chance: that of n random axes is about 1/sqrt(n).
FEWEST = 4


class OrderSeries(NamedTuple):
    """S at the saved times (T,), and its standard error over realisations, 0 where there is one at most."""

    order: Floats
    error: Floats


def axis_moments(result: Result, shape: Shape) -> Complexes:
    """<e^{2 i theta}> on `shape` (rows, columns) bins of the domain at the saved times, (T, rows, columns).

    0 in empty bins, and in those of fewer than `FEWEST` particles.
    """
    found = [axis_moment(result, t, shape) for t in range(result.times.size)]
    return np.array(found, np.complex128).reshape(-1, *shape)


def axis_moment(result: Result, time: int, shape: Shape) -> Complexes:
    """`axis_moments` at one saved time."""
    moments = moments_at(result, time, 2, shape)
    fewest = FEWEST if result.layout == "particles" else 0.0
    some = (moments.mass > 0.0) & (moments.mass >= fewest)
    return np.where(some, moments.sums / np.where(some, moments.mass, 1.0), 0.0)


def order_series(result: Result) -> OrderSeries:
    """The order parameter S = |<e^{2 i theta}>| of all that moves, at the saved times; NaN of nothing.

    The error is that of the jackknife: how S spreads where one realisation after the other is left out.
    """
    order = result.order_parameter()
    if result.layout != "particles" or result.variables["angle"].shape[1] < 2:
        return OrderSeries(order, np.zeros(order.shape))
    angle, frozen = result.variables["angle"], result.frozen
    moving = np.ones(angle.shape, np.bool_) if frozen is None else ~frozen
    wave = np.where(moving, np.exp(2j * np.where(moving, angle, 0.0)), 0.0).sum(axis=2)
    number, count = moving.sum(axis=2), angle.shape[1]
    left = wave.sum(axis=1, keepdims=True) - wave
    without = np.abs(left) / np.maximum(number.sum(axis=1, keepdims=True) - number, 1)
    return OrderSeries(order, np.sqrt((count - 1.0) * without.var(axis=1)))
