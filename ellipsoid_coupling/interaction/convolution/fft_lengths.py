"""Transforms as long as the mass needs: spectra for one length of a ladder at a time.

Mass in a part of the grid needs shorter transforms than mass all over it. Each length of the ladder
is some 0.8 of the next longer one, so that about a fifth at most is wasted along an axis, a third
where both directions are put on one rung.
"""

from __future__ import annotations

import math
from typing import Protocol

from scipy import fft

from ellipsoid_coupling.compiled.buffers import KeptArrays
from ellipsoid_coupling.interaction.convolution.kernel_spectra import (
    Lengths,
    Precision,
    Real,
    Spectra,
)

# The last rung is a tenth of the longest.
_STEP, _RUNGS = 0.8, 11


class Transformable(Protocol):
    """A kernel that can be transformed to any even lengths, (Py, Px)."""

    @property
    def precision(self) -> Precision:
        """Of its blocks."""

    def block_shape(self, padded: Lengths) -> tuple[int, ...]:
        """See `Spectra`."""

    def transform(self, padded: Lengths, blocks: Real) -> None:
        """Overwrite `blocks` of this shape."""


class Ladder:
    """Spectra of a kernel for the lengths that occupied cells need, made when they are asked for.

    The last one is kept, and its memory for the next: new memory takes longer than the transform. A
    cloud that grows passes each length once; where lengths are asked for again, as by one whose edge
    wavers, the last two are kept. Which lengths are taken follows from the numbers asked for alone,
    not from what was asked before, so that a resumed run computes the same bits.

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
        self._kept: dict[Lengths, tuple[Spectra, KeptArrays]] = {}
        self._made: set[Lengths] = set()

    def fitting(self, rows: int, columns: int) -> Spectra:
        """For a rectangle of so many occupied cells; the next other one may overwrite them."""
        needed = rows + self._reach, columns + self._reach
        lengths = self._closed(fitting_lengths(needed, self.longest), self.longest)
        kept = self._kept.pop(lengths) if lengths in self._kept else self._make(lengths)
        self._kept[lengths] = kept
        return kept[0]

    def _closed(self, lengths: Lengths, periods: Lengths) -> Lengths:
        """These lengths, but for the periods along periodic axes."""
        y, x = (
            p if closed else n for n, p, closed in zip(lengths, periods, self._periods, strict=True)
        )
        return y, x

    def _make(self, lengths: Lengths) -> tuple[Spectra, KeptArrays]:
        again = lengths in self._made
        self._made.add(lengths)
        full = len(self._kept) == 2 or (len(self._kept) == 1 and not again)
        room = self._kept.pop(next(iter(self._kept)))[1] if full else KeptArrays()
        kernel = self._kernel
        # Memory for the longest: what is not written to costs nothing.
        room.array("blocks", kernel.block_shape(self.longest), kernel.precision)
        blocks = room.array("blocks", kernel.block_shape(lengths), kernel.precision)
        kernel.transform(lengths, blocks)
        return Spectra(blocks, lengths), room


def longest_lengths(cells: Lengths, reach: int) -> Lengths:
    """For all of a grid of (rows, columns)."""
    return padded_length(cells[0], reach), padded_length(cells[1], reach)


def padded_length(cells: int, reach: int) -> int:
    """A fast even transform length in which `cells` do not feel their own images."""
    return 2 * fft.next_fast_len(-(-(cells + reach) // 2), real=True)


def fitting_lengths(needed: Lengths, longest: Lengths) -> Lengths:
    """The shortest fast even lengths, `_STEP**rung` of the longest ones, that hold what is needed.

    Rungs of both directions that are next to each other become one, so that a cloud that grows
    alike in both passes each rung once.
    """
    rungs = [_rung(least, most) for least, most in zip(needed, longest, strict=True)]
    if abs(rungs[0] - rungs[1]) <= 1:
        rungs = [min(rungs)] * 2
    return _length(rungs[0], longest[0]), _length(rungs[1], longest[1])


def _length(rung: int, longest: int) -> int:
    if rung == 0:
        return longest
    return 2 * fft.next_fast_len(math.ceil(longest * _STEP**rung / 2), real=True)


def _rung(needed: int, longest: int) -> int:
    """The last one whose length still holds what is needed."""
    rung = 0
    while rung + 1 < _RUNGS and _length(rung + 1, longest) >= needed:
        rung += 1
    return rung
