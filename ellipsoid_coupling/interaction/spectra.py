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

from ellipsoid_coupling.interaction.angular import AngularSeries, potential_coefficients
from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.interaction.ladder import Lengths
from ellipsoid_coupling.kernels import parallel_kernel, view_kernel
from ellipsoid_coupling.registers import LINE

Real = NDArray[np.floating]
Complex = NDArray[np.complexfloating]
Indices = NDArray[np.int64]
Precision = type[np.float32] | type[np.float64]

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
    """The transformed kernel.

    Attributes
    ----------
    blocks : (Py//2 + 1, components, lines, 2M + 1, 2M + 1, lanes) float32 or float64
        -eps0 h^2 times the transform of forces, without their factor i, eps0 h^2 times that of the
        potential; axis order (ky, component, kx, p, q, kx), see `lines_and_lanes`.
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

    Parameters
    ----------
    series : AngularSeries
    strength : float
        eps0.
    precision : np.float32 or np.float64
    parities : Parities
        `FORCES` for force and torque, `POTENTIAL` for the potential that they are slopes of.

    Attributes
    ----------
    cells : int
        Reach of the potential in cells.
    """

    def __init__(
        self,
        series: AngularSeries,
        strength: float,
        precision: Precision,
        parities: Parities = FORCES,
    ) -> None:
        forces = parities == FORCES
        coefficients = series.coefficients if forces else potential_coefficients(series)
        self._quadrant = _quadrant(series.squares, coefficients, precision)
        self._parities = parities
        self._scale = (-strength if forces else strength) * series.h**2
        self.cells = self._quadrant.shape[4] - 1

    def transform(self, padded: Lengths, factor: Callable[[int], Array] | None = None) -> Spectra:
        """Its spectra for transforms of these lengths.

        factor : (length) -> (length//2 + 1,), optional
            Multiplies all frequencies along either direction.
        """
        y_waves, x_waves = (_waves(self.cells, length, factor) for length in padded)
        components, functions = self._quadrant.shape[:2]
        parity = basis_parity(functions)
        mirrored = self._parities.mirrored[:components]
        odd_y = np.multiply.outer(mirrored, np.outer(parity, parity)) < 0
        # What is odd in all is odd in x where even in y; what is even has the same parity in both.
        odd_x = odd_y ^ np.array(self._parities.odd[:components])[:, None, None]
        along_x = [self._quadrant @ waves.astype(self._quadrant.dtype) for waves in x_waves]
        half = np.where(odd_x[..., None, None], along_x[1], along_x[0])
        half[odd_x & odd_y] *= -1.0
        lines, lanes = lines_and_lanes(half.shape[-1], half.dtype)
        shape = y_waves[0].shape[1], components, lines, functions, functions, lanes
        blocks: Real = np.empty(shape, half.dtype)
        _add_rows(half, (self._scale * np.array(y_waves)).astype(half.dtype), odd_y, blocks)
        return Spectra(blocks, padded)


@parallel_kernel
def _add_rows(half: Real, waves: Real, odd: NDArray[np.bool_], blocks: Real) -> None:
    """block[ky, c, p, q] = sum_j waves[odd[c, p, q], j, ky] half[c, p, q, j].

    half : (components, F, F, R + 1, kx); waves : (2, R + 1, ky)
    """
    components, functions = odd.shape[:2]
    padded = blocks.shape[2] * blocks.shape[5]
    for task in numba.prange(components * functions):
        c, p = task // functions, task % functions
        total = np.zeros(padded, blocks.dtype)
        for ky in range(blocks.shape[0]):
            for q in range(functions):
                rows = half[c, p, q]
                _add_up(rows, waves[1 if odd[c, p, q] else 0, :, ky], total[: rows.shape[1]])
                in_lines(total, blocks[ky, c, :, p, q])


@view_kernel
def _add_up(rows: Real, weights: Real, total: Real) -> None:
    """Set total to sum_j weights[j] rows[j], four rows at a time: it is read and written less often."""
    total[:] = 0.0
    whole = rows.shape[0] - rows.shape[0] % 4
    for j in range(0, whole, 4):
        u, v, w, x = weights[j], weights[j + 1], weights[j + 2], weights[j + 3]
        a, b, c, d = rows[j], rows[j + 1], rows[j + 2], rows[j + 3]
        for k in range(total.size):
            total[k] += (u * a[k] + v * b[k]) + (w * c[k] + x * d[k])
    for j in range(whole, rows.shape[0]):
        weight, row = weights[j], rows[j]
        for k in range(total.size):
            total[k] += weight * row[k]


@view_kernel
def in_lines(row: Array, lines: Real) -> None:
    """Deal out a row (lines * lanes,) to (lines, lanes)."""
    lanes = lines.shape[1]
    for line in range(lines.shape[0]):
        here, there = row[line * lanes : (line + 1) * lanes], lines[line]
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


def _waves(cells: int, length: int, factor: Callable[[int], Array] | None) -> tuple[Array, Array]:
    """Even and odd sums over -cells .. cells as sums over 0 .. cells: (cells + 1, length//2 + 1)."""
    # Whole turns are taken off in integers, so that nothing is lost to rounding.
    turns = np.arange(cells + 1)[:, None] * np.arange(length // 2 + 1) % length
    phase = 2.0 * np.pi * turns / length
    weight = np.full((cells + 1, 1), 2.0)
    weight[0] = 1.0
    weights = weight if factor is None else weight * factor(length)
    return weights * np.cos(phase), weights * np.sin(phase)


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
