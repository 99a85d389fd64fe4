"""Spectra for the lengths that are asked for, and the memory that they are kept in."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.interaction.convolution.fft_lengths import FittedSpectra, fitting_lengths
from ellipsoid_coupling.interaction.convolution.spectra import Lengths, Precision, Real

CELLS, REACH = (100, 90), 8


class Numbered:
    """A kernel whose blocks tell which transform they are from."""

    precision: Precision = np.float64

    def __init__(self) -> None:
        self.lengths: list[Lengths] = []

    def block_shape(self, padded: Lengths) -> tuple[int, ...]:
        """Of any kind, the larger the longer the lengths."""
        return padded

    def transform(self, padded: Lengths, blocks: Real) -> None:
        """The number of the transform, from 1 on."""
        self.lengths.append(padded)
        blocks[:] = len(self.lengths)


def test_a_cloud_that_grows_has_one_memory_for_all_spectra() -> None:
    """Each length is made once, in memory that is reserved for the longest and never given back."""
    kernel = Numbered()
    ladder = FittedSpectra(CELLS, REACH, kernel)
    first = ladder.for_cells(1, 1).blocks
    for width in range(1, 91):
        blocks, padded = ladder.for_cells(width, width)
        assert padded == fitting_lengths((width + REACH, width + REACH), ladder.longest)
        assert blocks.shape == padded
        assert np.all(blocks == len(kernel.lengths))
        assert np.shares_memory(blocks, first)
    assert len(set(kernel.lengths)) == len(kernel.lengths)


def test_lengths_that_are_asked_for_by_turns_are_both_kept() -> None:
    """Made again once, when nothing told yet that two are needed; then never."""
    kernel = Numbered()
    ladder = FittedSpectra(CELLS, REACH, kernel)
    for turn in range(5):
        small, large = ladder.for_cells(10, 10), ladder.for_cells(60, 60)
        assert np.shares_memory(small.blocks, large.blocks) == (turn == 0)
    assert len(kernel.lengths) == 3
    assert small.padded == kernel.lengths[0] == kernel.lengths[2]
    assert np.all(small.blocks == 3)
    assert np.all(large.blocks == 2)


def test_of_two_the_one_that_was_asked_for_last_is_kept() -> None:
    """Where two are kept, a third length takes the memory of the one that was not asked for lately."""
    kernel = Numbered()
    ladder = FittedSpectra(CELLS, REACH, kernel)
    for width in (10, 60, 10):
        ladder.for_cells(width, width)
    assert len(kernel.lengths) == 3
    kept = ladder.for_cells(60, 60)
    third = ladder.for_cells(30, 30)
    assert np.all(ladder.for_cells(60, 60).blocks == 2)
    assert len(kernel.lengths) == 4
    assert not np.shares_memory(kept.blocks, third.blocks)
