"""The interaction integral on an r-grid by Fourier series, in both angles and in space.

With grad_r U = sum_pq K_pq(delta) b_p(theta) b_q(thetabar) (`angular_series`), the integral is

    force(r) = -eps0 h^2 sum_p b_p(phi(r)) sum_q [ K_pq * (rho b_q(phi)) ](r)

and likewise the torque: 2M + 1 transforms there, one real block per frequency, and three times as
many transforms back.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.interaction.convolution.angular_series import AngularSeries, angular_basis
from ellipsoid_coupling.interaction.convolution.fft_lengths import FittedSpectra
from ellipsoid_coupling.interaction.convolution.kernel_spectra import (
    FORCES,
    AngularKernel,
    Parities,
    basis_parity,
)
from ellipsoid_coupling.interaction.convolution.spectra import (
    Precision,
    Real,
    Symmetry,
    multiply,
    precision_for,
)
from ellipsoid_coupling.interaction.convolution.transforms import Transforms, in_parts
from ellipsoid_coupling.interaction.grid_forces import Array, Forces, check_fields, check_grid
from ellipsoid_coupling.interaction.occupied import occupied_box, occupied_extents


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

    Attributes
    ----------
    precision : float32 or float64
        Of the transforms.

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
        # What enters the products has to fit into single precision as well.
        sizes = series.h**2, series.shape.size, strength
        self.precision = precision_for(series.tolerance, *sizes)
        kernel = AngularKernel(series, strength, self.precision)
        spectra = FittedSpectra(grid_shape, kernel.cells, kernel, periods)
        self._convolve = Convolution(spectra, self.precision)
        self._pool = BufferPool()

    def __call__(self, density: Array, angle: Array) -> Forces:
        """See `GridInteraction`."""
        check_fields(self.grid_shape, density, angle)
        # Two components for circles, three with the torque.
        components = self.series.coefficients.shape[1]
        out = np.zeros((components, *self.grid_shape))
        box = occupied_box(occupied_extents(density[None]))
        if box is not None:
            # Shorter transforms for the occupied rectangle; nothing beyond it acts or is acted on.
            self._add_forces(density[box], angle[box], out[(slice(None), *box)])
        return Forces(out[0], out[1], out[2] if components == 3 else None)

    def _add_forces(self, density: Array, angle: Array, out: Array) -> None:
        functions = 2 * self.series.harmonics + 1
        basis: Real = self._pool.array("basis", (functions, *density.shape), self.precision)

        def sources(part: slice) -> Real:
            angular_basis(angle[part], basis[:, part])
            # b_q(phi) rho: the same basis weights the result in `add`.
            mass: Real = density[part].astype(self.precision)
            return basis[:, part] * mass

        def add(part: slice, fields: Real) -> None:
            # All rows of the basis are there: the way back begins when the way forth has ended.
            _evaluate(fields, basis[:, part], density[part], out[:, part])

        self._convolve(basis.shape, sources, add)


class Convolution:
    """sum_q K_pq * sources_q for all p and components, with spectra as long as is needed."""

    def __init__(
        self, spectra: FittedSpectra, precision: Precision, parities: Parities = FORCES
    ) -> None:
        self._spectra, self._transforms = spectra, Transforms(precision)
        self._parities = parities

    def __call__(
        self,
        shape: tuple[int, ...],
        sources: Callable[[slice], Real],
        take: Callable[[slice, Real], None],
    ) -> None:
        """Convolve sources of `shape` (2M + 1, rows, columns), a few rows at a time.

        sources : (slice of the rows) -> (2M + 1, these rows, columns)
        take : (slice of the rows, (components, 2M + 1, these rows, >= columns)) -> None
            Gets the result.
        """
        functions, rows, columns = shape
        blocks, padded = self._spectra.for_cells(rows, columns)
        waves = self._transforms.forward(functions, rows, padded, sources)
        fields = self._transforms.product(waves, blocks.shape[1])
        # A mirrored basis function is itself, up to its sign.
        every = np.arange(functions)
        symmetry = Symmetry(
            every,
            basis_parity(functions).astype(blocks.dtype),
            np.array(self._parities.mirrored, blocks.dtype),
            np.array(self._parities.odd),
        )
        in_parts(
            len(blocks),
            fields.size,
            lambda *part: multiply(blocks, every, symmetry, waves, fields, part),
        )
        self._transforms.back(fields, rows, padded[1], take)


@kernel
def _evaluate(fields: Real, basis: Real, density: Array, out: Array) -> None:
    """out[c] = sum_p fields[c, p] basis[p] in occupied cells, 0 elsewhere."""
    for i in range(basis.shape[1]):
        for c in range(fields.shape[0]):
            # Row by row, so that the sums of a row stay in cache.
            for p in range(basis.shape[0]):
                for j in range(basis.shape[2]):
                    out[c, i, j] += fields[c, p, i, j] * basis[p, i, j]
            for j in range(basis.shape[2]):
                # In vacuum the convolution is not 0, but the forces of `GridInteraction` are.
                if density[i, j] == 0.0:
                    out[c, i, j] = 0.0
