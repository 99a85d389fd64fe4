"""Kernels of a convolution as blocks in Fourier space: how they are laid out, made and multiplied.

A kernel K_pq(delta) between n sources q and n targets p - basis functions of the angle, or angles - is
even or odd in delta, so that its transform is real, or i times real. Under y -> -y function p becomes
parity[p] times function mirror[p], and a component of the kernel keeps or changes its sign:

    K_pq(k_x, -k_y) = sign parity[p] parity[q] K_{mirror p, mirror q}(k_x, k_y)

so that ky >= 0 is enough: one real block (n, n) for each frequency

    ky  0 .. Py/2      kx  0 .. Px/2, padded with zeros to whole cache lines
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import DTypeLike, NDArray

from ellipsoid_coupling.compiled.jit import kernel, parallel_kernel
from ellipsoid_coupling.compiled.simd_sums import sum_products, sum_rows
from ellipsoid_coupling.compiled.simd_vectors import LINE
from ellipsoid_coupling.compiled.tuning import KY_AT_ONCE
from ellipsoid_coupling.interaction.grid_forces import Array

Real = NDArray[np.floating]
Complex = NDArray[np.complexfloating]
Indices = NDArray[np.int64]
Lengths = tuple[int, int]
Precision = type[np.float32] | type[np.float64]

# Rounding in single precision is some 1e-6 of the kernel's norm: far below these tolerances.
LEAST_SINGLE_TOLERANCE = 1e-4
# Single precision ends at 1e38: products of three such sizes still fit.
_MODERATE = (1e-12, 1e12)


def precision_for(tolerance: float, *sizes: float) -> Precision:
    """Single precision where the tolerance allows it and all `sizes` that enter are moderate."""
    moderate = all(_MODERATE[0] < abs(size) < _MODERATE[1] for size in sizes)
    return np.float32 if tolerance >= LEAST_SINGLE_TOLERANCE and moderate else np.float64


class Symmetry(NamedTuple):
    """How sources and components of a kernel behave under reflections.

    Attributes
    ----------
    mirror : (n,) int64
    parity : (n,) of the blocks' precision, 1 or -1
        Under y -> -y function p becomes parity[p] times function mirror[p].
    sign : (components,) of the blocks' precision, 1 or -1
        Of a component under y -> -y.
    odd : (components,) bool
        Whether a component is odd in the offset delta.
    """

    mirror: Indices
    parity: Real
    sign: Real
    odd: NDArray[np.bool_]


class Spectra(NamedTuple):
    """A transformed kernel: of an angular series, or between the cells of an angle grid.

    Attributes
    ----------
    blocks : (Py//2 + 1, components, lines, n, n, lanes) float32 or float64
        Between n = 2M + 1 basis functions or n angles, without the factor i of odd components; axis
        order (ky, component, kx, target, source, kx), see `lines_and_lanes`.
    padded : (Py, Px)
        Lengths of the transforms, even.
    """

    blocks: Real
    padded: Lengths


def lines_and_lanes(columns: int, precision: DTypeLike) -> tuple[int, int]:
    """How many cache lines hold so many numbers, and how many numbers one of them.

    Blocks are kept in the order in which `sum_products` reads them: all of one line, target by target.
    """
    lanes = LINE // np.dtype(precision).itemsize
    return -(-columns // lanes), lanes


def waves(offsets: Indices, frequencies: Indices, length: int) -> Array:
    """Cosine and sine of every offset at every frequency, (2, offsets, frequencies)."""
    # Whole periods are taken off in integers, so that nothing is lost to rounding.
    phase = 2.0 * np.pi * (offsets[:, None] * frequencies % length) / length
    return np.array([np.cos(phase), np.sin(phase)])


@parallel_kernel
def transform_blocks(
    samples: Real, along: Real, across: Real, which: Indices, blocks: Real
) -> None:
    """block[ky, c, p, q, kx] = sum_sj across[w, ky, s j] sum_i along[v + s, i, kx] samples[c, p, q, j, i].

    Parameters
    ----------
    samples : (components, n, n, J, I)
        K at offsets (j, i) of the grid.
    along : (kinds, I, kx)
        Of the samples' precision, like all that is summed.
    across : (kinds, ky, J) or (kinds, ky, 2 J)
        With 2 J, s = 0 and 1: two kinds along x for each kind across, those of s = 0 first.
    which : (components, n, n, 2)
        (v, w), the first kind along and the kind across.
    blocks : as in `Spectra`
        Overwritten.
    """
    components, n, _, rows = samples.shape[:4]
    columns, terms = along.shape[2], across.shape[2]
    at_once = min(KY_AT_ONCE, blocks.shape[0])
    for task in numba.prange(components * n):
        c, p = task // n, task % n
        # First along x, then across: R^2 kx + R kx ky products instead of R^2 kx ky.
        half = np.empty((n, terms, columns), samples.dtype)
        for q in range(n):
            for s in range(terms // rows):
                part = half[q, s * rows : (s + 1) * rows]
                sum_rows(samples[c, p, q], along[which[c, p, q, 0] + s], part)
        # Some ky at a time, so that their sums are in cache when they are interleaved.
        sums = np.empty((n, at_once, columns), samples.dtype)
        for first in range(0, blocks.shape[0], at_once):
            end = min(first + at_once, blocks.shape[0])
            for q in range(n):
                here = across[which[c, p, q, 1], first:end]
                sum_rows(here, half[q], sums[q, : end - first])
            for ky in range(first, end):
                interleave_lanes(sums[:, ky - first], blocks[ky, c, :, p])


@kernel(noalias=True)
def interleave_lanes(sums: Real, blocks: Real) -> None:
    """Sums (n, lines * lanes) in the order of blocks (lines, n, lanes)."""
    lanes = blocks.shape[2]
    for line in range(blocks.shape[0]):
        for q in range(blocks.shape[1]):
            here, there = sums[q, line * lanes : (line + 1) * lanes], blocks[line, q]
            for k in range(lanes):
                there[k] = here[k]


@kernel(noalias=True)
def _set_parts(up: Complex, down: Complex, parity: float, sources: Real) -> None:
    """Write the four parts of `sum_products`: real and imaginary of ky, and of -ky times `parity`.

    up, down : (kx,); sources : (lines, 4, lanes)
    """
    lanes = sources.shape[2]
    for line in range(sources.shape[0]):
        first, end = line * lanes, min((line + 1) * lanes, up.size)
        plus, minus, parts = up[first:end], down[first:end], sources[line]
        for j in range(plus.size):
            parts[0, j], parts[1, j] = plus[j].real, plus[j].imag
            parts[2, j], parts[3, j] = parity * minus[j].real, parity * minus[j].imag


@kernel
def multiply(
    blocks: Real,
    which: Indices,
    symmetry: Symmetry,
    waves: Complex,
    fields: Complex,
    range_of_ky: tuple[int, int],
) -> None:
    """fields[c, p] = sum_q block[c, p, q] waves[q] at ky = first .. end - 1 and -ky, all kx.

    Parameters
    ----------
    blocks : as in `Spectra`
    which : (m,) int64
        The functions of the blocks that take part; all others are 0.
    symmetry : Symmetry
        Of these; `mirror` counts among them.
    waves : (m, Py, Px//2 + 1)
    fields : (components, m, Py, Px//2 + 1)
        Overwritten at these frequencies.
    """
    py = waves.shape[1]
    for ky in range(range_of_ky[0], range_of_ky[1]):
        # 0, and Py/2, are their own opposites.
        minus = (py - ky) % py
        both = waves[:, ky], waves[:, minus]
        _multiply_rows(blocks[ky], which, symmetry, both, fields[:, :, ky], fields[:, :, minus])


@kernel
def _multiply_rows(
    block: Real,
    which: Indices,
    symmetry: Symmetry,
    waves: tuple[Complex, Complex],
    upper: Complex,
    lower: Complex,
) -> None:
    """The frequencies ky and -ky at once, so that each block is read once.

    block : (components, lines, n, n, lanes)
    waves : at ky and at -ky, (m, kx) each
    upper, lower : (components, m, kx), overwritten, at ky and at -ky
    """
    mirror, parity, signs, odd = symmetry
    components, count, n = upper.shape
    lines, lanes = block.shape[1], block.shape[4]
    # Both frequencies' real and imaginary parts beside each other: four sums for each block entry.
    # Zeros: lanes beyond the last frequency are multiplied as well.
    sources = np.zeros((lines, count, 4, lanes), block.dtype)
    for q in range(count):
        _set_parts(waves[0][q], waves[1][mirror[q]], parity[q], sources[:, q])
    sums = np.empty((count, 4, lines * lanes), block.dtype)
    for component in range(components):
        sum_products(block[component], which, sources, sums)
        for p in range(count):
            a, b, c, d = sums[p, 0], sums[p, 1], sums[p, 2], sums[p, 3]
            # Where ky = -ky both are the same row, and the second one stays; they are equal to
            # rounding.
            up, down = upper[component, p], lower[component, mirror[p]]
            # A loop for each of both rows, which may be the same memory.
            sign = signs[component] * parity[p]
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
