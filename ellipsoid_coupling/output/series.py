"""Numbers of a result over time: mass, speeds, and how far the particles are aligned."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

# The mass is counted in as many bins along x and along y.
_BINS = 30


class Series(NamedTuple):
    """Numbers at the saved times, each (T,) float64; NaN where no particle is left.

    Attributes
    ----------
    times : in the scene's unit
    mass : inside the domain, of the 1 at the start
    speed : root mean square of v; of the mean velocity in a closure
    turning : root mean square of omega, likewise, per unit of time
    order : |<exp(2 i theta)>|, 1 if all main axes are parallel, 0 if they are even; None for circles
    """

    times: Floats
    mass: Floats
    speed: Floats
    turning: Floats
    order: Floats | None

    def by_name(self) -> dict[str, Floats]:
        """The numbers in words, those that there are."""
        numbers = {
            "mass in the domain": self.mass,
            "rms speed": self.speed,
            "rms angular velocity": self.turning,
        }
        return numbers if self.order is None else numbers | {"alignment of main axes": self.order}


def time_series(result: Result) -> Series:
    """The series of a result; of particles all realisations together, of grids weighted by density."""
    domain = result.scene.domain
    area = domain.width * domain.height
    rows = [_moments(result, k) for k in range(result.times.size)]
    speed, turning = np.array(rows).reshape(-1, 2).T
    return Series(
        times=result.times,
        mass=area * result.density(_BINS).reshape(-1, _BINS**2).mean(axis=1),
        speed=np.sqrt(speed),
        turning=np.sqrt(turning),
        order=None if result.scene.particles.is_circle else result.order_parameter(),
    )


def _moments(result: Result, k: int) -> tuple[float, float]:
    """<v^2> and <omega^2> at saved time k; NaN without mass."""
    weights = _weights(result, k)
    total = float(weights.sum())
    if not total > 0.0:
        return (np.nan, np.nan)
    x, y, omega = (
        _counted(result, name, k) for name in ("velocity_x", "velocity_y", "angular_velocity")
    )
    speed = float((weights * (x**2 + y**2)).sum()) / total
    turning = float((weights * omega**2).sum()) / total
    return (speed, turning)


def _counted(result: Result, name: str, k: int) -> Floats:
    """A variable at saved time k, 0 for particles that take no part, which may have no number."""
    values = result.variables[name][k]
    gone = result.frozen
    return values if gone is None else np.where(gone[k], 0.0, values)


def _weights(result: Result, k: int) -> Floats:
    """The weight of every particle or cell at saved time k."""
    if result.layout != "particles":
        return np.asarray(result.variables["density"][k])
    gone = result.frozen
    shape = result.variables["x"][k].shape
    return np.ones(shape) if gone is None else (~gone[k]).astype(np.float64)
