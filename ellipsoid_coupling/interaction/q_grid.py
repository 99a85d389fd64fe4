"""The interaction integral of the q-equations on an (angle, y, x) grid.

    force(r, theta)  = -eps0 sum h^2 k grad_r U(r, rbar, theta, thetabar) q(rbar, thetabar)
    torque(r, theta) = -eps0 sum h^2 k dU/dtheta(r, rbar, theta, thetabar) q(rbar, thetabar)

over all cells, k = 2 pi / angles. U is pi-periodic in both angles: the sources of theta and
theta + pi add up and their targets agree, so that an even number of angle cells folds to half.
In space the sum is a convolution: real Fourier transforms and one dense block of angles per
frequency (`q_kernel_spectra`). Equal to the direct sum up to rounding: 1e-15 of the largest value, or
5e-7 in single precision, which moves and multiplies half as many bytes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction.convolution.fft_lengths import FittedSpectra
from ellipsoid_coupling.interaction.convolution.q_kernel_spectra import (
    AngleKernels,
    Quantity,
    distinct_angles,
)
from ellipsoid_coupling.interaction.convolution.spectra import (
    Indices,
    Precision,
    Real,
    Symmetry,
    multiply,
    precision_for,
)
from ellipsoid_coupling.interaction.convolution.transforms import Transforms, in_parts
from ellipsoid_coupling.interaction.grid_forces import Array, check_grid
from ellipsoid_coupling.interaction.occupied import Box, contains, occupied_box, occupied_extents
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
    """The angles that take part, (m,) each: which, and where among them each one's mirror image is."""

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
        # Of three numbers of cells none may be 0.
        check_grid((min(grid_shape[:2]), grid_shape[2]), h)
        self.grid_shape = grid_shape
        self.angles = distinct_angles(grid_shape[0], shape)
        # eps0 h^2 k of the sums above.
        scale = strength * h * h * 2.0 * np.pi / grid_shape[0]
        # Forces are minus the slopes of the potential.
        sign = -1.0 if quantity == "forces" else 1.0
        self._precision: Precision = precision_for(tolerance, h * h, shape.size, strength)
        # The kernels hold the factor of the sum, so that products need no scaling.
        self._kernels = AngleKernels(grid_shape, h, shape, sign * scale, quantity, self._precision)
        self._spectra = FittedSpectra(grid_shape[1:], self._kernels.cells, self._kernels, periods)
        self._transforms = Transforms(self._precision)
        self._integral: Real | None = None
        self._filled: Box | None = None

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
            extents = occupied_extents(density)
        box = occupied_box(extents)
        if box is None:
            return self._emptied(None)
        holding = np.any(extents[..., 1] > 0, axis=1)
        angles = _mirrored_angles(np.any(holding.reshape(-1, self.angles), axis=0))
        # Angles without mass, or its mirror image, are not written: they must be 0 already.
        out = self._emptied(box if angles.which.size == self.angles else None)
        self._filled = box
        self._convolve(density[:, *box], angles, out[:, :, *box])
        return out

    def _emptied(self, box: Box | None) -> Real:
        """The result's memory, 0 all over, but for the `box` of cells that will be overwritten."""
        if self._integral is None:
            shape = self._kernels.odd.size, self.angles, *self.grid_shape[1:]
            self._integral = np.zeros(shape, self._precision)
        elif self._filled is not None and not (box and contains(box, self._filled)):
            # Only what the last call has filled beyond this box: all of it would take as long as
            # the products.
            self._integral[:, :, *self._filled] = 0.0
        self._filled = None
        return self._integral

    def _convolve(self, density: Array, angles: _Angles, out: Real) -> None:
        """Of the rectangle `density` (angles, rows, columns) to `out` (components, n, ...)."""
        _, rows, columns = density.shape
        # The first axis counts half turns: cells a and a + n are one to the potential.
        folds = density.reshape(-1, self.angles, rows, columns)
        blocks, padded = self._spectra.for_cells(rows, columns)
        # All of them are a view of the array.
        which = slice(None) if angles.which.size == self.angles else angles.which

        def sources(part: slice) -> Real:
            # The angle cells that are one to the potential are added up.
            folded: Array = folds[:, which, part].sum(axis=0)
            return folded.astype(self._precision)

        def take(part: slice, fields: Real) -> None:
            # Beyond these columns there is padding, which holds what images do.
            out[:, which, part] = fields[..., :columns]

        transforms = self._transforms
        waves = transforms.forward(angles.which.size, rows, padded, sources)
        product = transforms.product(waves, out.shape[0])
        symmetry = Symmetry(
            angles.mirror,
            np.ones(angles.which.size, blocks.dtype),
            self._kernels.mirrored.astype(blocks.dtype),
            self._kernels.odd == 1,
        )
        in_parts(
            len(blocks),
            product.size,
            lambda *part: multiply(blocks, angles.which, symmetry, waves, product, part),
        )
        transforms.back(product, rows, padded[1], take)


def _mirrored_angles(holding: NDArray[np.bool_]) -> _Angles:
    """The angles with mass and their mirror images; `holding` (n,) tells which."""
    # Angle cell a is mirrored to -a, which `multiply` needs together with a.
    # Element a of what is rolled is holding[-a].
    taking_part = holding | np.roll(holding[::-1], 1)
    which = np.flatnonzero(taking_part)
    among = np.cumsum(taking_part) - 1
    return _Angles(which, among[-which % holding.size])
