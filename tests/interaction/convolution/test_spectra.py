"""Blocks in Fourier space: made and multiplied as plain numpy does it, to rounding."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.interaction.convolution.spectra import (
    Precision,
    Real,
    Symmetry,
    interleave_lanes,
    lines_and_lanes,
    multiply,
    transform_blocks,
    waves,
)

PRECISIONS = pytest.mark.parametrize(
    ("precision", "rounding"), [(np.float32, 2e-6), (np.float64, 4e-15)]
)


def test_waves_of_large_offsets_keep_their_digits() -> None:
    """Multiples of the length are whole periods: taken off before anything is rounded."""
    offsets, frequencies = np.array([0, 3, 3 + 1200 * 10**9]), np.arange(4)
    cosine, sine = waves(offsets, frequencies, 1200)
    np.testing.assert_array_equal(cosine[1], cosine[2])
    np.testing.assert_array_equal(sine[1], sine[2])
    np.testing.assert_allclose(
        cosine[1] + 1j * sine[1], np.exp(2j * np.pi * 3 * frequencies / 1200), atol=1e-15
    )


@PRECISIONS
@pytest.mark.parametrize("stacks", [1, 2])
def test_blocks_are_the_double_sum(precision: Precision, rounding: float, stacks: int) -> None:
    """One kind of waves along x for each kind across, or two; more ky than are summed at once."""
    rng = np.random.default_rng(stacks)
    components, n, rows, offsets, ky, kx = 2, 3, 5, 6, 37, 21
    lines, lanes = lines_and_lanes(kx, precision)
    samples: Real = rng.random((components, n, n, rows, offsets)).astype(precision)
    along: Real = rng.random((3, offsets, lines * lanes)).astype(precision)
    across: Real = rng.random((2, ky, stacks * rows)).astype(precision)
    which = rng.integers(0, 2, (components, n, n, 2))
    blocks = np.empty((ky, components, lines, n, n, lanes), precision)
    transform_blocks(samples, along, across, which, blocks)
    for c, p, q in np.ndindex(components, n, n):
        v, w = which[c, p, q]
        half = np.concatenate([samples[c, p, q] @ along[v + s] for s in range(stacks)])
        expected = across[w] @ half
        found = blocks[:, c, :, p, q].reshape(ky, -1)
        np.testing.assert_allclose(found, expected, rtol=stacks * rounding)


def test_lanes_are_interleaved_line_by_line() -> None:
    sums = np.arange(3 * 16.0).reshape(3, 16)
    blocks = np.empty((2, 3, 8))
    interleave_lanes(sums, blocks)
    np.testing.assert_array_equal(blocks, sums.reshape(3, 2, 8).transpose(1, 0, 2))


@PRECISIONS
def test_products_are_those_of_matrices_with_the_mirrored_ones(
    precision: Precision, rounding: float
) -> None:
    """Both halves of ky against K(-ky) = sign parity_p parity_q K_{mirror p, mirror q}(ky).

    Functions 1 and 3 are each other's mirror images, 2 changes its sign; 4 does not take part.
    """
    rng = np.random.default_rng(1)
    py, px, n, which = 6, 10, 5, np.array([0, 1, 2, 3])
    mirror, odd = np.array([0, 3, 2, 1]), np.array([False, True])
    parity: Real = np.array([1.0, 1.0, -1.0, 1.0], precision)
    sign: Real = np.array([1.0, -1.0], precision)
    kx = px // 2 + 1
    lines, lanes = lines_and_lanes(kx, precision)
    blocks: Real = rng.standard_normal((py // 2 + 1, 2, lines, n, n, lanes)).astype(precision)
    complex_type = np.result_type(precision, np.complex64)
    transforms = rng.standard_normal((4, py, kx)) + 1j * rng.standard_normal((4, py, kx))
    transforms = transforms.astype(complex_type)
    fields = np.empty((2, 4, py, kx), complex_type)
    multiply(blocks, which, Symmetry(mirror, parity, sign, odd), transforms, fields, (0, 4))
    plain = blocks[:, :, :, :4, :4].transpose(0, 1, 3, 4, 2, 5).reshape(4, 2, 4, 4, -1)[..., :kx]
    for c, ky in np.ndindex(2, py):
        block = plain[min(ky, py - ky), c].astype(np.float64)
        if ky > py // 2:
            block = (
                sign[c] * np.multiply.outer(parity, parity)[..., None] * block[mirror][:, mirror]
            )
        # Frequencies that are their own mirror images have one value only for symmetric data.
        if ky in (0, py // 2):
            continue
        expected = np.einsum("pqk,qk->pk", block, transforms[:, ky]) * (1j if odd[c] else 1.0)
        np.testing.assert_allclose(fields[c, :, ky], expected, atol=10 * rounding)
