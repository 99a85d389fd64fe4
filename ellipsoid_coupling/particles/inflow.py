"""How much comes in through the pieces of inlets, and when: fluxes that are linear between given times.

    m_p(t) = max(f_p(t), 0),        R(t) = sum_p m_p(t),        M(t) = int_0^t R

f_p is the flux into the fluid through piece p. R is linear between the times at which f is given and those
at which some f_p changes its sign. So M is known in closed form, and so is the time by which a given mass
has come in: births follow from it by inversion, and none is drawn in vain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

# Fluxes that are looked at a time.
_AT_ONCE = 2_000_000
_TINY = np.finfo(np.float64).tiny


class Inflow:
    """See the module.

    Parameters
    ----------
    flux : (F, P) float64
        Through P pieces, mass per time, of F fields of the fluid.
    times : (n,) float64
        Ascending; the first one is 0 or before.
    which : (n,) int64
        The field of each of them.
    end : float
        How far time goes, to the last of `times` at most.

    Attributes
    ----------
    mass : float
        That comes in from 0 to `end`.
    """

    def __init__(self, flux: Floats, times: Floats, which: Indices, end: float) -> None:
        self._flux, self._times, self._which = flux, times, which
        inner = np.concatenate((times, self._turning_times()))
        inner = inner[(inner > 0.0) & (inner < end)]
        self._knots = np.unique(np.concatenate(([0.0, end], inner)))
        self._rate = self._by_parts(self._knots, lambda fluxes, _: fluxes.sum(axis=1))
        # The trapezoidal rule is exact: R is linear between knots.
        steps = 0.5 * np.diff(self._knots) * (self._rate[:-1] + self._rate[1:])
        self._mass = np.concatenate(([0.0], np.cumsum(steps)))
        self.mass = float(self._mass[-1])

    def _turning_times(self) -> Floats:
        """When the flux through some piece changes its sign."""
        found = [np.empty(0)]
        for start, stop, i, j in zip(
            self._times, self._times[1:], self._which, self._which[1:], strict=False
        ):
            first, last = self._flux[i], self._flux[j]
            turns = (first < 0.0) != (last < 0.0)
            # One is negative and the other is not: their difference is never 0.
            part = first[turns] / (first[turns] - last[turns])
            found.append(start + part * (stop - start))
        return np.concatenate(found)

    def place_in_time(self, t: Floats) -> tuple[Indices, Floats]:
        """The interval that each time (n,) lies in, and the part of it that has passed."""
        number = np.searchsorted(self._times, t, side="right") - 1
        # The last time belongs to the interval before it.
        number = np.clip(number, 0, len(self._times) - 2)
        start, stop = self._times[number], self._times[number + 1]
        return number, np.clip((t - start) / (stop - start), 0.0, 1.0)

    def weights(self, t: Floats, field: int) -> Floats:
        """The part (n,) that a field has in the fluid at times t (n,)."""
        number, part = self.place_in_time(t)
        first, last = self._which[number] == field, self._which[number + 1] == field
        # A field that is given at both ends of an interval is all of the fluid there.
        return np.where(first & last, 1.0, np.where(first, 1.0 - part, 0.0) + last * part)

    def _by_parts(self, t: Floats, work: Callable[[Floats, slice], Floats]) -> Floats:
        """`work` of the fluxes into the fluid (some, P) at some of the times t (n,), all together."""
        # Fluxes of all pieces at all times at once could fill the memory.
        out, step = np.empty(t.size), max(1, _AT_ONCE // self._flux.shape[1])
        for first in range(0, t.size, step):
            these = slice(first, first + step)
            number, part = self.place_in_time(t[these])
            before, after = (self._flux[self._which[number + k]] for k in (0, 1))
            blend = before + part[:, None] * (after - before)
            out[these] = work(np.maximum(blend, 0.0), these)
        return out

    def when(self, mass: Floats) -> Floats:
        """The times (n,) by which so much mass (n,), up to `self.mass`, has come in."""
        k = np.clip(np.searchsorted(self._mass, mass, side="right") - 1, 0, len(self._knots) - 2)
        width = self._knots[k + 1] - self._knots[k]
        rate, change = self._rate[k], self._rate[k + 1] - self._rate[k]
        left = np.maximum(mass - self._mass[k], 0.0)
        # The root of rate x + change x^2/(2 width) = left that holds for change = 0 and rate = 0, too.
        root = np.sqrt(np.maximum(rate**2 + 2.0 * left * change / width, 0.0))
        passed = 2.0 * left / np.maximum(rate + root, _TINY)
        return np.asarray(self._knots[k] + np.minimum(passed, width))

    def pieces(self, t: Floats, part: Floats) -> tuple[Indices, Floats]:
        """Through which piece the `part` (n,) of what comes in at the times t (n,) comes, and where in it.

        part : in [0, 1), counted along the pieces one after the other
        """
        piece = np.empty(t.size, np.int64)

        def find(fluxes: Floats, these: slice) -> Floats:
            cumulated = np.cumsum(fluxes, axis=1)
            target = part[these] * cumulated[:, -1]
            # Not `<`: a piece through which nothing comes has the sum of the one before it.
            found = np.minimum((cumulated <= target[:, None]).sum(axis=1), fluxes.shape[1] - 1)
            piece[these], rows = found, np.arange(found.size)
            here = fluxes[rows, found]
            passed = target - (cumulated[rows, found] - here)
            return np.asarray(np.clip(passed / np.maximum(here, _TINY), 0.0, 1.0))

        share = self._by_parts(t, find)
        return piece, share
