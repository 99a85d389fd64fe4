"""The cells of a grid that hold some of the fluid, against points drawn in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ellipsoid_coupling.flow.fluid_cells import fluid_cells
from ellipsoid_coupling.flow.outline import polygon_outline

Array = NDArray[np.float64]

LINES = np.linspace(0.0, 10.0, 11)


def _cells(*parts: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """Of closed lines, the fluid on the left."""
    outline = polygon_outline(
        (str(k), "wall", np.array(part), True) for k, part in enumerate(parts)
    )
    return fluid_cells(outline.ends, LINES, LINES)


def test_a_rectangle_on_lines_takes_its_own_cells() -> None:
    found = _cells([(2.0, 3.0), (7.0, 3.0), (7.0, 5.0), (2.0, 5.0)])
    expected = np.zeros((10, 10), bool)
    expected[3:5, 2:7] = True
    np.testing.assert_array_equal(found, expected)


def test_a_solid_on_lines_loses_its_own_cells() -> None:
    """Clockwise around it; and one that is smaller than a cell takes none."""
    around = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    found = _cells(around, [(2.0, 5.0), (7.0, 5.0), (7.0, 3.0), (2.0, 3.0)])
    expected = np.ones((10, 10), bool)
    expected[3:5, 2:7] = False
    np.testing.assert_array_equal(found, expected)
    assert _cells(around, [(2.2, 5.6), (2.7, 5.6), (2.7, 5.3), (2.2, 5.3)]).all()


def test_a_sliver_between_lines_is_found() -> None:
    """No centre lies in it; it runs through corners of cells as well."""
    found = _cells([(0.5, 0.1), (9.5, 9.1), (9.5, 9.2), (0.5, 0.2)])
    row, column = np.nonzero(found)
    assert set(zip(row.tolist(), column.tolist(), strict=True)) == {
        cell for k in range(10) for cell in ((k, k), (k, k + 1)) if max(cell) < 10
    }


def test_a_plate_takes_nothing_away() -> None:
    """Both of its sides are edges: what one side ends the other begins."""
    around = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)])
    plate = np.array([(4.3, 1.2), (6.1, 8.4), (4.3, 1.2)])
    parts = [("rim", "wall", around, True), ("plate", "wall", plate, False)]
    assert fluid_cells(polygon_outline(parts).ends, LINES, LINES).all()


def test_no_point_of_a_round_fluid_is_left_out() -> None:
    """A ring of 40 edges, at odd places: every point in it is in a cell that is taken, and few more."""
    angle = 2.0 * np.pi * np.arange(40) / 40
    circle = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    outer, inner = 4.1 * circle + 5.03, 1.7 * circle[::-1] + 5.03
    found = _cells([tuple(p) for p in outer.tolist()], [tuple(p) for p in inner.tolist()])
    at = np.random.default_rng(0).uniform(0.0, 10.0, (20_000, 2))
    r = np.hypot(*(at - 5.03).T)
    fluid = (r > 1.7) & (r < 4.1 * np.cos(np.pi / 40))
    column, row = np.floor(at).astype(int).T
    assert found[row[fluid], column[fluid]].all()
    far = (r < 1.7 - np.sqrt(2.0)) | (r > 4.1 + np.sqrt(2.0))
    assert not found[row[far], column[far]].any()
