"""Transforms as long as the mass needs: spectra for one length of a ladder at a time.

Mass in a part of the grid needs shorter transforms than mass all over it. Each length of the ladder
is some 0.8 of the next longer one, so that about a fifth at most is wasted along an axis, a third
where both directions are put on one rung.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Generic, TypeVar

from scipy import fft

Lengths = tuple[int, int]
Made = TypeVar("Made")

# The last rung is a tenth of the longest.
_STEP, _RUNGS = 0.8, 11


class Ladder(Generic[Made]):
    """Spectra of any kind for the lengths that occupied cells need, made when they are asked for.

    The last two are kept. Which lengths are taken follows from the numbers asked for alone, not
    from what was asked before, so that a resumed run computes the same bits.

    Parameters
    ----------
    cells : (rows, columns)
        Of the whole grid.
    reach : int
        How many cells further images must be away.
    make : ((Py, Px)) -> spectra

    Attributes
    ----------
    longest : (Py, Px)
        Lengths for the whole grid.
    """

    def __init__(self, cells: Lengths, reach: int, make: Callable[[Lengths], Made]) -> None:
        self.longest = padded_length(cells[0], reach), padded_length(cells[1], reach)
        self._reach, self._make = reach, make
        self._made: dict[Lengths, Made] = {}

    def fitting(self, rows: int, columns: int) -> Made:
        """For a rectangle of so many occupied cells."""
        lengths = fitting_lengths((rows + self._reach, columns + self._reach), self.longest)
        spectra = self._made.pop(lengths) if lengths in self._made else self._make(lengths)
        self._made[lengths] = spectra
        if len(self._made) > 2:
            del self._made[next(iter(self._made))]
        return spectra


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
