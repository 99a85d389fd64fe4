"""The interaction integral on an r-grid by Fourier series, in both angles and in space.

With grad_r U = sum_pq K_pq(delta) b_p(theta) b_q(thetabar) (`angular`), the integral is

    force(r) = -eps0 h^2 sum_p b_p(phi(r)) sum_q [ K_pq * (rho b_q(phi)) ](r)

and likewise the torque: 2M + 1 transforms there, one real block per frequency, and three times as
many transforms back.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ellipsoid_coupling.interaction.angular import AngularSeries, angular_basis
from ellipsoid_coupling.interaction.grid_forces import Array, Forces, check_fields, check_grid
from ellipsoid_coupling.interaction.ladder import Ladder
from ellipsoid_coupling.interaction.spectra import (
    COMPONENT_PARITY,
    LANES,
    AngularKernel,
    Real,
    Spectra,
    basis_parity,
    precision_for,
    sum_products,
)
from ellipsoid_coupling.kernels import kernel, parallel_kernel

Complex = NDArray[np.complexfloating]


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

    Raises
    ------
    InputError
        A grid without cells or spacing; fields of another shape.
    """

    def __init__(self, grid_shape: tuple[int, int], strength: float, series: AngularSeries) -> None:
        check_grid(grid_shape, series.h)
        self.grid_shape = grid_shape
        self.series = series
        sizes = series.h**2, series.shape.size, strength
        self._precision = precision_for(series.tolerance, *sizes)
        kernel = AngularKernel(series, strength, self._precision)
        self._spectra = Ladder(grid_shape, kernel.cells, kernel.transform)

    def __call__(self, density: Array, angle: Array) -> Forces:
        """See `GridInteraction`."""
        check_fields(self.grid_shape, density, angle)
        components = self.series.coefficients.shape[1]
        out = np.zeros((components, *self.grid_shape))
        box = occupied_box(density)
        if box is not None:
            inner = density[box]
            basis = np.empty((2 * self.series.harmonics + 1, *inner.shape), self._precision)
            angular_basis(angle[box], basis)
            fields = convolve(self._spectra, basis * inner.astype(self._precision))
            _evaluate(fields, basis, inner, out[(slice(None), *box)])
        return Forces(out[0], out[1], out[2] if components == 3 else None)


def occupied_box(density: Array) -> tuple[slice, slice] | None:
    """The smallest (rows, columns) outside which `density` (ny, nx) is 0; None if all is empty."""
    occupied = density != 0.0
    rows, columns = np.flatnonzero(occupied.any(axis=1)), np.flatnonzero(occupied.any(axis=0))
    if rows.size == 0:
        return None
    return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)


def convolve(ladder: Ladder[Spectra], sources: Real) -> Real:
    """sum_q K_pq * sources_q, (2M + 1, rows, columns) to (components, 2M + 1, rows, columns)."""
    workers = numba.get_num_threads()
    functions, rows, columns = sources.shape
    spectra = ladder.fitting(rows, columns)
    py, px = spectra.padded
    waves = fft.rfft(sources, px, axis=2, workers=workers)
    waves = fft.fft(waves, py, axis=1, workers=workers, overwrite_x=True)
    fields = np.empty((spectra.blocks.shape[1], functions, py, px // 2 + 1), waves.dtype)
    parities = np.outer(COMPONENT_PARITY, basis_parity(functions)).astype(spectra.blocks.dtype)
    _multiply(spectra.blocks, parities, waves, fields)
    # Rows beyond the occupied ones are dropped before the transform along x.
    fields = fft.ifft(fields, axis=2, workers=workers, overwrite_x=True)[:, :, :rows]
    return fft.irfft(fields, px, axis=3, workers=workers)[..., :columns]


@parallel_kernel
def _multiply(blocks: Real, parities: Real, waves: Complex, fields: Complex) -> None:
    """fields[c, p] = sum_q block[c, p, q] waves[q] at every frequency (py, px//2 + 1)."""
    py = waves.shape[1]
    for ky in numba.prange(py // 2 + 1):
        minus = (py - ky) % py
        upper, lower = fields[:, :, ky], fields[:, :, minus]
        _multiply_rows(blocks[ky], parities, (waves[:, ky], waves[:, minus]), upper, lower)


@kernel
def _multiply_rows(
    block: Real, parities: Real, waves: tuple[Complex, Complex], upper: Complex, lower: Complex
) -> None:
    """The frequencies ky and -ky at once: blocks odd under y -> -y change sign in between.

    block : (components, F, F, padded n); waves : at ky and at -ky, (F, n) each;
    upper, lower : (components, F, n), overwritten, at ky and at -ky.
    """
    components, functions, n = upper.shape
    source = np.zeros((functions, 4, -(-n // LANES) * LANES), block.dtype)
    for q in range(functions):
        parity, up, down = parities[0, q], waves[0][q], waves[1][q]
        a, b, c, d = source[q, 0], source[q, 1], source[q, 2], source[q, 3]
        for j in range(n):
            a[j], b[j] = up[j].real, up[j].imag
        for j in range(n):
            c[j], d[j] = parity * down[j].real, parity * down[j].imag
    sums = np.empty(source.shape[1:], block.dtype)
    a, b, c, d = sums[0], sums[1], sums[2], sums[3]
    every = np.arange(functions)
    for component in range(components):
        for p in range(functions):
            sum_products(block[component, p], every, source, sums)
            parity, up, down = parities[component, p], upper[component, p], lower[component, p]
            if component == 2:
                for j in range(n):
                    up[j] = complex(a[j], b[j])
                for j in range(n):
                    down[j] = complex(parity * c[j], parity * d[j])
            else:
                # The transform of the force's odd kernel is imaginary: times i.
                for j in range(n):
                    up[j] = complex(-b[j], a[j])
                for j in range(n):
                    down[j] = complex(-parity * d[j], parity * c[j])


@parallel_kernel
def _evaluate(fields: Real, basis: Real, density: Array, out: Array) -> None:
    """out[c] = sum_p fields[c, p] basis[p] in occupied cells, 0 elsewhere."""
    for i in numba.prange(basis.shape[1]):
        for c in range(fields.shape[0]):
            for p in range(basis.shape[0]):
                for j in range(basis.shape[2]):
                    out[c, i, j] += fields[c, p, i, j] * basis[p, i, j]
            for j in range(basis.shape[2]):
                if density[i, j] == 0.0:
                    out[c, i, j] = 0.0
