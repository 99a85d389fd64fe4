"""A flow between two times: linear in time, both ends to the bit, and never without a time."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.compiled.jit import kernel, plain
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.flow import FlowField, FlowSeries
from ellipsoid_coupling.flow.interval import (
    Interval,
    MovingFlow,
    Sample,
    between,
    blend,
    part_of,
    sample_at,
    set_span,
)
from tests.flow.known import points, spline

FIRST = spline(8)
LAST = FlowField(
    FIRST.arrays._replace(coefficients=-0.3 * FIRST.arrays.coefficients + 0.01), "later"
)


def moving(start: float = 0.3, end: float = 1.1, last: FlowField = LAST) -> MovingFlow:
    interval = Interval(FIRST.arrays, last.arrays.coefficients, np.zeros(3))
    set_span(interval.span, start, end)
    series = FlowSeries.of_fields((start, end), (FIRST, last))
    return MovingFlow(FIRST.arrays, "a test", None, interval=interval, series=series)


@kernel
def _sample(flow: Interval, t: float, x: float, y: float) -> Sample:
    return sample_at(flow, t, x, y)


def test_ends_are_exact_and_equal_ends_stay() -> None:
    """To the bit, in the kernels' formula and in that of arrays."""
    first, last = np.random.default_rng(0).normal(size=(2, 1000))
    for number in range(50):
        a, b = float(first[number]), float(last[number])
        assert plain(between)(0.0, a, b) == a
        assert plain(between)(1.0, a, b) == b
        assert plain(between)(number / 50.0, a, a) == a
    for part, expected in ((0.0, first), (1.0, last)):
        assert np.array_equal(blend(part, first, last), expected)
    assert np.array_equal(blend(0.37, first, first), first)


@pytest.mark.parametrize("span", [(0.0, 0.1), (0.1, 0.7), (-3.0, 1e9), (0.3, 0.1 + 0.3)])
def test_the_part_is_exact_at_both_ends_and_stays_between(span: tuple[float, float]) -> None:
    at = np.zeros(3)
    set_span(at, *span)
    inner = np.linspace(*span, 1001)[1:-1]
    parts = [plain(part_of)(at, float(t)) for t in inner]
    assert all(0.0 <= part <= 1.0 for part in parts)
    expected = (inner - span[0]) / (span[1] - span[0])
    np.testing.assert_allclose(
        parts, expected, atol=4e-16 * max(map(abs, span)) / (span[1] - span[0])
    )
    for t, part in ((span[0], 0.0), (span[1], 1.0), (-1e30, 0.0), (1e30, 1.0)):
        assert plain(part_of)(at, t) == part


@pytest.mark.parametrize("t", [0.3, 0.5, 0.9, 1.1])
def test_a_sample_is_linear_in_time(t: float) -> None:
    """Of all five numbers, to rounding; compiled as in Python, to the bit."""
    flow = moving()
    s = (t - 0.3) / 0.8
    for x, y in zip(*points(20), strict=True):
        found = _sample(flow.interval, t, float(x), float(y))
        assert found == plain(_sample)(flow.interval, t, float(x), float(y))
        ends = [field.evaluate(x, y) for field in (FIRST, LAST)]
        for k in range(5):
            expected = (1.0 - s) * float(ends[0][k]) + s * float(ends[1][k])
            assert found[k] == pytest.approx(expected, abs=1e-12)
        assert found[5]


def test_the_flow_at_a_time_is_what_kernels_sample() -> None:
    """Blended coefficients or blended velocities: the same to rounding."""
    flow = moving()
    x, y = points(30)
    for t in (0.3, 0.71, 1.1):
        at = flow.at(t).evaluate(x, y)
        found = [_sample(flow.interval, t, float(a), float(b)) for a, b in zip(x, y, strict=True)]
        np.testing.assert_allclose([one[:5] for one in found], np.array(at[:5]).T, atol=1e-11)
    assert np.array_equal(flow.at(-5.0).arrays.coefficients, FIRST.arrays.coefficients)
    assert np.array_equal(flow.at(5.0).arrays.coefficients, LAST.arrays.coefficients)


def test_it_stays_tight_at_walls_and_free_of_divergence() -> None:
    """Psi is constant on the walls at both times, so at all between: no velocity across, to rounding."""
    flow, along = moving(), np.linspace(0.0, 1.0, 77)
    for t in (0.4, 0.77):
        now = flow.at(t)
        for end in (0.0, 1.0):
            assert np.abs(now.evaluate(np.full(77, end), along).velocity_x).max() < 1e-14
            assert np.abs(now.evaluate(along, np.full(77, end)).velocity_y).max() < 1e-14
        # In kernels d u_y/dy is -d u_x/dx; here by differences of u_y.
        x, y = points(20, seed=4)
        step = 1e-5
        up, down = (now.evaluate(x, y + d).velocity_y for d in (step, -step))
        slope = now.evaluate(x, y).dux_dx
        assert np.abs((up - down) / (2.0 * step) + slope).max() < 1e-6 * np.abs(slope).max()


def test_without_a_time_it_is_refused_in_words() -> None:
    """Whoever forgets the time must not get the flow of some other one."""
    for ask in (lambda: moving().evaluate(0.5, 0.5), lambda: moving().largest_speed):
        with pytest.raises(RunError, match=r"flow\.at\(t\)"):
            ask()
    assert moving().until == 1.1
    assert FIRST.until == np.inf
    assert FIRST.at(3.0) is FIRST
