"""Sorting of samples by rows of nodes, and back."""

from __future__ import annotations

import numpy as np

from ellipsoid_coupling.interaction.sample_splines import (
    STENCIL,
    Nodes,
    add_to,
    sort_by_row,
)

NODES = Nodes(-0.1, 0.2, 10.0, 12, 9)


def test_sorting_is_stable_and_leaves_out_what_is_beyond_the_nodes() -> None:
    """Against numpy's stable sort; a sample on the far edge, beyond it and nowhere among them."""
    rng = np.random.default_rng(0)
    place = rng.uniform(-0.3, 1.6, (7, 3, 50))
    place[2, 0, 3], place[3, 1, 4], place[4, :2, 5] = np.nan, np.inf, (-0.1, 0.2)
    slots = np.empty(350, np.int64)
    samples, begin = sort_by_row(place, NODES, slots)
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


def test_what_is_found_goes_back_to_its_sample() -> None:
    """Force by 1/m and torque by 1/I_c, added; nothing to samples beyond the nodes."""
    rng = np.random.default_rng(1)
    place = rng.uniform(-0.3, 1.6, (3, 3, 20))
    slots = np.empty(60, np.int64)
    samples, _ = sort_by_row(place, NODES, slots)
    force = np.ones_like(place)
    add_to(force, samples, (2.0, 3.0), slots)
    here = (slots >= 0).reshape(3, 1, 20)
    added = place * np.array([2.0, 2.0, 3.0])[:, None]
    np.testing.assert_array_equal(force, np.where(here, 1.0 + added, 1.0))
