"""Transform lengths that fit the cells with mass, and a kernel's spectra for them.

Mass in a part of the grid needs shorter transforms than mass all over it. Lengths are taken from a fixed
series, each some 0.8 of the next longer one, so that about a fifth at most is wasted along an axis, a
third where both directions take one step of the series.
"""

from __future__ import annotations

import math
from typing import Protocol

from scipy import fft

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.interaction.convolution.spectra import Lengths, Precision, Real, Spectra

# The series ends at a tenth of the longest length.
_RATIO, _LENGTHS = 0.8, 11


class Transformable(Protocol):
    """A kernel that can be transformed to any even lengths, (Py, Px)."""

    @property
    def precision(self) -> Precision:
        """Of its blocks."""

    def block_shape(self, padded: Lengths) -> tuple[int, ...]:
        """See `Spectra`."""

    def transform(self, padded: Lengths, blocks: Real) -> None:
        """Overwrite `blocks` of this shape."""


class FittedSpectra:
    """Spectra of a kernel for the lengths that occupied cells need, made when they are asked for.

    The last spectra are kept; their memory goes to the next ones, since new memory takes longer than the
    transform. A growing cloud passes each length once. Where a length is asked for again, as by a
    cloud whose edge moves to and fro, the last two are kept. Lengths follow from the numbers asked for
    alone, not from what was asked before, so that a resumed run computes the same bits.

    Parameters
    ----------
    cells : (rows, columns)
        Of the whole grid.
    reach : int
        How many cells further images must be away.
    kernel : Transformable
    periods : (bool, bool)
        Whether y and x are periodic. There the length is that of the grid, an even number of cells,
        and images are what is wanted.

    Attributes
    ----------
    longest : (Py, Px)
        Lengths for the whole grid.
    """

    def __init__(
        self,
        cells: Lengths,
        reach: int,
        kernel: Transformable,
        periods: tuple[bool, bool] = (False, False),
    ) -> None:
        self._periods = periods
        self.longest = self._closed(longest_lengths(cells, reach), cells)
        self._reach, self._kernel = reach, kernel
        # The one that was asked for last is the last one.
        self._stored: dict[Lengths, tuple[Spectra, BufferPool]] = {}
        self._made: set[Lengths] = set()

    def for_cells(self, rows: int, columns: int) -> Spectra:
        """For a rectangle of occupied cells; later calls may overwrite the spectra."""
        needed = rows + self._reach, columns + self._reach
        lengths = self._closed(fitting_lengths(needed, self.longest), self.longest)
        stored = self._stored.pop(lengths) if lengths in self._stored else self._make(lengths)
        self._stored[lengths] = stored
        return stored[0]

    def _closed(self, lengths: Lengths, periods: Lengths) -> Lengths:
        """These lengths, but for the periods along periodic axes."""
        y, x = (
            p if closed else n for n, p, closed in zip(lengths, periods, self._periods, strict=True)
        )
        return y, x

    def _make(self, lengths: Lengths) -> tuple[Spectra, BufferPool]:
        again = lengths in self._made
        self._made.add(lengths)
        # Two are stored only once a length is asked for again: spectra are the largest arrays of a
        # run.
        full = len(self._stored) == 2 or (len(self._stored) == 1 and not again)
        pool = self._stored.pop(next(iter(self._stored)))[1] if full else BufferPool()
        kernel = self._kernel
        # Memory for the longest: pages that are not written to cost nothing.
        pool.array("blocks", kernel.block_shape(self.longest), kernel.precision)
        blocks = pool.array("blocks", kernel.block_shape(lengths), kernel.precision)
        kernel.transform(lengths, blocks)
        return Spectra(blocks, lengths), pool


def longest_lengths(cells: Lengths, reach: int) -> Lengths:
    """For all of a grid of (rows, columns)."""
    return padded_length(cells[0], reach), padded_length(cells[1], reach)


def padded_length(cells: int, reach: int) -> int:
    """A fast even transform length in which `cells` do not feel their own images."""
    return 2 * fft.next_fast_len(-(-(cells + reach) // 2), real=True)


def fitting_lengths(needed: Lengths, longest: Lengths) -> Lengths:
    """The shortest fast even lengths, `_RATIO**k` of the longest ones, that hold what is needed.

    Where k differs by one between both directions, both take the smaller k, so that a cloud that grows
    alike in both passes each k once.
    """
    steps = [_step(least, most) for least, most in zip(needed, longest, strict=True)]
    # A cloud grows by a cell in x before it does in y: without this each step would make new
    # spectra.
    if abs(steps[0] - steps[1]) <= 1:
        steps = [min(steps)] * 2
    return _length(steps[0], longest[0]), _length(steps[1], longest[1])


def _length(step: int, longest: int) -> int:
    if step == 0:
        return longest
    return 2 * fft.next_fast_len(math.ceil(longest * _RATIO**step / 2), real=True)


def _step(needed: int, longest: int) -> int:
    """The largest k whose length holds `needed`."""
    step = 0
    while step + 1 < _LENGTHS and _length(step + 1, longest) >= needed:
        step += 1
    return step
