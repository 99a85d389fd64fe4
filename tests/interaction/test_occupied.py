"""Where mass is: intervals of rows and their rectangle, against a plain search."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.interaction.occupied import contains, occupied_box, occupied_extents


@pytest.mark.parametrize("seed", range(4))
def test_extents_and_box_hold_all_mass_and_no_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    density = rng.random((3, 7, 9)) * (rng.random((3, 7, 9)) < 0.08)
    extents = occupied_extents(density)
    for row, (first, end) in zip(density.reshape(21, 9), extents.reshape(21, 2), strict=True):
        held = np.flatnonzero(row)
        assert (first, end) == ((held[0], held[-1] + 1) if held.size else (9, 0))
    box = occupied_box(extents)
    _, j, i = np.nonzero(density)
    assert box == (slice(j.min(), j.max() + 1), slice(i.min(), i.max() + 1))


def test_nothing_has_no_box_and_not_a_number_is_mass() -> None:
    """A field that has gone wrong shall be found, not left out."""
    assert occupied_box(occupied_extents(np.zeros((2, 3, 4)))) is None
    density = np.zeros((1, 3, 4))
    density[0, 1, 2] = np.nan
    assert occupied_box(occupied_extents(density)) == (slice(1, 2), slice(2, 3))


def test_a_rectangle_contains_itself_and_smaller_ones() -> None:
    box = slice(1, 5), slice(2, 4)
    assert contains(box, box)
    assert contains(box, (slice(2, 3), slice(2, 4)))
    assert not contains((slice(2, 3), slice(2, 4)), box)
    assert not contains(box, (slice(2, 3), slice(1, 4)))
