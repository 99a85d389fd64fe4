"""The kinetic flux and the balanced stepper: moments, positivity, equilibria, slow twins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special

from ellipsoid_coupling.compiled.jit import plain
from ellipsoid_coupling.finite_volume.fluxes import kinetic
from ellipsoid_coupling.finite_volume.fluxes.contract import Stencil
from ellipsoid_coupling.finite_volume.fluxes.kinetic import Kinetic, kinetic_outflow
from ellipsoid_coupling.finite_volume.grid import GHOSTS
from ellipsoid_coupling.geometry.boundaries import Reflect, Remove
from tests.finite_volume.whole import fill, sweep

Floats = NDArray[np.float64]


def rows(n: int) -> tuple[Floats, Floats]:
    """Empty padded fields (4, 5, n + 4), one row of which is swept, and its densities."""
    fields = np.zeros((4, 1 + 2 * GHOSTS, n + 2 * GHOSTS))
    return fields, fields[:, GHOSTS, GHOSTS:-GHOSTS]


def test_half_moments_are_those_of_a_gaussian() -> None:
    """2.1e-7 and 7.2e-7, from the formula for the integral; both halves add up to rounding."""
    moments = plain(kinetic._half_moments)
    for v in np.linspace(-9.0, 9.0, 73):
        p, below = math.exp(-0.5 * v * v) / math.sqrt(2.0 * math.pi), special.ndtr(v)
        mass, momentum = moments(v)
        assert mass == pytest.approx(v * below + p, abs=4e-7)
        assert momentum == pytest.approx((1.0 + v * v) * below + v * p, abs=1.5e-6)
        other_mass, other_momentum = moments(-v)
        assert mass - other_mass == pytest.approx(v, abs=1e-14 * (1.0 + abs(v)))
        assert momentum + other_momentum == pytest.approx(1.0 + v * v, rel=1e-14)
        assert min(mass, momentum) >= 0.0


def test_positive_and_conservative_next_to_vacuum_and_at_any_step() -> None:
    """Random data, a third vacuum, far beyond the CFL number: no cell gives what it has not got."""
    fields, inner = rows(40)
    rng = np.random.default_rng(2)
    inner[0] = rng.random(40) * (rng.random(40) > 0.33)
    inner[1:] = inner[0] * rng.uniform(-3.0, 3.0, (3, 40))
    tilt = np.exp(rng.uniform(-1.0, 1.0, fields[0].shape))
    tilt[:, :GHOSTS] = tilt[:, -GHOSTS - 1 :] = 1.0
    before = inner[0].sum()
    for _ in range(5):
        fill(fields, -1, Reflect())
        tilt[:, 0], tilt[:, -2] = 1.0 / tilt[:, 2], 1.0 / tilt[:, -4]
        sweep(Kinetic(tilt.ravel(), 0.05), fields, -1, 1, 1.5)
        assert inner[0].min() >= 0.0
    assert inner[0].sum() == pytest.approx(before, rel=1e-13)


def test_no_cell_is_emptied_to_rounding() -> None:
    """Forces of 17 temperatures a cell take more than there is: a rounding error of the density changes
    velocities by some thousand of it, not by all they are; and all momentum stays within the row.
    """
    found = []
    for rounding in (0.0, 1e-15):
        fields, inner = rows(12)
        inner[0] = 1.8 + np.sin(np.arange(12.0)) * (1.0 + rounding)
        inner[1:] = inner[0] * np.array([[8.0], [1.0], [-2.0]])
        inner[:, [0, 1, 2, -3, -2, -1]] = 0.0
        tilt = np.full(fields[0].shape, math.exp(2.0))
        total = inner.sum(axis=1)
        sweep(Kinetic(tilt.ravel(), 0.05), fields, -1, 1, 0.1)
        np.testing.assert_allclose(inner.sum(axis=1), total, rtol=1e-13)
        filled = inner[0] > 0.0
        found.append(inner[1:, filled] / inner[0, filled])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-10)


def test_compiled_sweep_equals_its_plain_twin() -> None:
    """One row by the plain formula and what comes in less what leaves, to rounding."""
    fields, inner = rows(13)
    rng = np.random.default_rng(3)
    inner[0] = rng.random(13) * (rng.random(13) > 0.2)
    inner[1:] = inner[0] * rng.uniform(-1.0, 1.0, (3, 13))
    tilt = np.exp(rng.uniform(-0.2, 0.2, fields[0].size))
    fill(fields, -1, Remove())
    flat = fields.reshape(4, -1)
    first = GHOSTS * fields.shape[2] + GHOSTS
    density = flat[0]
    inverse = np.divide(1.0, density, out=np.zeros(density.size), where=density > 0.0)
    found = []
    for p in range(first - 1, first + 14):
        below, here, above = (tuple(flat[:, q]) for q in (p - 1, p, p + 1))
        thin = inverse[p - 1], inverse[p], inverse[p + 1]
        stencil = Stencil(below, here, above, thin, p, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            found.append(plain(kinetic_outflow)(Kinetic(tilt, 0.05), stencil, 0.3))
    up, down = np.transpose(found, (1, 2, 0))
    expected = flat[:, first : first + 13] - up[:, 1:-1] - down[:, 1:-1] + up[:, :-2] + down[:, 2:]
    sweep(Kinetic(tilt, 0.05), fields, -1, 1, 0.3)
    np.testing.assert_allclose(inner, expected, atol=1e-14)


def test_equilibrium_has_one_state_at_every_face() -> None:
    """For q = exp(-V) with a rough V, no mass moves, to rounding."""
    fields, inner = rows(20)
    potential = np.random.default_rng(4).uniform(-1.0, 1.0, 20)
    inner[0] = np.exp(-potential)
    tilt = np.ones(fields[0].shape)
    tilt[GHOSTS, GHOSTS : -GHOSTS - 1] = np.exp(-0.5 * np.diff(potential))
    fill(fields, -1, Remove())
    before = inner[0].copy()
    sweep(Kinetic(tilt.ravel(), 0.05), fields, -1, 1, 0.5)
    np.testing.assert_allclose(inner[0], before, rtol=1e-14)


def test_a_shifted_gaussian_in_a_harmonic_potential_has_one_slope() -> None:
    """The slope of ln q + V is one, so both sides of a face agree and no mass diffuses."""
    fields, inner = rows(30)
    x = 0.4 * (np.arange(30) - 14.5)
    inner[0] = np.exp(-0.5 * (x - 0.8) ** 2)
    tilt = np.ones(fields[0].shape)
    tilt[GHOSTS, GHOSTS : -GHOSTS - 1] = np.exp(-0.25 * np.diff(x**2))
    fill(fields, -1, Remove())
    centre = (inner[0] * x).sum()
    sweep(Kinetic(tilt.ravel(), 0.05), fields, -1, 1, 0.5)
    # The outermost cells, with 1e-7 of the mass, have no neighbour to take a slope from.
    assert (inner[0] * x).sum() == pytest.approx(centre, abs=1e-6)
