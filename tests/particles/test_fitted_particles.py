"""The particles that a motion is fitted to: spread over all, also where they stand in rows and columns."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.particles.collisions import _FITTED, _fitted


@pytest.mark.parametrize(("rows", "columns"), [(1024, 64), (257, 257), (400, 400), (128, 1)])
def test_no_column_has_many_of_them(rows: int, columns: int) -> None:
    """All of them in one column would leave the motion across it open."""
    total = rows * columns
    chosen = np.array([_fitted(number, total) for number in range(min(total, _FITTED))])
    assert np.unique(chosen).size == chosen.size
    assert chosen.min() >= 0
    assert chosen.max() < total
    in_column = np.bincount(chosen % columns, minlength=columns)
    assert in_column.max() <= max(8, chosen.size // columns + 4)
    in_row_of_blocks = np.bincount(chosen * 8 // total, minlength=8)
    assert in_row_of_blocks.min() >= 14
