"""Bins of a carried density: exact for affine maps, of fourth order for smooth ones, and of mass 1."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import brentq

from ellipsoid_coupling.geometry.even_points import even_points
from ellipsoid_coupling.geometry.flow_map import (
    corner_strips,
    fine_parts,
    mapped_angles,
    mapped_density,
    part_below,
)

Floats = NDArray[np.float64]

SQUARE = ((-1.5, 1.5), (-1.5, 1.5))
BIN = 3.0 / 20


def start(
    n: int, x: tuple[float, float] = (-1.0, 1.0), y: tuple[float, float] = (-1.0, 1.0)
) -> Floats:
    return even_points(x, y, n, n)


def masses(places: Floats, box: Floats | None = None) -> Floats:
    """Of 20 x 20 bins, (y, x)."""
    return mapped_density(places, SQUARE, 20, box) * BIN**2


def of_interval(low: float, high: float) -> Floats:
    """The masses of a constant density on an interval in 20 bins."""
    edges = np.linspace(-1.5, 1.5, 21)
    return np.asarray(np.diff(np.clip(edges, low, high)) / (high - low))


@pytest.mark.parametrize("lengths", [(1.0, 0.3), (0.2, -0.7), (0.4, 0.4), (1.0, 1e-9)])
def test_the_part_below_a_line_is_a_trapezoid_s(lengths: tuple[float, float]) -> None:
    """The distribution of the sum of two uniform numbers, scipy's, to rounding."""
    one, other = lengths
    outer = 0.5 * (abs(one) + abs(other))
    short, long = min(abs(one), abs(other)) / (2 * outer), max(abs(one), abs(other)) / (2 * outer)
    for distance in np.linspace(-1.1, 1.1, 45) * outer:
        exact = stats.trapezoid.cdf(distance, short, long, loc=-outer, scale=2 * outer)
        assert part_below(distance, one, other) == pytest.approx(exact, abs=1e-9)


def test_a_stretched_box_is_cut_exactly() -> None:
    """(x e^-t, y e^t) at t = 0.31: products of overlaps, to rounding, from 4 x 4 samples."""
    places = start(4) * np.array([math.exp(-0.31), math.exp(0.31)])[:, None, None]
    exact = np.outer(
        of_interval(-math.exp(0.31), math.exp(0.31)), of_interval(-math.exp(-0.31), math.exp(-0.31))
    )
    found = masses(places)
    assert np.abs(found - exact).sum() < 1e-11
    # Points of as many fine parts are off by rows of them.
    x, y = start(512) * np.array([math.exp(-0.31), math.exp(0.31)])[:, None, None]
    counted = np.histogram2d(y.ravel(), x.ravel(), 20, [list(axis) for axis in SQUARE])[0] / 512**2
    assert np.abs(counted - exact).sum() > 5e-3


def turned(n: int, angle: float) -> Floats:
    x, y = start(n, (0.2, 0.7), (-0.25, 0.25))
    return np.array(
        [math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x + math.cos(angle) * y]
    )


def test_a_turned_box_is_cut_exactly() -> None:
    """Either marginal is a trapezoid's: to rounding. Corners of bins: against finer parts."""
    found = masses(turned(8, 0.7))
    edges = np.linspace(-1.5, 1.5, 21)
    for axis, centre in ((0, 0.45 * math.cos(0.7)), (1, 0.45 * math.sin(0.7))):
        one, other = 0.5 * math.cos(0.7), 0.5 * math.sin(0.7)
        below = [part_below(edge - centre, one, other) for edge in edges]
        assert np.abs(found.sum(axis=axis) - np.diff(below)).max() < 1e-12
    assert found.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(found - masses(turned(1024, 0.7))).sum() < 1e-4


@pytest.mark.parametrize("n", [3, 40, 700])
def test_mass_that_reflecting_sides_hold_is_one(n: int) -> None:
    """A folded map, whose parallelograms reach beyond the walls: to rounding of the sum."""
    places = 2.0 * start(n)
    folded = np.where(np.abs(places) > 1.5, np.sign(places) * 3.0 - places, places)
    closed = np.array([[-1.5, 1.5], [-1.5, 1.5]])
    assert masses(folded, closed).sum() == pytest.approx(1.0, abs=1e-12)
    # With the upper side open, an eighth of the mass is beyond it: the samples there have not bounced.
    places[1] = np.where(places[1] < -1.5, -3.0 - places[1], places[1])
    left = masses(np.array([folded[0], places[1]]), np.array([[-1.5, 1.5], [-1.5, np.inf]])).sum()
    assert left == pytest.approx(0.875, abs=1e-12 if n > 4 else 0.2)


def test_corners_converge_at_fourth_order() -> None:
    """A smooth map and its extrapolation to the rim: errors fall by 16 with half the spacing."""

    def error(n: int) -> float:
        x, y = start(n)
        at = np.linspace(-1.0, 1.0, n * fine_parts(n) + 1)
        exact = np.sin(2.0 * at[None, :] + at[:, None])
        strips = [strip for (strip,) in corner_strips(np.sin(2.0 * x + y)[None])]
        # Neighbouring strips share a row.
        found = np.concatenate([strips[0], *(strip[1:] for strip in strips[1:])])
        return float(np.abs(found - exact).max())

    coarse, middle, fine = (error(n) for n in (16, 32, 64))
    assert math.log2(coarse / middle) == pytest.approx(4.0, abs=0.3)
    assert math.log2(middle / fine) == pytest.approx(4.0, abs=0.3)


def test_a_bent_density_has_the_masses_of_its_inverse() -> None:
    """The map x + 0.4 sin(2 x): mass by its inverse. 32 samples a side err by 1e-4."""

    def bend(a: float) -> float:
        return a + 0.4 * math.sin(2.0 * a)

    edges = np.clip(np.linspace(-1.5, 1.5, 21), bend(-1.0), bend(1.0))
    inverse = [
        float(brentq(lambda a, e=edge: bend(a) - e, -1.0 - 1e-9, 1.0 + 1e-9)) for edge in edges
    ]
    exact = np.outer(of_interval(-1.0, 1.0), np.diff(inverse) / 2.0)
    x, y = start(32)
    assert np.abs(masses(np.array([x + 0.4 * np.sin(2.0 * x), y])) - exact).sum() < 2e-4


def test_angles_wind_round_the_circle() -> None:
    """Angles 9 a + 2 b over the unit square: a trapezoid wrapped round, to rounding."""
    a, b = even_points((0.0, 1.0), (0.0, 1.0), 6, 6)
    edges = np.arange(0, 4 * 60 + 1) * (2.0 * math.pi / 60)
    below = [part_below(edge - 5.5, 9.0, 2.0) for edge in edges]
    exact = np.diff(below).reshape(4, 60).sum(axis=0)
    found = mapped_angles(9.0 * a + 2.0 * b, 60) * 2.0 * math.pi / 60
    assert np.abs(found - exact).sum() < 1e-11
    far = mapped_angles(9.0 * a + 2.0 * b - 2.0 * math.pi * 7, 60) * 2.0 * math.pi / 60
    assert np.abs(far - exact).sum() < 1e-11


def test_equal_angles_stay_in_their_bin() -> None:
    found = mapped_angles(np.full((5, 5), 1.6), 60) * 2.0 * math.pi / 60
    assert found[15] == pytest.approx(1.0, abs=1e-12)
    # Neighbours that are wildly apart, as in a damaged file, end as well.
    assert mapped_angles(np.array([[0.0, 1e300], [-1e300, 3.0]]), 60).sum() > 0.0
