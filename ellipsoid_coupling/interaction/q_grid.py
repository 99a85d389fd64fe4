"""The interaction integral of the q-equations on an (angle, y, x) grid.

    force(r, theta)  = -eps0 sum h^2 k grad_r U(r, rbar, theta, thetabar) q(rbar, thetabar)
    torque(r, theta) = -eps0 sum h^2 k dU/dtheta(r, rbar, theta, thetabar) q(rbar, thetabar)

over all cells, k = 2 pi / angles. U is pi-periodic in both angles: the sources of theta and
theta + pi add up and their targets agree, so that an even number of angle cells folds to half.
In space the sum is a convolution: real Fourier transforms and one dense block of angles per
frequency (`angle_spectra`). Equal to the direct sum up to rounding: 1e-15 of the largest value, or
5e-7 in single precision, which moves and multiplies half as many bytes.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.compiled.simd_sums import sum_products
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.convolution.fft_lengths import Ladder
from ellipsoid_coupling.interaction.convolution.kernel_spectra import (
    Complex,
    Indices,
    Precision,
    Real,
    precision_for,
    set_parts,
)
from ellipsoid_coupling.interaction.convolution.q_kernel_spectra import (
    AngleKernels,
    Quantity,
    distinct_angles,
)
from ellipsoid_coupling.interaction.convolution.transforms import Transforms, in_parts
from ellipsoid_coupling.interaction.grid_forces import Array, check_grid
from ellipsoid_coupling.physics.potential import PotentialShape


class AngleForces(NamedTuple):
    """Force and torque on a particle, not divided by mass or inertia; angle a is at a % n.

    Attributes
    ----------
    x, y : (n, ny, nx) float64 or float32
        Force; n = `distinct_angles`.
    torque : (n, ny, nx) or None
        None for circles.
    """

    x: Real
    y: Real
    torque: Real | None


class _Angles(NamedTuple):
    """The angles that take part, (m,) each: which, and the place of each one's mirror image."""

    which: Indices
    mirror: Indices


class AngleGridInteraction:
    """The integral above for forces, or for the potential U * q itself.

    Work is confined to the rectangle of cells and to the angles that hold mass (and the mirror
    images of these angles); elsewhere the result is 0. The same bits come out for any number of
    threads.

    Parameters
    ----------
    grid_shape : (angles, ny, nx)
        Angle cells are centred on multiples of 2 pi / angles.
    h : float
        Spacing in x and y.
    shape : PotentialShape
    strength : float
        eps0.
    quantity : "forces" or "potential"
    tolerance : float
        Relative to the largest value. From 1e-4 on, single precision is taken.
    periods : (bool, bool)
        Whether y and x are periodic, with an even number of cells.

    Raises
    ------
    InputError
        A grid without cells or spacing, or too large for the memory; a density of another shape.
    """

    def __init__(
        self,
        grid_shape: tuple[int, int, int],
        h: float,
        shape: PotentialShape,
        strength: float,
        quantity: Quantity = "forces",
        tolerance: float = 0.0,
        periods: tuple[bool, bool] = (False, False),
    ) -> None:
        check_grid((min(grid_shape[:2]), grid_shape[2]), h)
        self.grid_shape = grid_shape
        self.angles = distinct_angles(grid_shape[0], shape)
        scale = strength * h * h * 2.0 * np.pi / grid_shape[0]
        sign = -1.0 if quantity == "forces" else 1.0
        self._precision: Precision = precision_for(tolerance, h * h, shape.size, strength)
        self._kernels = AngleKernels(grid_shape, h, shape, sign * scale, quantity, self._precision)
        self._ladder = Ladder(grid_shape[1:], self._kernels.cells, self._kernels, periods)
        self._transforms = Transforms(self._precision)
        self._kept: Real | None = None
        self._filled: tuple[slice, slice] | None = None

    def forces(self, density: Array, extents: Indices | None = None) -> AngleForces:
        """Force and torque of q `density` (angles, ny, nx), for quantity "forces".

        The next call overwrites them: a new array takes a tenth of the time of all the rest.

        extents : (angles, ny, 2) int64, optional
            First and end column of what every row holds; looked for if it is not known.
        """
        parts = self._integrals(density, extents)
        return AngleForces(parts[0], parts[1], parts[2] if len(parts) == 3 else None)

    def potential(self, density: Array) -> Real:
        """eps0 U * q of `density` (angles, ny, nx), (n, ny, nx), for quantity "potential".

        The next call overwrites it.
        """
        return np.asarray(self._integrals(density)[0])

    def _integrals(self, density: Array, extents: Indices | None = None) -> Real:
        """All components, (components, n, ny, nx)."""
        if density.shape != self.grid_shape:
            raise InputError(
                "interaction density",
                f"shape {self.grid_shape}, axis order (angle, y, x)",
                f"{density.shape}",
                "Make the interaction anew for another grid.",
            )
        if extents is None:
            extents = _occupied(density)
        box = box_of(extents)
        if box is None:
            return self._emptied(None)
        holding = _any(extents[..., 1] > 0, 1)
        angles = _mirrored_angles(_any(holding.reshape(-1, self.angles), 0))
        out = self._emptied(box if angles.which.size == self.angles else None)
        self._filled = box
        self._convolve(density[:, *box], angles, out[:, :, *box])
        return out

    def _emptied(self, box: tuple[slice, slice] | None) -> Real:
        """The result's memory, 0 all over, but for the `box` of cells that will be overwritten."""
        if self._kept is None:
            shape = self._kernels.odd.size, self.angles, *self.grid_shape[1:]
            self._kept = np.zeros(shape, self._precision)
        elif self._filled is not None and not (box and _holds(box, self._filled)):
            self._kept[:, :, *self._filled] = 0.0
        self._filled = None
        return self._kept

    def _convolve(self, density: Array, angles: _Angles, out: Real) -> None:
        """Of the rectangle `density` (angles, rows, columns) to `out` (components, n, ...)."""
        _, rows, columns = density.shape
        folds = density.reshape(-1, self.angles, rows, columns)
        blocks, padded = self._ladder.fitting(rows, columns)
        # All of them are a view of the array.
        which = slice(None) if angles.which.size == self.angles else angles.which

        def sources(part: slice) -> Real:
            # The angle cells that are one to the potential are added up.
            folded: Array = folds[:, which, part].sum(axis=0)
            return folded.astype(self._precision)

        def take(part: slice, fields: Real) -> None:
            out[:, which, part] = fields[..., :columns]

        transforms = self._transforms
        waves = transforms.forward(angles.which.size, rows, padded, sources)
        product = transforms.product(waves, out.shape[0])
        signs = np.stack([self._kernels.odd, self._kernels.mirrored])
        in_parts(
            len(blocks),
            product.size,
            lambda first, end: _multiply(blocks, signs, angles, waves, product, (first, end)),
        )
        transforms.back(product, rows, padded[1], take)


def _any(held: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
    return np.asarray(held.any(axis=axis))


def box_of(extents: Indices) -> tuple[slice, slice] | None:
    """The rectangle (rows, columns) outside which no angle holds mass; None if there is none.

    extents : (angles, ny, 2) int64, first and end column of what every row holds; end 0 if nothing.
    """
    held = extents[..., 1] > 0
    rows = np.flatnonzero(_any(held, 0))
    if rows.size == 0:
        return None
    columns = int(extents[held, 0].min()), int(extents[..., 1].max())
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(*columns)


def _holds(outer: tuple[slice, slice], inner: tuple[slice, slice]) -> bool:
    return all(a.start <= b.start and b.stop <= a.stop for a, b in zip(outer, inner, strict=True))


@parallel_kernel
def _occupied(density: Array) -> Indices:
    """First and end column of what every row of every angle holds, (angles, ny, 2); end 0 if none."""
    angles, rows, _ = density.shape
    extents = np.zeros((angles, rows, 2), np.int64)
    for a in numba.prange(angles):
        for j in range(rows):
            row = density[a, j]
            first, end = 0, row.size
            while first < end and row[first] == 0.0:
                first += 1
            while end > first and row[end - 1] == 0.0:
                end -= 1
            extents[a, j, 0], extents[a, j, 1] = first, end if end > first else 0
    return extents


def _mirrored_angles(holding: NDArray[np.bool_]) -> _Angles:
    """The angles with mass and their mirror images; `holding` (n,) tells which."""
    taking_part = holding | np.roll(holding[::-1], 1)
    which = np.flatnonzero(taking_part)
    place = np.cumsum(taking_part) - 1
    return _Angles(which, place[-which % holding.size])


@kernel
def _multiply(
    blocks: Real,
    signs: Indices,
    angles: _Angles,
    waves: Complex,
    fields: Complex,
    range_of_ky: tuple[int, int],
) -> None:
    """fields[c, a] = sum_b block[c, a, b] waves[b] at ky = first .. end - 1 and -ky, all kx."""
    py = waves.shape[1]
    for ky in range(range_of_ky[0], range_of_ky[1]):
        _multiply_rows(blocks[ky], signs, angles, waves, fields, (ky, (py - ky) % py))


@kernel
def _multiply_rows(
    block: Real,
    signs: Indices,
    angles: _Angles,
    waves: Complex,
    fields: Complex,
    rows: tuple[int, int],
) -> None:
    """Both ky and -ky: the block of -ky is that of ky between the mirrored angles."""
    count, n = angles.which.size, waves.shape[2]
    lines, lanes = block.shape[1], block.shape[4]
    plus, minus = rows
    sources = np.zeros((lines, count, 4, lanes), block.dtype)
    for b in range(count):
        set_parts(waves[b, plus], waves[angles.mirror[b], minus], 1.0, sources[:, b])
    every = np.empty((count, 4, lines * lanes), block.dtype)
    for c in range(signs.shape[1]):
        odd, sign = signs[0, c] == 1, signs[1, c]
        sum_products(block[c], angles.which, sources, every)
        for a in range(count):
            sums = every[a]
            up, down = fields[c, a, plus], fields[c, angles.mirror[a], minus]
            if odd:
                # The transform of an odd kernel is imaginary: times i.
                for j in range(n):
                    down[j] = complex(-sign * sums[3, j], sign * sums[2, j])
                    up[j] = complex(-sums[1, j], sums[0, j])
            else:
                for j in range(n):
                    down[j] = complex(sign * sums[2, j], sign * sums[3, j])
                    up[j] = complex(sums[0, j], sums[1, j])
