"""Folding coordinates back between walls."""

from __future__ import annotations

import math

import pytest

from ellipsoid_coupling.interaction import reflect


@pytest.mark.parametrize(
    ("coordinate", "folded", "sign"),
    [
        (2.25, 2.25, 1.0),
        (2.0, 2.0, 1.0),
        (3.0, 3.0, 1.0),
        (3.25, 2.75, -1.0),
        (1.75, 2.25, -1.0),
        (4.25, 2.25, 1.0),
        (0.75, 2.75, 1.0),
        (7.5, 2.5, -1.0),
        (-3.75, 2.25, 1.0),
    ],
)
def test_reflects_as_often_as_it_takes(coordinate: float, folded: float, sign: float) -> None:
    # Quarters are exact in binary: no rounding at all.
    assert reflect(coordinate, 2.0, 3.0) == (folded, sign)


def test_follows_a_ball_between_two_walls() -> None:
    # Against stepping a ball in small steps: the steps' rounding, 1e-12.
    position, direction, step = 0.3, 1.0, 1.0 / 128.0
    for count in range(1, 1000):
        position += direction * step
        if not 0.0 <= position <= 0.7:
            position = -position if position < 0.0 else 1.4 - position
            direction = -direction
        folded, sign = reflect(0.3 + count * step, 0.0, 0.7)
        assert folded == pytest.approx(position, abs=1e-12)
        assert sign == direction


def test_one_wall_only() -> None:
    assert reflect(-0.25, 0.0, math.inf) == (0.25, -1.0)
    assert reflect(9.0, 0.0, math.inf) == (9.0, 1.0)
    assert reflect(1.25, -math.inf, 1.0) == (0.75, -1.0)
    assert reflect(1e9, -math.inf, math.inf) == (1e9, 1.0)


def test_stays_within_the_walls_despite_rounding_and_keeps_nan() -> None:
    for count in range(1, 2000):
        folded, _ = reflect(count * 0.1, 0.1, 0.3)
        assert 0.1 <= folded <= 0.3
    assert math.isnan(reflect(math.nan, 0.0, 1.0)[0])
