"""What every interaction on an r-grid takes and gives, whichever way it is computed."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.physics.potential import PotentialShape

Array = NDArray[np.float64]


class Forces(NamedTuple):
    """Force and torque on a particle in every cell of an r-grid, not divided by mass or inertia.

    Attributes
    ----------
    x, y : (ny, nx) float64
        Force; 0 in cells of density 0.
    torque : (ny, nx) float64 or None
        None where the particles are circles, which no torque turns.
    """

    x: Array
    y: Array
    torque: Array | None


class GridInteraction(Protocol):
    """The interaction integral on a uniform cell-centred grid, axis order (y, x).

    force(r)  = -eps0 sum_cells h^2 grad_r U(r, rbar, phi(r), phi(rbar)) rho(rbar)
    torque(r) = -eps0 sum_cells h^2 dU/dtheta(r, rbar, phi(r), phi(rbar)) rho(rbar)
    """

    def __call__(self, density: Array, angle: Array) -> Forces:
        """Forces of `density` (ny, nx), main axes at `angle` (ny, nx; any real number, radians)."""
        ...


def half_widths(shape: PotentialShape, h: float) -> NDArray[np.int64]:
    """The disc of offsets within the potential's reach, row by row.

    Returns (R + 1,) int64: the row at a distance of i cells holds the offsets -w[i] .. w[i].
    """
    cells = shape.reach / h
    rows = np.arange(math.floor(cells) + 1)
    # U vanishes on the rim: an offset there that rounding leaves out is none that is missed.
    widths: NDArray[np.int64] = np.floor(np.sqrt(cells**2 - rows**2)).astype(np.int64)
    return widths


def check_grid(grid_shape: tuple[int, int], h: float) -> None:
    """Raise InputError unless `grid_shape` (ny, nx) has cells and the spacing `h` is positive."""
    # `not (h > 0)` refuses NaN as well.
    if min(grid_shape) < 1 or not (h > 0.0 and math.isfinite(h)):
        raise InputError(
            "interaction grid",
            "at least one cell in each direction and a spacing h > 0",
            f"{grid_shape} cells, h = {h}",
            "Give the grid's (ny, nx) and its spacing.",
        )


def check_fields(grid_shape: tuple[int, int], density: Array, angle: Array) -> None:
    """Raise InputError unless both fields have the grid's shape."""
    if density.shape != grid_shape or angle.shape != grid_shape:
        raise InputError(
            "interaction fields",
            f"density and angle of shape {grid_shape}, axis order (y, x)",
            f"{density.shape} and {angle.shape}",
            "Make the interaction anew for another grid.",
        )
