"""How far two states are apart, in numbers that every model has and that no bins disturb.

place    the mean distance by which mass must move along x or along y (the worse), in widths of
the domain: the integral of |F1 - F2| over the marginal distribution functions
angle    |<e^{2 i theta}>_1 - <e^{2 i theta}>_2|, between 0 and 2
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.models import Model, kind_named
from ellipsoid_coupling.scenes import Scene

Floats = NDArray[np.float64]

# Distribution functions are compared at this many places.
_PLACES = 480


@dataclass(frozen=True)
class Shape:
    """Marginal distribution functions in x and y (2, places), and <e^{2 i theta}>, to be compared."""

    marginals: Floats
    axis: complex

    @property
    def finite(self) -> bool:
        """Whether there is neither NaN nor infinity."""
        return bool(np.isfinite(self.marginals).all() and np.isfinite(self.axis))


def shape_of(model: Model, scene: Scene) -> Shape:
    """The present state of a model."""
    now = {name: np.asarray(values, np.float64) for name, values in model.snapshot().items()}
    domain = scene.domain
    ranges = (domain.x, domain.y)
    kind = kind_named(model.name)
    if not kind.is_grid:
        marginals = [
            _of_particles(now[name].ravel(), *span) for name, span in zip("xy", ranges, strict=True)
        ]
        return Shape(np.array(marginals), _mean_axis(now["angle"], np.ones(now["angle"].shape)))
    density = now["density"]
    mass = density / density.sum() if density.sum() > 0.0 else density
    if kind.layout == "rho":
        angle = now["mean_angle"]
    else:
        angle = np.broadcast_to(model.coordinates()["angle"][:, None, None], density.shape)
    axis = _mean_axis(angle, mass)
    mass = mass.reshape(-1, *mass.shape[-2:]).sum(axis=0)
    return Shape(np.array([_of_cells(mass.sum(axis=0)), _of_cells(mass.sum(axis=1))]), axis)


def _mean_axis(angle: Floats, weight: Floats) -> complex:
    total = float(weight.sum())
    if not np.isfinite(angle).all():
        return complex(math.nan)
    return complex((weight * np.exp(2j * angle)).sum() / total) if total > 0.0 else 0.0


def _of_particles(coordinate: Floats, low: float, high: float) -> Floats:
    """The part of the particles at or below each place; NaN if one of them is nowhere."""
    if not np.isfinite(coordinate).all():
        return np.full(_PLACES, np.nan)
    places = low + (high - low) * (np.arange(_PLACES) + 0.5) / _PLACES
    return np.asarray(np.searchsorted(np.sort(coordinate), places, "right") / coordinate.size)


def _of_cells(mass: Floats) -> Floats:
    edges = np.concatenate([[0.0], np.cumsum(mass)])
    places = (np.arange(_PLACES) + 0.5) / _PLACES * mass.size
    return np.asarray(np.interp(places, np.arange(mass.size + 1), edges))


def distances(one: Shape, other: Shape, *, turns: bool) -> tuple[float, float]:
    """Place and angle, as the module defines them; circles have no angle."""
    away = float(np.abs(one.marginals - other.marginals).mean(axis=1).max())
    return away, abs(one.axis - other.axis) if turns else 0.0
