"""The fluid along the lines of a staircase in a flow that is linear in time: at both ends, and their mean.

A step takes the fluid of its middle, with which it is of second order. So does what the fluid carries in.
Ghosts at open ends depend on which way the fluid goes, and follow from the mean.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.finite_volume.fluid_faces import set_ghosts
from ellipsoid_coupling.finite_volume.fluid_lines import FluidLines, LineTable
from ellipsoid_coupling.flow.interval import END, START, Interval, blend, part_of


class MovingLines:
    """Keeps motion and inflow of some `FluidLines` at the time that is asked for, in place.

    Parameters
    ----------
    lines_at : (time) -> FluidLines
        Those of the flow at a time.
    interval : Interval
        May be moved on in place between two steps.

    Attributes
    ----------
    lines : FluidLines
        `fastest` is that of the interval's faster end.
    """

    def __init__(self, lines_at: Callable[[float], FluidLines], interval: Interval) -> None:
        self._lines_at, self._interval = lines_at, interval
        self._span = interval.span.copy()
        self._first, self._last = (lines_at(float(self._span[k])) for k in (START, END))
        # Lines of their own, since the mean is written over them.
        self.lines = lines_at(float(self._span[START]))
        self._open = {axis: self._with_open_ends(axis) for axis in self.lines.tables}
        self._note_fastest()

    def _with_open_ends(self, axis: int) -> LineTable:
        """The lines that fluid may pass an end of; ghosts of all others are linear in time as well."""
        table, lines = self.lines.tables[axis], self.lines
        passed = np.array(lines.is_passed)[table.boundary].any(axis=1) & ~table.ring
        return table._replace(
            slot=table.slot[passed],
            length=table.length[passed],
            ring=table.ring[passed],
            kind=table.kind[passed],
        )

    def set(self, t: float) -> None:
        """Bring the lines to a time of the interval."""
        self._meet_interval()
        part = float(plain(part_of)(self._interval.span, t))
        for axis, now in self.lines.motion.items():
            first, last = self._first.motion[axis], self._last.motion[axis]
            if now is not None and first is not None and last is not None:
                # In place: fluxes of the step hold these arrays.
                np.copyto(now.lower, blend(part, first.lower, last.lower))
                np.copyto(now.upper, blend(part, first.upper, last.upper))
                set_ghosts((now.lower, now.upper), self._open[axis], self.lines.kinds)
        for axis, carried in self.lines.carried.items():
            np.copyto(carried, blend(part, self._first.carried[axis], self._last.carried[axis]))

    def _meet_interval(self) -> None:
        span = self._interval.span
        if np.array_equal(span, self._span):
            return
        # Most often it begins where the one before has ended, with the same bits.
        follows = span[START] == self._span[END]
        self._first = self._last if follows else self._lines_at(float(span[START]))
        self._last = self._lines_at(float(span[END]))
        self._span = span.copy()
        self._note_fastest()

    def _note_fastest(self) -> None:
        # A mean of both is nowhere faster than the faster one.
        fastest = max(self._first.fastest, self._last.fastest)
        self.lines = self.lines._replace(fastest=fastest)
