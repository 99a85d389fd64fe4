"""The Fourier transforms in space of an angular series: one real block per frequency.

Frequencies lie at 2 pi (ky/Py, kx/Px). Every coefficient K_pq(delta) is odd in delta for the force
and even for the torque, and even or odd under y -> -y by the parities of b_p and b_q. So its
transform is a product of cosines or sines over one quadrant of offsets, and ky >= 0 is enough:

    ky  0 .. Py/2                 (ky < 0: the same but for the sign of the blocks odd in y)
    kx  0 .. Px/2, ordered as multiples of 4, other even ones, odd ones; padded with zeros

Taking every second or fourth frequency gives the transform of the grid half or a quarter as
large; in this order those are the first ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ellipsoid_coupling.interaction.angular import AngularSeries
from ellipsoid_coupling.interaction.grid_forces import Array
from ellipsoid_coupling.kernels import kernel

Real = NDArray[np.floating]
Indices = NDArray[np.int64]
Precision = type[np.float32] | type[np.float64]

# Rows of blocks are padded to a multiple of this, so that no loop over them ends in single steps.
LANES = 16

# Coarsest first: the grid of frequencies can be thinned by these factors.
STRIDES = (4, 2, 1)

# Rounding in single precision is some 1e-6 of the kernel's norm: far below these tolerances.
LEAST_SINGLE_TOLERANCE = 1e-4
# Single precision ends at 1e38: products of three such sizes still fit.
_MODERATE = (1e-12, 1e12)


def precision_for(tolerance: float, *sizes: float) -> Precision:
    """Single precision where the tolerance allows it and all `sizes` that enter are moderate."""
    moderate = all(_MODERATE[0] < abs(size) < _MODERATE[1] for size in sizes)
    return np.float32 if tolerance >= LEAST_SINGLE_TOLERANCE and moderate else np.float64


# Parity under y -> -y of the force's x and y component and of the torque.
COMPONENT_PARITY = (1, -1, -1)


class Spectra(NamedTuple):
    """The transformed kernel.

    Attributes
    ----------
    blocks : (Py//2 + 1, components, 2M + 1, 2M + 1, padded Px//2 + 1) float32 or float64
        -eps0 h^2 times the transform, without the factor i of the force's components; axis order
        (ky, component, p, q, kx).
    padded : (Py, Px)
        Lengths of the transforms, multiples of 4.
    cells : int
        Reach of the potential in cells.
    order : (Px//2 + 1,) int64
        kx of the last axis.
    """

    blocks: Real
    padded: tuple[int, int]
    cells: int
    order: Indices


def padded_length(cells: int, reach: int) -> int:
    """A fast transform length, a multiple of 4, in which `cells` do not feel their own images."""
    return 4 * fft.next_fast_len(-(-(cells + reach) // 4), real=True)


def stride(length: int, cells: int, reach: int) -> int:
    """How far the frequencies of `length` can be thinned out where only `cells` are occupied."""
    return next(factor for factor in STRIDES if length // factor >= min(cells + reach, length))


def basis_parity(functions: int) -> NDArray[np.int64]:
    """Parity of 1, cos 2 theta, sin 2 theta, ... in theta: (functions,) of 1 and -1."""
    index = np.arange(functions)
    return np.where((index > 0) & (index % 2 == 0), -1, 1)


def transform(
    series: AngularSeries, grid_shape: tuple[int, int], strength: float, precision: Precision
) -> Spectra:
    """The spectra of `series` for fields of `grid_shape` (ny, nx), in float32 or float64."""
    quadrant = _quadrant(series, precision)
    rows, components, functions, _, cells = *quadrant.shape[:4], quadrant.shape[4] - 1
    padded = padded_length(grid_shape[0], cells), padded_length(grid_shape[1], cells)
    kx = np.arange(padded[1] // 2 + 1)
    order = np.concatenate([kx[0::4], kx[2::4], kx[1::2]])
    x_waves = _waves(cells, order, padded[1], precision)
    y_waves = _waves(cells, np.arange(padded[0] // 2 + 1), padded[0], precision)
    shape = padded[0] // 2 + 1, components, functions, functions, -(-kx.size // LANES) * LANES
    blocks: Real = np.zeros(shape, dtype=precision)
    parity = basis_parity(functions)
    scale = precision(-strength * series.h**2)
    for component in range(components):
        even = parity[:, None] * parity * COMPONENT_PARITY[component] > 0
        for in_y, chosen in enumerate((even, ~even)):
            # A force is odd in all, so odd in x where even in y; a torque has the same parity.
            in_x = in_y if component == 2 else 1 - in_y
            part = quadrant[:, component, chosen]
            half = part.reshape(-1, cells + 1) @ x_waves[in_x]
            whole = (scale * y_waves[in_y].T) @ half.reshape(rows, -1)
            if in_x and in_y:
                np.negative(whole, out=whole)
            blocks[:, component, chosen, : kx.size] = whole.reshape(len(whole), -1, kx.size)
    return Spectra(blocks, padded, cells, order)


def _waves(cells: int, frequency: Indices, length: int, precision: Precision) -> tuple[Real, Real]:
    """Even and odd sums over -cells .. cells as sums over 0 .. cells: (cells + 1, frequencies)."""
    # Whole turns are taken off in integers, so that single precision loses nothing.
    turns = np.arange(cells + 1)[:, None] * frequency % length
    phase = 2.0 * np.pi * turns / length
    weight = np.full((cells + 1, 1), 2.0)
    weight[0] = 1.0
    return (weight * np.cos(phase)).astype(precision), (weight * np.sin(phase)).astype(precision)


def _quadrant(series: AngularSeries, precision: Precision) -> Real:
    """K_pq at the offsets (j, i) >= 0 of the grid: (R + 1, components, 2M + 1, 2M + 1, R + 1).

    Axis order (j along y, component, p, q, i along x); components force x, force y(, torque).
    """
    components, functions = series.coefficients.shape[1:3]
    cells = int(np.sqrt(series.squares[-1]))
    j, i = np.mgrid[: cells + 1, : cells + 1]
    square = j**2 + i**2
    inside = square <= series.squares[-1]
    j, i, square = j[inside], i[inside], square[inside]
    turned = _turn(series.coefficients[np.searchsorted(series.squares, square)], np.arctan2(j, i))
    out: Real = np.zeros((cells + 1, components, functions, functions, cells + 1), dtype=precision)
    out[j, :, :, :, i] = turned
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
    c, s = np.cos(alpha)[:, None, None], np.sin(alpha)[:, None, None]
    radial, tangential = blocks[:, 0].copy(), blocks[:, 1].copy()
    blocks[:, 0] = c * radial - s * tangential
    blocks[:, 1] = s * radial + c * tangential
    return blocks


@kernel
def sum_products(factors: Real, which: Indices, sources: Real, sums: Real) -> None:
    """sums[part] = sum_b factors[which[b]] sources[b, part], at all frequencies of a row.

    Parameters
    ----------
    factors : (functions, padded kx) float64 or float32
    which : (m,) int64
    sources : (m, 4, kx)
        Four parts: real and imaginary, of ky and of -ky.
    sums : (4, kx)
        Overwritten.
    """
    sums[:] = 0.0
    n = sums.shape[1]
    a, b, c, d = sums[0], sums[1], sums[2], sums[3]
    for k in range(which.size):
        # One loop reads every factor once for all four parts.
        factor = factors[which[k], :n]
        e, f, g, h = sources[k, 0], sources[k, 1], sources[k, 2], sources[k, 3]
        for j in range(n):
            a[j] += factor[j] * e[j]
            b[j] += factor[j] * f[j]
            c[j] += factor[j] * g[j]
            d[j] += factor[j] * h[j]
