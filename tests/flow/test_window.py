"""What a run sees of a flow at several times: three fields at most, and the same bits at any speed."""

from __future__ import annotations

import gc
import time
import weakref
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow import FlowField, FlowSeries, open_window
from ellipsoid_coupling.flow.interval import MovingFlow
from tests.flow.known import spline

BASE = spline(8)
TIMES = [0.25 * k for k in range(13)]


def flow_of(factor: float) -> FlowField:
    arrays = BASE.arrays._replace(coefficients=factor * BASE.arrays.coefficients)
    return FlowField(arrays, "x")


def series(repeat: bool = False) -> FlowSeries:
    factors = [1.0 + (k % 6) for k in range(13)]
    return FlowSeries.of_fields(TIMES, map(flow_of, factors), "many", repeat=repeat)


def ends(field: FlowField | None) -> tuple[float, float]:
    """By what the known flow is multiplied at both ends of the interval."""
    assert isinstance(field, MovingFlow)
    first, last, _ = field.interval
    one = BASE.arrays.coefficients[4, 4]
    return first.coefficients[4, 4] / one, last[4, 4] / one


def test_it_moves_on_in_place() -> None:
    """Kernels keep their arrays; each interval is the one that the time lies in."""
    with open_window(series()) as window:
        field = window.field
        assert isinstance(field, MovingFlow)
        arrays = field.interval.first.coefficients, field.interval.last
        for k in range(12):
            assert ends(field) == pytest.approx((1 + k % 6, 1 + (k + 1) % 6))
            assert window.until == field.until == TIMES[k + 1]
            assert not window.move_to(0.5 * (TIMES[k] + TIMES[k + 1]))
            # At the end of the last one it stays.
            assert window.move_to(window.until) == (k < 11)
        assert field.interval.first.coefficients is arrays[0]
        assert field.interval.last is arrays[1]
        # Back, and on by more than one, as a run that is resumed does.
        for t in (0.6, 2.3, 0.0):
            assert window.move_to(t)
            k = int(t / 0.25)
            assert ends(field) == pytest.approx((1 + k % 6, 1 + (k + 1) % 6))


def test_a_flow_that_repeats_goes_on_for_ever() -> None:
    """The last field is never taken: it is the first one, one period later."""
    flow = FlowSeries.of_fields((0.0, 1.0, 3.0), map(flow_of, (1.0, 2.0, 1.01)), repeat=True)
    with open_window(flow) as window:
        for rounds in range(5):
            assert ends(window.field) == pytest.approx((1.0, 2.0))
            assert window.until == 1.0 + 3.0 * rounds
            window.move_to(window.until)
            assert ends(window.field) == pytest.approx((2.0, 1.0))
            window.move_to(window.until)


def test_three_fields_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all that were ever read: those of the interval, whose arrays stay, and the one ahead."""
    alive: list[weakref.ref[NDArray[np.float64]]] = []
    most = 0
    read = FlowSeries.coefficients

    def counted(self: FlowSeries, start: int) -> NDArray[np.float64]:
        nonlocal most
        array = read(self, start)
        alive.append(weakref.ref(array))
        most = max(most, sum(one() is not None for one in alive))
        return array

    monkeypatch.setattr(FlowSeries, "coefficients", counted)
    with open_window(series(repeat=True)) as window:
        for _ in range(30):
            window.move_to(window.until)
        for t in (0.1, 2.6, 0.7):
            window.move_to(t)
    assert len(alive) > 30
    assert most == 3
    del window
    gc.collect()
    assert not any(one() is not None for one in alive)


def test_a_slow_thread_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever needs the next field waits for it."""

    def seen() -> list[tuple[float, float]]:
        with open_window(series()) as window:
            found = []
            for t in TIMES[:-1]:
                window.move_to(t)
                found.append(ends(window.field))
        return found

    fast, read = seen(), FlowSeries.coefficients

    def slow(self: FlowSeries, start: int) -> NDArray[np.float64]:
        time.sleep(0.01 * (start % 3))
        return read(self, start)

    monkeypatch.setattr(FlowSeries, "coefficients", slow)
    assert seen() == fast


def test_a_field_that_cannot_be_read_any_more_is_named(tmp_path: Path) -> None:
    """With its time and the file; the run fails and keeps what it has."""
    flow = series()
    flow.save(tmp_path / "flow.npz")
    own = FlowSeries.load(tmp_path / "flow.npz")
    with open_window(own) as window:
        (tmp_path / "flow.npz").write_bytes(b"")

        def go_on() -> None:
            # One may have been read ahead before.
            for t in (0.25, 0.5, 0.75):
                window.move_to(t)

        with pytest.raises(RunError, match=r"The flow at time .* cannot be read\. .*flow\.npz"):
            go_on()


def test_a_flow_that_does_not_change_is_itself() -> None:
    for flow in (BASE, None):
        with open_window(flow) as window:
            assert window.field is flow
            assert window.until == np.inf
            assert not window.move_to(1e9)
