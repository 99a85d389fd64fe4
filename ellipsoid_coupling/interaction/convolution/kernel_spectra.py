"""The Fourier transforms in space of an angular series: one real block per frequency.

Frequencies lie at 2 pi (ky/Py, kx/Px). Every coefficient K_pq(delta) is odd in delta for the force
and even for the torque, and even or odd under y -> -y by the parities of b_p and b_q. So its
transform is a product of cosines or sines over one quadrant of offsets, and ky >= 0 is enough:

    ky  0 .. Py/2      (ky < 0: the same but for the sign of the blocks odd in y)
    kx  0 .. Px/2, padded with zeros
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import DTypeLike, NDArray

from ellipsoid_coupling.compiled.jit import parallel_kernel, view_kernel
from ellipsoid_coupling.compiled.simd_sums import LINE, sum_rows
from ellipsoid_coupling.interaction.convolution.angular_series import (
    AngularSeries,
    potential_coefficients,
)
from ellipsoid_coupling.interaction.grid_forces import Array

Real = NDArray[np.floating]
Complex = NDArray[np.complexfloating]
Indices = NDArray[np.int64]
Lengths = tuple[int, int]
Precision = type[np.float32] | type[np.float64]

# So many rows of frequencies are summed before they are dealt out: a megabyte at most, in cache.
_KY_AT_ONCE = 16
# Rounding in single precision is some 1e-6 of the kernel's norm: far below these tolerances.
LEAST_SINGLE_TOLERANCE = 1e-4
# Single precision ends at 1e38: products of three such sizes still fit.
_MODERATE = (1e-12, 1e12)


def precision_for(tolerance: float, *sizes: float) -> Precision:
    """Single precision where the tolerance allows it and all `sizes` that enter are moderate."""
    moderate = all(_MODERATE[0] < abs(size) < _MODERATE[1] for size in sizes)
    return np.float32 if tolerance >= LEAST_SINGLE_TOLERANCE and moderate else np.float64


class Parities(NamedTuple):
    """Of the components of a kernel: under y -> -y, 1 or -1; odd in the offset, True or False."""

    mirrored: tuple[int, ...]
    odd: tuple[bool, ...]


# The force's x and y component and the torque; the potential.
FORCES, POTENTIAL = Parities((1, -1, -1), (True, True, False)), Parities((1,), (False,))


def lines_and_lanes(columns: int, precision: DTypeLike) -> tuple[int, int]:
    """How many cache lines hold so many numbers, and how many numbers one of them.

    Blocks are kept in the order in which `sum_products` reads them: all of one line, target after target.
    """
    lanes = LINE // np.dtype(precision).itemsize
    return -(-columns // lanes), lanes


class Spectra(NamedTuple):
    """A transformed kernel: of an angular series, or between the cells of an angle grid.

    Attributes
    ----------
    blocks : (Py//2 + 1, components, lines, n, n, lanes) float32 or float64
        Between n = 2M + 1 basis functions or n angles, without the factor i of the force; axis order
        (ky, component, kx, target, source, kx), see `lines_and_lanes`.
    padded : (Py, Px)
        Lengths of the transforms, even.
    """

    blocks: Real
    padded: Lengths


def basis_parity(functions: int) -> NDArray[np.int64]:
    """Parity of 1, cos 2 theta, sin 2 theta, ... in theta: (functions,) of 1 and -1."""
    index = np.arange(functions)
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
        odd_y = np.multiply.outer(mirrored, np.outer(parity, parity)) < 0
        # What is odd in all is odd in x where even in y; what is even has the same parity in both.
        odd_x = odd_y ^ odd[:, None, None]
        # Where it is odd in both, the product of both sines has the sign -1: the third kind of waves.
        self._waves = np.stack([1 * odd_x, 1 * odd_y + (odd_x & odd_y)], axis=-1)

    def block_shape(self, padded: Lengths) -> tuple[int, ...]:
        """See `Spectra`."""
        components, functions = self._quadrant.shape[:2]
        lines, lanes = lines_and_lanes(padded[1] // 2 + 1, self.precision)
        return padded[0] // 2 + 1, components, lines, functions, functions, lanes

    def transform(self, padded: Lengths, blocks: Real) -> None:
        """Overwrite `blocks` of `block_shape`."""
        y_waves, x_waves = (_waves(self.cells, length, self._factor) for length in padded)
        along = np.zeros((2, self.cells + 1, blocks.shape[2] * blocks.shape[5]), self.precision)
        along[..., : x_waves.shape[2]] = x_waves
        even, odd = self._scale * y_waves.swapaxes(1, 2)
        across: Real = np.array([even, odd, -odd]).astype(self.precision)
        _add_rows(self._quadrant, along, across, self._waves, blocks)


@parallel_kernel
def _add_rows(quadrant: Real, along: Real, across: Real, waves: Indices, blocks: Real) -> None:
    """block[ky, c, p, q] = sum_j across[w, ky, j] sum_i along[v, i, kx] quadrant[c, p, q, j, i].

    (v, w) = waves[c, p, q]; quadrant : (components, F, F, R + 1, R + 1); along : (2, R + 1, kx);
    across : (3, ky, R + 1)
    """
    components, functions, _, cells = quadrant.shape[:4]
    columns, at_once = along.shape[2], min(_KY_AT_ONCE, blocks.shape[0])
    for task in numba.prange(components * functions):
        c, p = task // functions, task % functions
        half = np.empty((functions, cells, columns), blocks.dtype)
        for q in range(functions):
            sum_rows(quadrant[c, p, q], along[waves[c, p, q, 0]], half[q])
        sums = np.empty((functions, at_once, columns), blocks.dtype)
        for first in range(0, blocks.shape[0], at_once):
            end = min(first + at_once, blocks.shape[0])
            for q in range(functions):
                here = across[waves[c, p, q, 1], first:end]
                sum_rows(here, half[q], sums[q, : end - first])
            for ky in range(first, end):
                deal_out(sums[:, ky - first], blocks[ky, c, :, p])


@view_kernel
def deal_out(sums: Real, blocks: Real) -> None:
    """Line by line: of sums (n, lines * lanes) to blocks (lines, n, lanes)."""
    lanes = blocks.shape[2]
    for line in range(blocks.shape[0]):
        for q in range(blocks.shape[1]):
            here, there = sums[q, line * lanes : (line + 1) * lanes], blocks[line, q]
            for k in range(lanes):
                there[k] = here[k]


@view_kernel
def set_parts(up: Complex, down: Complex, sign: float, sources: Real) -> None:
    """Write the four parts of `sum_products`: real and imaginary of ky, and of -ky times `sign`.

    up, down : (kx,); sources : (lines, 4, lanes)
    """
    lanes = sources.shape[2]
    for line in range(sources.shape[0]):
        first, end = line * lanes, min((line + 1) * lanes, up.size)
        plus, minus, parts = up[first:end], down[first:end], sources[line]
        for j in range(plus.size):
            parts[0, j], parts[1, j] = plus[j].real, plus[j].imag
            parts[2, j], parts[3, j] = sign * minus[j].real, sign * minus[j].imag


def _waves(cells: int, length: int, factor: Callable[[int], Array] | None) -> Array:
    """Even and odd sums over -cells .. cells as sums over 0 .. cells: (2, cells + 1, length//2 + 1)."""
    # Whole turns are taken off in integers, so that nothing is lost to rounding.
    turns = np.arange(cells + 1)[:, None] * np.arange(length // 2 + 1) % length
    phase = 2.0 * np.pi * turns / length
    weight = np.full((cells + 1, 1), 2.0)
    weight[0] = 1.0
    weights = weight if factor is None else weight * factor(length)
    return np.array([weights * np.cos(phase), weights * np.sin(phase)])


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
    turned = _turn(coefficients[np.searchsorted(squares, square)], np.arctan2(j, i))
    out: Real = np.zeros((components, functions, functions, cells + 1, cells + 1), precision)
    out[..., j, i] = turned.transpose(1, 2, 3, 0)
    return out


def _turn(blocks: Array, alpha: Array) -> Array:
    """From the frame of the line of centres, at `alpha` (n,), to that of the grid, in place."""
    harmonics = blocks.shape[2] // 2
    double = 2.0 * np.arange(1, harmonics + 1)[:, None] * alpha[:, None, None, None]
    c, s = np.cos(double), np.sin(double)
    for view in (blocks, blocks.swapaxes(2, 3)):
        cosine, sine = view[:, :, 1::2].copy(), view[:, :, 2::2].copy()
        view[:, :, 1::2] = c * cosine - s * sine
        view[:, :, 2::2] = s * cosine + c * sine
    if blocks.shape[1] == 1:
        return blocks
    c, s = np.cos(alpha)[:, None, None], np.sin(alpha)[:, None, None]
    radial, tangential = blocks[:, 0].copy(), blocks[:, 1].copy()
    blocks[:, 0] = c * radial - s * tangential
    blocks[:, 1] = s * radial + c * tangential
    return blocks
