"""What comes in through pieces of inlets: masses, their inverse in time, and where."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.particles.inflow import Inflow

Floats = NDArray[np.float64]

# Three fields, of which the last one is the first one again; some pieces turn round, some never feed.
TIMES, WHICH, END = np.array([-0.3, 0.2, 0.9, 1.7]), np.array([0, 1, 2, 0]), 1.4
FLUX = np.array([[1.0, -0.5, 0.0, -1.0], [0.2, 1.5, 0.0, -2.0], [-0.7, 0.4, 2.0, -0.1]])


def inflow() -> Inflow:
    return Inflow(FLUX, TIMES, WHICH, END)


def rates(t: Floats) -> Floats:
    """Of each piece, (n, 4)."""
    columns = [np.interp(t, TIMES, FLUX[WHICH, p]) for p in range(FLUX.shape[1])]
    return np.asarray(np.maximum(np.stack(columns, axis=-1), 0.0))


def test_the_mass_is_the_integral_of_what_comes_in() -> None:
    """Against the midpoint rule on 200 000 intervals, whose error at a kink is the square of one."""
    t = (np.arange(200_000) + 0.5) * END / 200_000
    assert inflow().mass == pytest.approx(rates(t).sum() * END / 200_000, rel=1e-9)


def test_the_time_of_a_mass_is_the_inverse_of_the_mass_of_a_time() -> None:
    """To rounding, also through times at which hardly anything comes in."""
    t = np.linspace(0.0, END, 103)[1:]
    masses = np.array([Inflow(FLUX, TIMES, WHICH, float(end)).mass for end in t])
    assert (np.diff(masses) >= 0.0).all()
    back = inflow().when(masses)
    assert np.abs(back - t).max() < 1e-12
    assert inflow().when(np.zeros(1)) == 0.0


def test_a_flux_that_stays_gives_even_times_and_nothing_feeds_backwards() -> None:
    steady = Inflow(np.array([[2.0, -1.0]]), np.array([0.0, 3.0]), np.zeros(2, np.int64), 3.0)
    assert steady.mass == 6.0
    assert steady.when(np.array([1.5, 6.0])) == pytest.approx([0.75, 3.0], rel=1e-15)
    piece, share = steady.pieces(np.array([0.1, 2.9]), np.array([0.25, 0.75]))
    assert piece.tolist() == [0, 0]
    assert share == pytest.approx([0.25, 0.75], rel=1e-15)


def test_places_follow_the_fluxes_of_their_time() -> None:
    """Even parts at one time: each piece gets its share, to one part, and fills evenly."""
    parts = (np.arange(1000) + 0.5) / 1000
    for t in (0.0, 0.35, 1.3):
        piece, share = inflow().pieces(np.full(1000, t), parts)
        expected = rates(np.array([t]))[0]
        counted = np.bincount(piece, minlength=4)
        assert np.abs(counted - 1000 * expected / expected.sum()).max() <= 1.0
        inner = np.sort(share[piece == np.argmax(expected)])
        assert np.abs(np.diff(inner) - 1.0 / inner.size).max() < 2e-3
        assert ((share >= 0.0) & (share <= 1.0)).all()


def test_the_fields_of_a_time_have_weights_that_sum_to_one() -> None:
    t = np.linspace(-0.1, END, 57)
    weights = np.array([inflow().weights(t, field) for field in range(3)])
    np.testing.assert_allclose(weights.sum(axis=0), 1.0, rtol=1e-15)
    blended = np.einsum("fn,fp->np", weights, FLUX)
    np.testing.assert_allclose(np.maximum(blended, 0.0), rates(t), atol=1e-14)
