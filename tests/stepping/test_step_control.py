"""Step control by itself: what is chosen, counted, repeated and given up, on an equation of one number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.stepping.status import NOT_FINITE, RUNNING, STEP_TOO_SMALL
from ellipsoid_coupling.stepping.step_control import (
    CFL_LIMIT,
    COLLISION,
    FIRST_COUNT,
    GIVEN,
    NEXT_STEP,
    POSITION_ERROR,
    ROTATION_LIMIT,
    STATUS,
    STEPS,
    TIME,
    Aside,
    accept,
    advance_by_limits,
    equal_steps,
    halved_step,
    held_step,
    new_clock,
    shorten,
    step_log,
)


class Toy:
    """Allows steps of `allowed(t)`; refuses those above `refused_above(t)`; keeps the steps taken."""

    def __init__(
        self,
        allowed: Callable[[float], float],
        refused_above: Callable[[float], float] = lambda _t: np.inf,
    ) -> None:
        self.clock = new_clock(1, np.inf, CFL_LIMIT)
        self.end, self.aside = 0.0, Aside()
        self.allowed, self.refused_above = allowed, refused_above
        self.steps: list[float] = []

    def live(self) -> dict[str, NDArray[Any]]:
        return {"clock": self.clock}

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        self.clock[...], self.aside = state["clock"], Aside()

    def allowed_step(self) -> tuple[float, int]:
        return self.allowed(float(self.clock[0, TIME])), CFL_LIMIT

    def try_step(self, dt: float, after: float) -> bool:
        if not dt <= self.refused_above(float(self.clock[0, TIME])):
            return False
        self.steps.append(dt)
        self.after = after
        return True


def test_equal_steps_meet_the_end_and_none_is_too_long() -> None:
    rng = np.random.default_rng(0)
    for largest in 10.0 ** rng.uniform(-6, 3, 200):
        dt = equal_steps(1.0, float(largest))
        assert dt <= largest * (1.0 + 1e-12)
        assert 1.0 / dt == pytest.approx(round(1.0 / dt), rel=1e-12)
        assert dt > 0.5 * min(largest, 1.0)
    assert equal_steps(1.0, np.inf) == 1.0


@pytest.mark.parametrize("refused_above", [np.inf, 0.02])
def test_save_times_on_the_way_bend_no_step(refused_above: float) -> None:
    """Short steps aside meet them exactly; the clock at the end is the same to the bit."""
    one, other = (Toy(lambda t: 0.07 + 0.01 * t, lambda _t: refused_above) for _ in range(2))
    one.end = other.end = 1.7
    assert advance_by_limits(one, 1.7, 10_000) == RUNNING
    # Two within one step, and calls of a single step.
    for until in (0.3, 0.31, 0.5, 1.7):
        while other.clock[0, TIME] < until:
            advance_by_limits(other, until, 1)
        assert other.clock[0, TIME] == until
    np.testing.assert_array_equal(other.clock, one.clock)


def test_time_meets_save_times_exactly_and_steps_add_up() -> None:
    toy = Toy(lambda _t: 0.07)
    for until in (0.3, 0.5, 1.7):
        assert advance_by_limits(toy, until, 1000) == RUNNING
        assert toy.clock[0, TIME] == toy.after == until
    assert sum(toy.steps) == pytest.approx(1.7, rel=1e-13)
    log = step_log(toy.clock)
    assert log["steps"] == len(toy.steps) == toy.clock[0, FIRST_COUNT:].sum()
    assert log["shortest_step"] == min(toy.steps)
    assert log["longest_step"] == max(toy.steps)


def test_work_may_be_cut_into_calls_anywhere() -> None:
    """The same steps, bit for bit, five a call or one."""
    whole, parts = Toy(lambda t: 0.01 + 0.1 * t), Toy(lambda t: 0.01 + 0.1 * t)
    advance_by_limits(whole, 2.0, 1000)
    while parts.clock[0, TIME] < 2.0:
        advance_by_limits(parts, 2.0, 1)
    assert whole.steps == parts.steps


def test_a_refused_step_is_halved_and_grows_back_by_doubling() -> None:
    """Between t = 1 and 1.2 only 0.01 works, else 0.1: nine refusals would be one a step."""
    toy = Toy(lambda _t: 0.1, lambda t: 0.01 if 1.0 <= t < 1.2 else 1.0)
    advance_by_limits(toy, 2.0, 1000)
    log = step_log(toy.clock)
    assert log["rejected_steps"] < 0.6 * len(toy.steps)
    assert log["shortest_step"] <= 0.01
    assert 1.0 <= log["shortest_step_time"] < 1.2
    assert toy.steps[-1] == pytest.approx(0.1, rel=0.1)
    assert "repeated step" in log["step_limits"]


def test_nothing_that_moves_means_one_step_a_save_time() -> None:
    toy = Toy(lambda _t: np.inf)
    for until in (1.0, 5.0):
        advance_by_limits(toy, until, 10)
    assert toy.steps == [1.0, 4.0]
    assert step_log(toy.clock)["step_limits"] == "save times 100 %"


def test_the_log_tells_the_limits_in_order() -> None:
    toy = Toy(lambda _t: 0.25)
    advance_by_limits(toy, 1.0, 100)
    toy.clock[0, FIRST_COUNT + ROTATION_LIMIT] += 1.0
    assert step_log(toy.clock)["step_limits"] == "CFL number 80 %, rotation 20 %"


@pytest.mark.parametrize(("allowed", "status"), [(1e-14, STEP_TOO_SMALL), (0.0, NOT_FINITE)])
def test_a_step_that_cannot_be_meant_stops(allowed: float, status: int) -> None:
    assert advance_by_limits(Toy(lambda _t: allowed), 1.0, 10) == status


def test_repeating_has_an_end() -> None:
    """Forty halvings are 1e-12."""
    toy = Toy(lambda _t: 1.0, lambda _t: 0.0)
    assert advance_by_limits(toy, 1.0, 10) == STEP_TOO_SMALL
    assert toy.clock[0, NEXT_STEP] == pytest.approx(2.0**-40)
    assert toy.steps == []


def test_steps_that_shrink_without_being_repeated_have_an_end_too() -> None:
    """As with noise: each step is kept, and the next planned a third as long."""
    clock = new_clock(1, 0.1, GIVEN)[0]
    steps = 0
    while clock[STATUS] == RUNNING:
        dt = float(clock[NEXT_STEP])
        accept(clock, 1.0, dt, 0.3 * dt, POSITION_ERROR)
        steps += 1
    assert clock[STATUS] == STEP_TOO_SMALL
    assert steps == 22  # 0.1 * 0.3^22 is the first below 1e-12


def test_a_short_first_step_may_grow() -> None:
    clock = new_clock(1, 1e-14, GIVEN)[0]
    accept(clock, 1.0, 1e-14, 2e-14, POSITION_ERROR)
    assert clock[STATUS] == RUNNING


def stepped(errors: Callable[[float, float], float], count: int) -> tuple[NDArray[np.float64], int]:
    """The lengths of held steps whose error is errors(step number, dt), and how many were refused."""
    clock, refused, taken = new_clock(1, 0.01, GIVEN)[0], 0, []
    while clock[STEPS] < count:
        dt = float(clock[NEXT_STEP])
        error = errors(float(clock[STEPS]), dt)
        if error > 1.0:
            refused += 1
            shorten(clock, 1e9, halved_step(dt, error), POSITION_ERROR)
            continue
        accept(clock, 1e9, dt, held_step(clock, dt, error), POSITION_ERROR)
        taken.append(dt)
    return np.array(taken), refused


def test_a_held_step_changes_ever_more_seldom() -> None:
    """Errors that go up and down with a period of 200 steps, as in an oscillation: 30 refusals at most.

    Eight times the step grows at once and is taken back, each time by up to three halvings; once it waits
    16 steps, then 256. By then the worst error is seen before the step grows, and it stays.
    """
    steps, refused = stepped(lambda n, dt: dt**3 * abs(np.sin(np.pi * n / 200.0)), 10_000)
    assert refused <= 30
    assert len(set(steps[3000:])) == 1
    assert 0.5 < steps[-1] <= 1.0


def test_a_held_step_is_as_long_after_a_collision_as_before() -> None:
    """Errors a million times as large for 400 of 1000 steps, as in one collision: back within ten steps.

    A swing into a wall is such a collision; that the step stays short after it would be most of the run.
    """
    steps, refused = stepped(lambda n, dt: dt**3 * (1e6 if 300 <= n < 700 else 1.0), 1000)
    assert steps[299] == steps[710] > 0.5
    assert steps[300:700].max() < 0.01
    assert refused <= 3


@pytest.mark.parametrize(
    ("error", "part"), [(1.01, 0.5), (8.1, 0.25), (1e9, 0.0625), (np.nan, 0.0625)]
)
def test_a_refused_step_is_halved_as_often_as_its_error_asks(error: float, part: float) -> None:
    """The estimate is of third order; a sixteenth at the least, since far from the solution it is none."""
    assert halved_step(0.3, error) == pytest.approx(0.3 * part, rel=1e-15)


def test_a_collision_that_limits_is_told() -> None:
    clock = new_clock(1, 1.0, GIVEN)[0]
    shorten(clock, 1.0, 0.25, COLLISION)
    accept(clock, 1.0, 0.25, 0.5, POSITION_ERROR)
    assert step_log(clock[None])["step_limits"] == "collision 100 %"
