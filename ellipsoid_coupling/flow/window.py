"""The fields that a run is between: two of them, and the next one, which a thread reads ahead.

    times     t_0     t_1     t_2     t_3
              first   last    ahead                three fields at most, whatever their number
                 run ->|
                      first   last    ahead        moved on in place: kernels keep their arrays

Nothing that a run computes depends on how fast the thread is: who needs the next field waits for it.
"""

from __future__ import annotations

import math
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow.field import FlowField
from ellipsoid_coupling.flow.interval import Interval, MovingFlow, set_span
from ellipsoid_coupling.flow.series import FlowSeries

Array = NDArray[np.float64]


class Window:
    """What a run sees of a flow that does not change, or of none. A context, closed at the run's end.

    Attributes
    ----------
    field : FlowField or None
        For `Setup.flow`.
    """

    def __init__(self, field: FlowField | None) -> None:
        self.field = field

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @property
    def until(self) -> float:
        """The time up to which `field` holds: no step goes beyond it."""
        return math.inf

    def move_to(self, t: float) -> bool:
        """Go on, in place, to the fields around a time, once all of a run has come there.

        Returns
        -------
        Whether there are other fields now.

        Raises
        ------
        RunError
            If they cannot be read any more.
        """
        del t
        return False

    def close(self) -> None:
        """End reading ahead."""


class SeriesWindow(Window):
    """What a run sees of a flow at several times: an interval between two of them.

    Parameters
    ----------
    series : FlowSeries
    t : float
        The time to begin at.
    """

    def __init__(self, series: FlowSeries, t: float) -> None:
        self._series = series
        self._reader = ThreadPoolExecutor(1, "read-ahead")
        self._ahead: Future[Array] | None = None
        self._number = series.interval_at(t)
        first = series.arrays._replace(coefficients=self._read(self._number))
        last = self._read(self._number + 1)
        self._interval = Interval(first, last, np.zeros(3))
        self._set_span()
        self.field = MovingFlow(
            first,
            series.origin,
            series.outline,
            plane=series.plane,
            interval=self._interval,
            series=series,
        )
        self._read_ahead()

    @property
    def until(self) -> float:
        """The end of the interval."""
        return self._series.time_of(self._number + 1)

    def move_to(self, t: float) -> bool:
        """As `Window.move_to`."""
        number = self._series.interval_at(t)
        if number == self._number:
            return False
        first, last, _ = self._interval
        ahead, self._ahead = self._ahead, None
        if number == self._number + 1 and ahead is not None:
            np.copyto(first.coefficients, last)
            np.copyto(last, self._result(ahead, number + 1))
            ahead = None
        else:
            ahead = None  # let go before others are read
            np.copyto(first.coefficients, self._read(number))
            np.copyto(last, self._read(number + 1))
        self._number = number
        self._set_span()
        self._read_ahead()
        return True

    def close(self) -> None:
        """Wait for the thread."""
        self._reader.shutdown(wait=True, cancel_futures=True)

    def _set_span(self) -> None:
        start, end = (self._series.time_of(self._number + k) for k in (0, 1))
        set_span(self._interval.span, start, end)

    def _read(self, start: int) -> Array:
        return self._result(self._reader.submit(self._series.coefficients, start), start)

    def _result(self, reading: Future[Array], start: int) -> Array:
        try:
            return reading.result()
        except InputError as error:
            when = self._series.time_of(start)
            raise RunError(f"The flow at time {when:g} cannot be read. {error}") from error

    def _read_ahead(self) -> None:
        number = self._number + 2
        if self._series.repeat or number < self._series.times.size:
            self._ahead = self._reader.submit(self._series.coefficients, number)


def open_window(flow: FlowField | None) -> Window:
    """What a run sees of a flow at its start, the time 0."""
    return SeriesWindow(flow, 0.0) if isinstance(flow, FlowSeries) else Window(flow)
