"""Sorting of samples by rows of nodes, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from ellipsoid_coupling.compiled.buffers import BufferPool
from ellipsoid_coupling.compiled.loops import round_up_to_vectors
from ellipsoid_coupling.interaction.particle_mesh.splines import (
    STENCIL,
    Nodes,
    add_to,
    deposit,
    interpolate,
    sort_by_row,
)

Array = NDArray[Any]

NODES = Nodes(-0.1, 0.2, 10.0, 12, 9)


def test_sorting_is_stable_and_leaves_out_what_is_beyond_the_nodes() -> None:
    """Against numpy's stable sort; a sample on the far edge, beyond it and nowhere among them."""
    rng = np.random.default_rng(0)
    place = rng.uniform(-0.3, 1.6, (7, 3, 50))
    place[2, 0, 3], place[3, 1, 4], place[4, :2, 5] = np.nan, np.inf, (-0.1, 0.2)
    slots = np.empty(350, np.int64)
    samples, begin, corner, extent = sort_by_row(place, NODES, slots, BufferPool())
    flat = place.transpose(0, 2, 1).reshape(-1, 3)
    with np.errstate(invalid="ignore"):
        column = np.floor((flat[:, 0] - NODES.x_low) * NODES.inverse_h) - 1.0
        row = np.floor((flat[:, 1] - NODES.y_low) * NODES.inverse_h) - 1.0
        inside = (column >= 0) & (column <= NODES.columns - STENCIL)
        inside &= (row >= 0) & (row <= NODES.rows - STENCIL)
    which = np.flatnonzero(inside)
    order = which[np.argsort(row[which], kind="stable")]
    assert 0 < order.size < 350
    np.testing.assert_array_equal(samples, flat[order])
    np.testing.assert_array_equal(slots[order], np.arange(order.size))
    assert np.all(slots[~inside] == -1)
    np.testing.assert_array_equal(np.diff(begin), np.bincount(row[which].astype(int), minlength=12))
    firsts = np.array([row[which], column[which]], np.int64)
    assert list(corner) == firsts.min(axis=1).tolist()
    assert list(extent) == (np.ptp(firsts, axis=1) + STENCIL).tolist()


def test_what_is_found_goes_back_to_its_sample() -> None:
    """Force by 1/m and torque by 1/I_c, added; nothing to samples beyond the nodes."""
    rng = np.random.default_rng(1)
    place = rng.uniform(-0.3, 1.6, (3, 3, 20))
    slots = np.empty(60, np.int64)
    samples = sort_by_row(place, NODES, slots, BufferPool()).samples
    force = np.ones_like(place)
    add_to(force, samples, (2.0, 3.0), slots)
    here = (slots >= 0).reshape(3, 1, 20)
    added = place * np.array([2.0, 2.0, 3.0])[:, None]
    np.testing.assert_array_equal(force, np.where(here, 1.0 + added, 1.0))


def naive_weights(samples: Array) -> tuple[Array, Array, Array]:
    """B, dB/dx and dB/dy of every sample at every node, (n, rows, columns), from scipy's B-spline."""
    spline = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False)
    slope = spline.derivative()
    across = (samples[:, :1] - NODES.x_low) * NODES.inverse_h - np.arange(NODES.columns)
    up = (samples[:, 1:2] - NODES.y_low) * NODES.inverse_h - np.arange(NODES.rows)
    (b_x, d_x), (b_y, d_y) = (
        (np.nan_to_num(spline(t)), NODES.inverse_h * np.nan_to_num(slope(t))) for t in (across, up)
    )
    pairs = (b_y, b_x), (b_y, d_x), (d_y, b_x)
    value, along_x, along_y = (np.einsum("nj,ni->nji", y, x) for y, x in pairs)
    return value, along_x, along_y


def naive_basis(angle: Array, harmonics: int) -> tuple[Array, Array]:
    """b_p and db_p/dtheta, (n, 2M + 1) each."""
    basis, slopes = [np.ones_like(angle)], [np.zeros_like(angle)]
    for m in range(1, harmonics + 1):
        c, s = np.cos(2 * m * angle), np.sin(2 * m * angle)
        basis += [c, s]
        slopes += [-2 * m * s, 2 * m * c]
    return np.array(basis).T, np.array(slopes).T


@pytest.mark.parametrize("harmonics", [0, 1, 2, 7])
@pytest.mark.parametrize("count", [5, 12_000])
def test_to_the_nodes_and_back_against_scipy(harmonics: int, count: int) -> None:
    """To rounding: one part or four of the samples; odd and even numbers of harmonics, and none."""
    rng, room = np.random.default_rng(2), BufferPool()
    functions = 2 * harmonics + 1
    place = rng.uniform([[0.01], [0.31], [-9.0]], [[0.59], [1.19], [9.0]], (1, 3, count))
    # Part of the nodes only, and where some are left out on all sides.
    place[:, :2] = np.array([0.1, 0.3])[:, None] + 0.6 * place[:, :2]
    place = place if harmonics else place[:, :2].copy()
    here = sort_by_row(place, NODES, np.empty(count, np.int64), room)
    samples = here.samples
    assert len(samples) == count
    (row, column), (rows, columns) = here.corner, here.extent
    part = slice(row, row + rows), slice(column, column + columns)
    angle = samples[:, 2] if harmonics else np.zeros(count)
    basis, slopes = naive_basis(angle, harmonics)
    value, along_x, along_y = naive_weights(samples)
    for _ in range(2):
        # The second time in memory that is not new.
        sources = deposit(here, NODES, functions, 0.5, room)
        expected = 0.5 * np.einsum("nji,np->pji", value, basis)
        assert np.count_nonzero(expected) == np.count_nonzero(expected[:, *part])
        expected = expected[:, *part]
        np.testing.assert_allclose(sources, expected, atol=1e-12 * np.abs(expected).max())
    potential = np.zeros((NODES.rows, NODES.columns, round_up_to_vectors(functions)))
    potential[..., :functions] = rng.standard_normal((NODES.rows, NODES.columns, functions))
    here_only = np.ascontiguousarray(potential[part])
    found = interpolate(samples, NODES, here.corner, here_only, functions, room)
    lanes = potential[..., :functions]
    parts = (along_x, basis), (along_y, basis), (value, slopes)
    for k in range(place.shape[1]):
        by_place, by_angle = parts[k]
        exact = -np.einsum("nji,np,jip->n", by_place, by_angle, lanes, optimize=True)
        np.testing.assert_allclose(found[:, k], exact, atol=1e-12 * np.abs(exact).max())
