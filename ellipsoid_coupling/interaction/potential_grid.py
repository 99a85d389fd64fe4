"""The interaction potential of a density on an (angle, y, x) grid, by Fourier transforms in space.

    (U * q)(r, theta) = eps0 sum_cells h^2 k U(rbar - r, theta, thetabar) q(rbar, thetabar)

U is pi-periodic in both angles, so with an even number of angles those that are pi apart are added
up first and half of them are left; U is even in rbar - r, so its transform is real: one real,
symmetric block (angles x angles) per frequency.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ellipsoid_coupling.compiled.jit import parallel_kernel
from ellipsoid_coupling.interaction.grid_forces import Array, check_grid
from ellipsoid_coupling.physics.potential import PotentialShape, pair_potential


class PotentialGrid:
    """U * q on a grid, exact to rounding; nothing beyond the grid acts.

    Parameters
    ----------
    cells : (na, ny, nx)
        Angles a k with k = 2 pi / na, a = 0 .. na - 1; rows; columns.
    h : float
        Spacing in space, the same in both directions.
    shape : PotentialShape
    strength : float
        eps0.

    Raises
    ------
    InputError
        A grid without cells or spacing.
    """

    def __init__(
        self, cells: tuple[int, int, int], h: float, shape: PotentialShape, strength: float
    ) -> None:
        angles, *rows_columns = cells
        check_grid((rows_columns[0], rows_columns[1]), h)
        self.cells = cells
        self._folds = 2 if angles % 2 == 0 else 1
        reach = math.floor(shape.reach / h)
        self._padded = [fft.next_fast_len(n + reach, real=True) for n in rows_columns]
        width = 2.0 * np.pi / angles
        theta = width * np.arange(angles // self._folds)
        samples = np.zeros((theta.size, theta.size, *self._padded))
        _sample(reach, h, (np.cos(2.0 * theta), np.sin(2.0 * theta)), tuple(shape), samples)
        self._blocks: NDArray[np.float64] = fft.rfft2(samples).real
        self._blocks *= strength * h * h * width

    def __call__(self, density: Array) -> Array:
        """U * q for `density` (na, ny, nx), per unit of area and radian."""
        angles, rows, columns = self.cells
        folded = density.reshape(self._folds, angles // self._folds, rows, columns).sum(axis=0)
        waves = fft.rfft2(folded, self._padded)
        sums = np.einsum("abyx,byx->ayx", self._blocks, waves)
        potential = fft.irfft2(sums, self._padded)[:, :rows, :columns]
        return np.tile(potential, (self._folds, 1, 1))


@parallel_kernel
def _sample(
    reach: int, h: float, axes: tuple[Array, Array], shape: tuple[float, ...], out: Array
) -> None:
    """U/eps0 at all offsets of a periodic grid, (angle, other angle, y, x), in place."""
    shape_factor, size, distance, bluntness = shape
    c2, s2 = axes
    for a in numba.prange(c2.size):
        constants = PotentialShape(shape_factor, size, distance, bluntness)
        for b in range(c2.size):
            for j in range(-reach, reach + 1):
                for i in range(-reach, reach + 1):
                    potential, _, _, _ = pair_potential(
                        i * h, j * h, c2[a], s2[a], c2[b], s2[b], constants
                    )
                    out[a, b, j, i] = potential
