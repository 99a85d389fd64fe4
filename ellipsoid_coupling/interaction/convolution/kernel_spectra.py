"""The kernel of an angular series at the offsets of a grid, to be transformed to any length.

Every coefficient K_pq(delta) is odd in delta for the force and even for the torque, and even or odd
under y -> -y by the parities of b_p and b_q. So its transform is a product of cosines or sines over one
quadrant of offsets:

    odd in      x, y                     none        x           y           both
    transform   sum over j, i >= 0 of    cos cos     i cos sin   i sin cos   -sin sin    times K(j, i)

and ky >= 0 is enough (`spectra`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.interaction.convolution.angular_series import (
    AngularSeries,
    potential_coefficients,
)
from ellipsoid_coupling.interaction.convolution.spectra import (
    Indices,
    Lengths,
    Precision,
    Real,
    lines_and_lanes,
    transform_blocks,
    waves,
)
from ellipsoid_coupling.interaction.grid_forces import Array


class Parities(NamedTuple):
    """Of the components of a kernel: under y -> -y, 1 or -1; odd in the offset, True or False."""

    mirrored: tuple[int, ...]
    odd: tuple[bool, ...]


# Kinds of waves along x, and across.
_COSINE, _SINE, _MINUS_SINE = range(3)
# The force's x and y component and the torque; the potential.
FORCES, POTENTIAL = Parities((1, -1, -1), (True, True, False)), Parities((1,), (False,))


def basis_parity(functions: int) -> NDArray[np.int64]:
    """Parity of 1, cos 2 theta, sin 2 theta, ... in theta: (functions,) of 1 and -1."""
    index = np.arange(functions)
    # Sines stand at even indices from 2 on.
    return np.where((index > 0) & (index % 2 == 0), -1, 1)


class AngularKernel:
    """The kernel of `series` at the offsets of its grid, to be transformed to any length.

    Its blocks are -eps0 h^2 times the transform of forces, eps0 h^2 times that of the potential.

    Parameters
    ----------
    series : AngularSeries
    strength : float
        eps0.
    precision : np.float32 or np.float64
    parities : Parities
        `FORCES` for force and torque, `POTENTIAL` for the potential that they are slopes of.
    factor : (length) -> (length//2 + 1,), optional
        Multiplies all frequencies along either direction.

    Attributes
    ----------
    cells : int
        Reach of the potential in cells.
    precision
    """

    def __init__(
        self,
        series: AngularSeries,
        strength: float,
        precision: Precision,
        parities: Parities = FORCES,
        factor: Callable[[int], Array] | None = None,
    ) -> None:
        forces = parities == FORCES
        coefficients = series.coefficients if forces else potential_coefficients(series)
        self._quadrant = _quadrant(series.squares, coefficients, precision)
        self._scale = (-strength if forces else strength) * series.h**2
        self._factor, self.precision = factor, precision
        self.cells = self._quadrant.shape[4] - 1
        components, functions = self._quadrant.shape[:2]
        parity = basis_parity(functions)
        mirrored, odd = (np.array(kind[:components]) for kind in parities)
        # A component's sign under y -> -y times those of both basis functions.
        odd_y = np.multiply.outer(mirrored, np.outer(parity, parity)) < 0
        # A kernel odd in delta is odd in x where it is even in y; an even one has one parity in both.
        odd_x = odd_y ^ odd[:, None, None]
        # Cosines or sines along x; of the kinds across, that of the product of both sines is negative.
        across = np.where(odd_y, np.where(odd_x, _MINUS_SINE, _SINE), _COSINE)
        self._which = np.stack([np.where(odd_x, _SINE, _COSINE), across], axis=-1)

    def block_shape(self, padded: Lengths) -> tuple[int, ...]:
        """See `Spectra`."""
        components, functions = self._quadrant.shape[:2]
        lines, lanes = lines_and_lanes(padded[1] // 2 + 1, self.precision)
        return padded[0] // 2 + 1, components, lines, functions, functions, lanes

    def transform(self, padded: Lengths, blocks: Real) -> None:
        """Overwrite `blocks` of `block_shape`."""
        y_waves, x_waves = (self._weighted_waves(length) for length in padded)
        along = np.zeros((2, self.cells + 1, blocks.shape[2] * blocks.shape[5]), self.precision)
        # Frequencies beyond Px/2 fill the last cache line and stay 0.
        along[..., : x_waves.shape[2]] = x_waves
        even, odd = self._scale * y_waves.swapaxes(1, 2)
        across: Real = np.array([even, odd, -odd]).astype(self.precision)
        transform_blocks(self._quadrant, along, across, self._which, blocks)

    def _weighted_waves(self, length: int) -> Array:
        """Even and odd sums over -cells .. cells as sums over 0 .. cells: (2, cells + 1, length//2 + 1)."""
        weight = np.full((self.cells + 1, 1), 2.0)
        weight[0] = 1.0
        weights = weight if self._factor is None else weight * self._factor(length)
        offsets, frequencies = np.arange(self.cells + 1), np.arange(length // 2 + 1)
        return np.asarray(weights * waves(offsets, frequencies, length))


def _quadrant(squares: Indices, coefficients: Array, precision: Precision) -> Real:
    """K_pq at the offsets (j, i) >= 0 of the grid: (components, 2M + 1, 2M + 1, R + 1, R + 1).

    Axis order (component, p, q, j along y, i along x); two components or more are a force x, y.
    """
    components, functions = coefficients.shape[1:3]
    cells = int(np.sqrt(squares[-1]))
    j, i = np.mgrid[: cells + 1, : cells + 1]
    square = j**2 + i**2
    inside = square <= squares[-1]
    j, i, square = j[inside], i[inside], square[inside]
    # One expansion a distance, turned to the direction of each offset.
    turned = _turn(coefficients[np.searchsorted(squares, square)], np.arctan2(j, i))
    out: Real = np.zeros((components, functions, functions, cells + 1, cells + 1), precision)
    out[..., j, i] = turned.transpose(1, 2, 3, 0)
    return out


def _turn(blocks: Array, alpha: Array) -> Array:
    """From the frame of the line of centres, at `alpha` (n,), to that of the grid, in place."""
    harmonics = blocks.shape[2] // 2
    double = 2.0 * np.arange(1, harmonics + 1)[:, None] * alpha[:, None, None, None]
    c, s = np.cos(double), np.sin(double)
    # b_p(theta + alpha): a rotation of each pair cos, sin, in either angle.
    # The second view has the functions of thetabar where the first one has those of theta.
    for view in (blocks, blocks.swapaxes(2, 3)):
        cosine, sine = view[:, :, 1::2].copy(), view[:, :, 2::2].copy()
        view[:, :, 1::2] = c * cosine - s * sine
        view[:, :, 2::2] = s * cosine + c * sine
    if blocks.shape[1] == 1:
        return blocks
    c, s = np.cos(alpha)[:, None, None], np.sin(alpha)[:, None, None]
    # Radial and tangential slope to those along x and y.
    radial, tangential = blocks[:, 0].copy(), blocks[:, 1].copy()
    blocks[:, 0] = c * radial - s * tangential
    blocks[:, 1] = s * radial + c * tangential
    return blocks
