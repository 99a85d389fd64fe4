"""Two flows past curved walls whose characteristics are known; see cut_cells.py."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# A density at points (2, ..).
Density = Callable[[Floats], Floats]


class Flow(Protocol):
    """A plane flow past walls in the square |x|, |y| <= half; points are arrays (2, ..).

    times : of the errors.  starts : densities at time 0, by name.
    """

    name: ClassVar[str]
    half: ClassVar[float]
    times: ClassVar[tuple[float, ...]]
    starts: ClassVar[Mapping[str, Density]]

    def level(self, points: Floats) -> Floats:
        """The distance to the nearest wall, negative in solids."""
        ...

    def psi(self, points: Floats) -> Floats:
        """The stream function, u = (d psi/dy, -d psi/dx); finite in solids, too."""
        ...

    def wall_psi(self, points: Floats) -> Floats:
        """That of the nearest wall."""
        ...

    def origin(self, points: Floats, t: float) -> Floats:
        """Where what is at `points` at time t was at time 0."""
        ...


def hill(x: float, y: float, width: float) -> Density:
    """A Gaussian density about a point."""
    return lambda at: np.exp(-0.5 * ((at[0] - x) ** 2 + (at[1] - y) ** 2) / width**2)


def box(x: float, y: float, half: float) -> Density:
    """1 in a square about a point, 0 elsewhere."""
    return lambda at: 1.0 * ((np.abs(at[0] - x) < half) & (np.abs(at[1] - y) < half))


class Ring:
    """Couette flow u_theta = a r + b/r between r = 1, at rest, and r = 2, at speed 1."""

    name: ClassVar = "ring"
    half: ClassVar = 2.2
    inner, outer = 1.0, 2.0
    # A quarter and a full turn of the outer wall.
    times: ClassVar[tuple[float, ...]] = math.pi, 4.0 * math.pi
    starts: ClassVar[Mapping[str, Density]] = {
        "hill": hill(1.7, 0.0, 0.2),
        "wide hill": hill(1.7, 0.0, 0.6),
    }
    _a = 1.0 / (outer - inner**2 / outer)
    _b = -_a * inner**2

    def level(self, points: Floats) -> Floats:
        """See `Flow`."""
        r = np.hypot(*points)
        return np.asarray(np.minimum(r - self.inner, self.outer - r))

    def _psi(self, r: Floats) -> Floats:
        return -(0.5 * self._a * r**2 + self._b * np.log(r))

    def psi(self, points: Floats) -> Floats:
        """See `Flow`; about the centre that of a smaller circle."""
        return self._psi(np.maximum(np.hypot(*points), 0.5 * self.inner))

    def wall_psi(self, points: Floats) -> Floats:
        """See `Flow`."""
        middle = 0.5 * (self.inner + self.outer)
        return self._psi(np.where(np.hypot(*points) < middle, self.inner, self.outer))

    def origin(self, points: Floats, t: float) -> Floats:
        """Turned back by the rate a + b/r^2."""
        turn = -t * (self._a + self._b / np.maximum((points**2).sum(axis=0), self.inner**2))
        x, y = points
        cos, sin = np.cos(turn), np.sin(turn)
        return np.stack((cos * x - sin * y, sin * x + cos * y))


class Cylinder:
    """Potential flow u = (1, 0) past a cylinder, psi = y (1 - R^2/r^2)."""

    name: ClassVar = "cylinder"
    half: ClassVar = 2.0
    radius = 0.5
    times: ClassVar[tuple[float, ...]] = 1.0, 2.0
    # The box is that of the package's tests past a cylinder.
    starts: ClassVar[Mapping[str, Density]] = {
        "hill": hill(-1.2, 0.0, 0.2),
        "box": box(-1.2, 0.0, 0.4),
    }
    _steps = 50  # of Runge and Kutta in a unit of time

    def level(self, points: Floats) -> Floats:
        """See `Flow`."""
        return np.asarray(np.hypot(*points) - self.radius)

    def psi(self, points: Floats) -> Floats:
        """See `Flow`; bounded about the centre."""
        square = np.maximum((points**2).sum(axis=0), 0.1 * self.radius**2)
        return np.asarray(points[1] * (1.0 - self.radius**2 / square))

    def wall_psi(self, points: Floats) -> Floats:
        """See `Flow`."""
        return np.zeros(points.shape[1:])

    def _velocity(self, points: Floats) -> Floats:
        x, y = points
        part = self.radius**2 / np.maximum(x**2 + y**2, self.radius**2) ** 2
        return np.stack((1.0 - part * (x**2 - y**2), -2.0 * part * x * y))

    def origin(self, points: Floats, t: float) -> Floats:
        """By the rule of Runge and Kutta."""
        count = math.ceil(abs(t) * self._steps)
        for _ in range(count):
            dt = -t / count
            one = self._velocity(points)
            two = self._velocity(points + 0.5 * dt * one)
            three = self._velocity(points + 0.5 * dt * two)
            four = self._velocity(points + dt * three)
            points = points + dt / 6.0 * (one + 2.0 * (two + three) + four)
        return points
