"""What a sweep keeps in memory of each run: bins, series and counts of one result."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compare.distances import ANGLE_BINS, DENSITY_CELLS, centred_angles
from ellipsoid_coupling.geometry.histograms import FULL_TURN
from ellipsoid_coupling.result import Result

Floats = NDArray[np.float64]

# Numbers of a run that results.nc has for each point, with units and what they are.
NUMBERS = {
    "steps": ("1", "steps taken"),
    "rejected_steps": ("1", "steps taken again"),
    "wall_seconds": ("s", "run time without compiling"),
    "compile_seconds": ("s", "time to compile"),
    "mass_start": ("1", "mass at the start"),
    "mass_end": ("1", "mass at the end"),
    "mass_left": ("1", "mass that has left"),
    "bin_area": ("1", "area of a bin of the density"),
}
SERIES = {
    "mass": ("1", "mass in the domain"),
    "mean_x": ("1", "mean position, x"),
    "mean_y": ("1", "mean position, y"),
    "rms_speed": ("1", "root mean square of the speed"),
    "rms_angular_velocity": ("rad", "root mean square of the angular velocity, per unit of time"),
}


class Record(NamedTuple):
    """One run of a sweep.

    Attributes
    ----------
    status : str
        "completed", "failed: ..." with the reason, or "missing".
    arrays : dict
        density (T, y, x) on `DENSITY_CELLS` cells each way, angle_distribution (T, angle) on bins centred
        on multiples of their width, and the series (T,); empty for a run that was not completed.
    numbers : dict of float
        Those of `NUMBERS` that the model counts.
    """

    status: str
    arrays: dict[str, Floats]
    numbers: dict[str, float]

    @property
    def completed(self) -> bool:
        """Whether the run came to its end."""
        return self.status == "completed"


def record_of(result: Result) -> Record:
    """What a sweep keeps of a result."""
    width = FULL_TURN / ANGLE_BINS
    arrays = {
        "density": result.density(DENSITY_CELLS),
        "angle_distribution": centred_angles(result) / width,
        **series(result),
    }
    domain = result.scene.domain
    counted = {k: float(result.attributes[k]) for k in NUMBERS if k in result.attributes}
    area = domain.width * domain.height / DENSITY_CELLS**2
    return Record(result.status, arrays, counted | {"bin_area": area})


def failed(reason: str) -> Record:
    """The record of a run that has no result."""
    return Record(f"failed: {reason}", {}, {})


MISSING = Record("missing", {}, {})


def series(result: Result) -> dict[str, Floats]:
    """Moments of the particles, or of the density, at each saved time: `SERIES` by name, (T,).

    Means are over the mass that is in the domain; particles that have left the flow's mesh are not.
    """
    weight = _weights(result)
    mass = _sum(weight)
    part = np.maximum(mass, np.finfo(float).tiny)
    x, y = _places(result)
    velocity = [result.variables[f"velocity_{axis}"] for axis in "xy"]
    speed = _sum(weight * (velocity[0] ** 2 + velocity[1] ** 2)) / part
    turning = _sum(weight * result.variables["angular_velocity"] ** 2) / part
    return {
        "mass": mass,
        "mean_x": _sum(weight * x) / part,
        "mean_y": _sum(weight * y) / part,
        "rms_speed": np.sqrt(speed),
        "rms_angular_velocity": np.sqrt(turning),
    }


def _sum(values: Floats) -> Floats:
    """Over all axes but time."""
    return np.asarray(values.reshape(len(values), -1).sum(axis=1))


def _weights(result: Result) -> Floats:
    """The mass of each particle or cell at each saved time."""
    if result.layout == "particles":
        x = result.variables["x"]
        alone = np.full(x.shape, 1.0 / x[0].size if len(x) else 0.0)
        return alone if result.frozen is None else np.where(result.frozen, 0.0, alone)
    density, domain = result.variables["density"], result.scene.domain
    ny, nx = density.shape[-2:]
    turn = FULL_TURN / density.shape[1] if result.layout == "q" else 1.0
    return np.asarray(density * (domain.width * domain.height / (nx * ny) * turn))


def _places(result: Result) -> tuple[Floats, Floats]:
    """X and y of each particle, or of the cells' centres, to be multiplied by the weights."""
    if result.layout == "particles":
        return result.variables["x"], result.variables["y"]
    return result.coordinates["x"], result.coordinates["y"][:, None]
