"""Shifting coordinates by whole periods."""

from __future__ import annotations

import math

import pytest

from ellipsoid_coupling.geometry.wrapping import wrap


@pytest.mark.parametrize(
    ("coordinate", "wrapped"),
    [(2.25, 2.25), (2.0, 2.0), (3.0, 2.0), (3.25, 2.25), (1.75, 2.75), (-3.75, 2.25), (9.5, 2.5)],
)
def test_wraps_as_often_as_it_takes(coordinate: float, wrapped: float) -> None:
    # Quarters are exact in binary: no rounding at all.
    assert wrap(coordinate, 2.0, 3.0) == wrapped


def test_stays_inside_despite_rounding() -> None:
    """The upper side is the lower one; so is what lies nearer to a side than the last bit."""
    assert wrap(-1e-20, 0.0, 1.0) == 0.0
    for count in range(-2000, 2000):
        assert 0.1 <= wrap(count * 0.1, 0.1, 0.3) < 0.3


def test_without_a_period_everything_stays() -> None:
    assert wrap(-1e9, -math.inf, math.inf) == -1e9
    assert wrap(math.inf, -math.inf, math.inf) == math.inf
    assert math.isnan(wrap(math.nan, 0.0, 1.0))
