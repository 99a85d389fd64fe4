"""The drift at the cells' centres in a flow that is linear in time: tables at both ends, and their mean.

    F(t) = (1 - s) F(t_0) + s F(t_1),      s = (t - t_0)/(t_1 - t_0)

F and Jeffery's coefficients are linear in u. So a step takes a sum of two tables, and not a spline's
value at each cell.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.finite_volume.cell_acceleration import CellTerms
from ellipsoid_coupling.flow.interval import END, START, Interval, blend, part_of

Floats = NDArray[np.float64]


class MovingTables:
    """Keeps the tables of some `CellTerms` at the time that is asked for, in place.

    Parameters
    ----------
    tables_at : (time) -> steady, turning
        Those of `CellTerms` in the flow at a time.
    interval : Interval
        May be moved on in place between two steps.
    terms : CellTerms
    """

    def __init__(
        self,
        tables_at: Callable[[float], tuple[Floats, Floats]],
        interval: Interval,
        terms: CellTerms,
    ) -> None:
        self._at, self._interval = tables_at, interval
        self._terms = terms
        self._span = interval.span.copy()
        # No time is equal to NaN, so that the first call sets the tables.
        self._time = np.nan
        self._first, self._last = (self._at(float(self._span[k])) for k in (START, END))

    def set(self, t: float) -> None:
        """Bring the terms to a time of the interval."""
        # The interval is asked first: it has to be met in any case.
        if self._meet_interval() or t != self._time:
            self._time = t
            part = float(plain(part_of)(self._interval.span, t))
            tables = self._terms.steady, self._terms.turning
            for table, first, last in zip(tables, self._first, self._last, strict=True):
                # `CellTerms` leaves out what the scene does not have; both ends have all of it.
                if table is not None:
                    np.copyto(table, blend(part, first, last))

    def _meet_interval(self) -> bool:
        """The tables of the interval as it is now; whether it is another one than before."""
        span = self._interval.span
        if np.array_equal(span, self._span):
            return False
        # Most often it begins where the one before has ended, with the same bits.
        follows = span[START] == self._span[END]
        self._first = self._last if follows else self._at(float(span[START]))
        self._last = self._at(float(span[END]))
        self._span = span.copy()
        return True
