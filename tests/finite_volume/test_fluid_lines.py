"""Lines of a staircase: which cells they have, what closes them, and what flows through their ends."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.finite_volume.fluid_faces import CellFaces, corner_values, line_motion
from ellipsoid_coupling.finite_volume.fluid_lines import Ends, LineTable, line_tables
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.geometry.boundaries import Periodic, Reflect, Remove
from ellipsoid_coupling.geometry.fluid_cells import fluid_cells
from tests.staircase_flows import couette_ring, past_cylinder

GRID = Grid(0.0, 0.0, 1.0, 6, 4)
SIDES = np.arange(1, 5)


def ends(left: object = Remove(), bottom: object = Reflect()) -> Ends:
    kinds = (Reflect(), left, left, bottom, bottom)
    return Ends(("solid", "left", "right", "bottom", "top"), kinds, np.zeros(4, np.int64), SIDES)


def lines_with_a_hole(here: Ends) -> dict[int, LineTable]:
    """Cells (1, 2) and (1, 3), as row and column, are solid."""
    hole = np.array([[2.0, 1.0], [4.0, 1.0], [4.0, 2.0], [2.0, 2.0]])[::-1]
    cells = fluid_cells(polygon_outline([("solid", "wall", hole, True)]), GRID.x, GRID.y, 1.0)
    return line_tables(cells, here, GRID)[0]


def covered(table: LineTable, shape: tuple[int, int]) -> np.ndarray:
    """How many lines each cell is in."""
    count = np.zeros(shape, int)
    line, place = table.places()
    np.add.at(count, (table.rows[line], place), 1)
    return count


def test_lines_go_from_boundary_to_boundary() -> None:
    tables = lines_with_a_hole(ends())
    x, y = tables[-1], tables[-2]
    assert x.length.tolist() == [6, 2, 2, 6, 6]
    assert x.start.tolist() == [0, 0, 4, 0, 0]
    assert x.boundary.tolist() == [[1, 2], [1, 0], [0, 2], [1, 2], [1, 2]]
    assert y.length.tolist() == [4, 4, 1, 2, 1, 2, 4, 4]
    # The middles of the faces at both ends, x and y.
    assert x.faces[1].tolist() == [[0.0, 1.5], [2.0, 1.5]]
    assert y.faces[3].tolist() == [[2.5, 2.0], [2.5, 4.0]]
    expected = np.ones((4, 6), int)
    expected[1, 2:4] = 0
    np.testing.assert_array_equal(covered(x, (4, 6)), expected)
    np.testing.assert_array_equal(covered(y, (6, 4)).T, expected)


def test_a_periodic_line_goes_on_at_the_other_side_and_a_free_one_is_a_ring() -> None:
    x = lines_with_a_hole(ends(left=Periodic()))[-1]
    assert x.ring.tolist() == [True, False, True, True]
    assert x.length.tolist() == [6, 4, 6, 6]
    assert x.start[1] == 4
    assert x.boundary[1].tolist() == [0, 0]
    np.testing.assert_array_equal(covered(x, (4, 6)).sum(axis=1), [6, 4, 6, 6])


@pytest.mark.parametrize("name", ["ring", "cylinder"])
def test_what_flows_through_a_cells_faces_sums_to_zero(name: str) -> None:
    """To rounding of psi over h in every cell of the fluid, stairs included; and is 0 through walls."""
    flow, half = (couette_ring(), 1.0) if name == "ring" else (past_cylinder(), 2.0)
    n = 40
    grid = Grid(-half, -half, 2.0 * half / n, n, n)
    assert flow.outline is not None
    cells = fluid_cells(flow.outline, grid.x, grid.y, grid.cell)
    kinds = tuple(Reflect() if kind == "wall" else Remove() for kind in flow.outline.types)
    here = Ends((*flow.outline.names, *"lrbt"), (*kinds, *[Remove()] * 4), flow.outline.patch,
                len(kinds) + np.arange(4))  # fmt: skip
    corners = corner_values(flow, cells, here, grid)
    faces = {axis: CellFaces(corners, cells, here, grid.cell, axis) for axis in (-1, -2)}
    total = sum(faces[axis].values[1] - faces[axis].values[0] for axis in faces)
    assert abs(total).max() < 1e-12
    for axis in faces:
        for end in range(2):
            walls = here.reflects(faces[axis].boundary[end])
            assert walls.any()
            assert (faces[axis].values[end][walls] == 0.0).all()
    # Away from walls the mean is the fluid's velocity, to second order: h^2/24 of its third derivative.
    x, y = np.meshgrid(grid.x, grid.y)
    r, sample = np.hypot(x, y), flow.evaluate(x, y)
    away = cells.inside & (abs(r - 0.5) > 0.15) & (abs(r - 0.97) > 0.15)
    error = np.abs(faces[-1].mean - sample.velocity_x)[away].max()
    assert 1e-7 < error < 0.02


def test_the_fluid_in_ghosts_is_mirrored_in_walls_and_copied_where_it_leaves() -> None:
    tables = lines_with_a_hole(ends())
    values = np.zeros((2, 4, 6))
    # Row 1 flows to the left, out of the domain: U = -3, -1 and 0 at the faces of cells 0 and 1.
    values[:, 1, 0], values[:, 1, 1] = (-3.0, -1.0), (-1.0, 0.0)
    kinds = (Reflect(), Remove(), Periodic())
    motion = line_motion(values, tables[-1], kinds, -1)
    slot = tables[-1].slot[1]
    line = slice(slot, slot + 2 + 2 * GHOSTS)
    assert motion.lower[line].tolist() == [-3.0, -3.0, -3.0, -1.0, 0.0, 1.0]
    assert motion.upper[line].tolist() == [-1.0, -1.0, -1.0, 0.0, 1.0, 3.0]
