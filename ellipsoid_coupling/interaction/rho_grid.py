"""The interaction integral on an r-grid by Fourier series, in both angles and in space.

With grad_r U = sum_pq K_pq(delta) b_p(theta) b_q(thetabar) (`angular`), the integral is

    force(r) = -eps0 h^2 sum_p b_p(phi(r)) sum_q [ K_pq * (rho b_q(phi)) ](r)

and likewise the torque: 2M + 1 transforms there, one real block per frequency, and three times as
many transforms back.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.buffers import KeptArrays
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.compiled.simd_sums import sum_products
from ellipsoid_coupling.interaction.convolution.angular_series import AngularSeries, angular_basis
from ellipsoid_coupling.interaction.convolution.fft_lengths import Ladder
from ellipsoid_coupling.interaction.convolution.kernel_spectra import (
    FORCES,
    AngularKernel,
    Complex,
    Parities,
    Precision,
    Real,
    basis_parity,
    precision_for,
    set_parts,
)
from ellipsoid_coupling.interaction.convolution.transforms import Transforms, in_parts
from ellipsoid_coupling.interaction.grid_forces import Array, Forces, check_fields, check_grid


class HarmonicInteraction:
    """The discretised integral of `GridInteraction`, within the tolerance of its series.

    Force and torque are off by at most tolerance * max(density) * eps0 h^2 * series.norms, for any
    field of angles (see `angular_series`); rounding adds 1e-6 of that scale in single precision,
    which is taken for tolerances from 1e-4 on. Work is confined to the smallest rectangle of cells
    that holds all density, and forces are 0 in vacuum. The same bits come out for any number of
    threads.

    Parameters
    ----------
    grid_shape : (ny, nx)
    strength : float
        eps0.
    series : AngularSeries
        For the grid's spacing.
    periods : (bool, bool)
        Whether y and x are periodic, with an even number of cells.

    Raises
    ------
    InputError
        A grid without cells or spacing; fields of another shape.
    """

    def __init__(
        self,
        grid_shape: tuple[int, int],
        strength: float,
        series: AngularSeries,
        periods: tuple[bool, bool] = (False, False),
    ) -> None:
        check_grid(grid_shape, series.h)
        self.grid_shape = grid_shape
        self.series = series
        sizes = series.h**2, series.shape.size, strength
        self._precision = precision_for(series.tolerance, *sizes)
        kernel = AngularKernel(series, strength, self._precision)
        ladder = Ladder(grid_shape, kernel.cells, kernel, periods)
        self._convolve = Convolution(ladder, self._precision)
        self._room = KeptArrays()

    def __call__(self, density: Array, angle: Array) -> Forces:
        """See `GridInteraction`."""
        check_fields(self.grid_shape, density, angle)
        components = self.series.coefficients.shape[1]
        out = np.zeros((components, *self.grid_shape))
        box = occupied_box(density)
        if box is not None:
            self._add_forces(density[box], angle[box], out[(slice(None), *box)])
        return Forces(out[0], out[1], out[2] if components == 3 else None)

    def _add_forces(self, density: Array, angle: Array, out: Array) -> None:
        functions = 2 * self.series.harmonics + 1
        basis: Real = self._room.array("basis", (functions, *density.shape), self._precision)

        def sources(part: slice) -> Real:
            angular_basis(angle[part], basis[:, part])
            mass: Real = density[part].astype(self._precision)
            return basis[:, part] * mass

        def add(part: slice, fields: Real) -> None:
            _evaluate(fields, basis[:, part], density[part], out[:, part])

        self._convolve(basis.shape, sources, add)


def occupied_box(density: Array) -> tuple[slice, slice] | None:
    """The smallest (rows, columns) outside which `density` (ny, nx) is 0; None if all is empty."""
    occupied = density != 0.0
    rows, columns = np.flatnonzero(occupied.any(axis=1)), np.flatnonzero(occupied.any(axis=0))
    if rows.size == 0:
        return None
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


class Convolution:
    """sum_q K_pq * sources_q for all p and components, with spectra as long as is needed."""

    def __init__(self, ladder: Ladder, precision: Precision, parities: Parities = FORCES) -> None:
        self._ladder, self._transforms = ladder, Transforms(precision)
        self._parities = parities

    def __call__(
        self,
        shape: tuple[int, ...],
        sources: Callable[[slice], Real],
        take: Callable[[slice, Real], None],
    ) -> None:
        """Convolve sources of `shape` (2M + 1, rows, columns), a few rows at a time.

        sources : (some of the rows) -> (2M + 1, so many rows, columns)
        take : (some of the rows, (components, 2M + 1, so many rows, >= columns)) -> None
            Gets the result.
        """
        functions, rows, columns = shape
        blocks, padded = self._ladder.fitting(rows, columns)
        waves = self._transforms.forward(functions, rows, padded, sources)
        fields = self._transforms.product(waves, blocks.shape[1])
        parity = basis_parity(functions).astype(blocks.dtype)
        kinds = np.array(self._parities.mirrored, blocks.dtype), np.array(self._parities.odd)
        in_parts(
            len(blocks),
            fields.size,
            lambda first, end: _multiply(blocks, parity, kinds, waves, fields, (first, end)),
        )
        self._transforms.back(fields, rows, padded[1], take)


@kernel
def _multiply(
    blocks: Real,
    parity: Real,
    kinds: tuple[Real, NDArray[np.bool_]],
    waves: Complex,
    fields: Complex,
    range_of_ky: tuple[int, int],
) -> None:
    """fields[c, p] = sum_q block[c, p, q] waves[q] at ky = first .. end - 1 and -ky, all kx."""
    py = waves.shape[1]
    for ky in range(range_of_ky[0], range_of_ky[1]):
        minus = (py - ky) % py
        upper, lower = fields[:, :, ky], fields[:, :, minus]
        _multiply_rows(blocks[ky], parity, kinds, (waves[:, ky], waves[:, minus]), upper, lower)


@kernel
def _multiply_rows(
    block: Real,
    parity: Real,
    kinds: tuple[Real, NDArray[np.bool_]],
    waves: tuple[Complex, Complex],
    upper: Complex,
    lower: Complex,
) -> None:
    """The frequencies ky and -ky at once: blocks odd under y -> -y change sign in between.

    block : (components, lines, F, F, lanes)
    parity : (F,), of the basis; kinds : (components,) each, `Parities`
    waves : at ky and at -ky, (F, n) each
    upper, lower : (components, F, n), overwritten, at ky and at -ky
    """
    components, functions, n = upper.shape
    lines, lanes = block.shape[1], block.shape[4]
    mirrored, odd = kinds
    sources = np.zeros((lines, functions, 4, lanes), block.dtype)
    for q in range(functions):
        set_parts(waves[0][q], waves[1][q], parity[q], sources[:, q])
    sums = np.empty((functions, 4, lines * lanes), block.dtype)
    every = np.arange(functions)
    for component in range(components):
        sum_products(block[component], every, sources, sums)
        for p in range(functions):
            a, b, c, d = sums[p, 0], sums[p, 1], sums[p, 2], sums[p, 3]
            up, down = upper[component, p], lower[component, p]
            sign = mirrored[component] * parity[p]
            if odd[component]:
                # The transform of an odd kernel is imaginary: times i.
                for j in range(n):
                    up[j] = complex(-b[j], a[j])
                for j in range(n):
                    down[j] = complex(-sign * d[j], sign * c[j])
            else:
                for j in range(n):
                    up[j] = complex(a[j], b[j])
                for j in range(n):
                    down[j] = complex(sign * c[j], sign * d[j])


@kernel
def _evaluate(fields: Real, basis: Real, density: Array, out: Array) -> None:
    """out[c] = sum_p fields[c, p] basis[p] in occupied cells, 0 elsewhere."""
    for i in range(basis.shape[1]):
        for c in range(fields.shape[0]):
            for p in range(basis.shape[0]):
                for j in range(basis.shape[2]):
                    out[c, i, j] += fields[c, p, i, j] * basis[p, i, j]
            for j in range(basis.shape[2]):
                if density[i, j] == 0.0:
                    out[c, i, j] = 0.0
