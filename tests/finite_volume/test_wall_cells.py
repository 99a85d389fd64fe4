"""Cells at tilted walls: which they are, and what they lose; tests/workflows/test_tilted_wall.py slides."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.finite_volume.fluid_lines import Ends, line_tables
from ellipsoid_coupling.finite_volume.fluxes.in_fluid import FluidMotion
from ellipsoid_coupling.finite_volume.grid import GHOSTS, Grid
from ellipsoid_coupling.finite_volume.wall_cells import WallCells, wall_cells
from ellipsoid_coupling.flow.outline import Outline, polygon_outline
from ellipsoid_coupling.geometry.boundaries import Reflect, Remove
from ellipsoid_coupling.geometry.fluid_cells import fluid_cells
from tests.staircase_flows import box, circle

Floats = NDArray[np.float64]
GRID = Grid(-1.0, -1.0, 0.1, 20, 20)


def found(outline: Outline, kind: object = Reflect()) -> WallCells | None:
    edges = len(outline.ends)
    ends = Ends(
        ("wall", "side"), (kind, Reflect()), np.zeros(edges, np.int64), np.ones(4, np.int64)
    )
    cells = fluid_cells(outline, GRID.x, GRID.y, GRID.cell)
    tables, _ = line_tables(cells, ends, GRID)
    return wall_cells(cells, ends, outline.normals(), tables)


def round_hole() -> Outline:
    return polygon_outline([("wall", "wall", circle(0.47, 180, -1), True)])


def place(walls: WallCells) -> tuple[Floats, Floats]:
    """The centres of the cells."""
    row, column = np.divmod(walls.cell, GRID.padded[1])
    return GRID.x[column - GHOSTS], GRID.y[row - GHOSTS]


def test_walls_along_the_axes_and_open_ones_have_none() -> None:
    """A box around the fluid, with its corners, and a square hole; a hole that nothing reflects at."""
    hole = box(0.42, 0.42)[::-1]
    straight = polygon_outline([("out", "wall", box(0.95, 0.93), True), ("in", "wall", hole, True)])
    assert found(straight) is None
    assert found(round_hole(), Remove()) is None


def test_those_of_a_cylinder_are_the_cells_beside_it_with_its_normals() -> None:
    """All that touch it by a face; normals towards its axis, as far as edges beside a cell are apart."""
    walls = found(round_hole())
    assert walls is not None
    x, y = place(walls)
    solid = np.hypot(*np.meshgrid(GRID.x, GRID.y)) < 0.47
    beside = np.zeros_like(solid)
    for axis in (0, 1):
        for way in (-1, 1):
            beside |= np.roll(solid, way, axis) & ~solid
    assert walls.cell.size == np.count_nonzero(beside)
    r = np.hypot(x, y)
    cosine = -(walls.normal[0] * x + walls.normal[1] * y) / r
    assert (r < 0.47 + 0.1).all()
    assert cosine.min() > 0.98
    np.testing.assert_allclose(np.hypot(*walls.normal), 1.0, rtol=1e-14)


def test_what_goes_into_the_wall_is_lost_and_no_more() -> None:
    """Along the wall, out of it and what the fluid does itself stay to rounding; so does the density."""
    walls = found(round_hole())
    assert walls is not None
    rng = np.random.default_rng(7)
    fluid = rng.normal(size=(2, walls.cell.size))
    motion: dict[int, FluidMotion | None] = {}
    for axis, speed in zip((-1, -2), fluid, strict=True):
        lower = np.zeros(walls.whole[axis].size + 8)
        lower[walls.slots[axis]] = speed
        motion[axis] = FluidMotion(lower, lower, 0.5, 0.0)
    fields = np.zeros((3, 2, *GRID.padded))
    flat = fields.reshape(3, 2, -1)
    density = rng.uniform(0.5, 2.0, (2, walls.cell.size))
    own = rng.normal(size=(2, 2, walls.cell.size))
    flat[0][:, walls.cell] = density
    for k in (0, 1):
        flat[1 + k][:, walls.cell] = density * (fluid[k] + own[k])
    walls.slide(fields, (1, 2), motion, in_fluid=True)
    np.testing.assert_array_equal(flat[0][:, walls.cell], density)
    left = np.stack([flat[1 + k][:, walls.cell] / density - fluid[k] for k in (0, 1)])
    normal = walls.normal[:, None]
    into, after = (own * normal).sum(axis=0), (left * normal).sum(axis=0)
    np.testing.assert_allclose(after, np.minimum(into, 0.0), atol=1e-14)
    across = np.stack((-normal[1], normal[0]))
    np.testing.assert_allclose((left * across).sum(axis=0), (own * across).sum(axis=0), atol=1e-14)


@pytest.mark.parametrize("axis", [-1, -2])
def test_all_of_the_fluid_is_that_of_the_walls_cells_and_their_ghosts_only(axis: int) -> None:
    walls = found(round_hole())
    assert walls is not None
    size = walls.whole[axis].size
    faces = np.arange(1.0, size + 9.0)
    motion = walls.with_all_fluid(FluidMotion(faces, -faces, 0.25, 1.0), axis)
    whole = np.pad(walls.whole[axis], (0, 8))
    np.testing.assert_array_equal(motion.lower, np.where(whole, 4.0 * faces, faces))
    np.testing.assert_array_equal(motion.upper, np.where(whole, -4.0 * faces, -faces))
    # A cell that ends a line has a ghost beside it.
    assert whole.sum() > walls.cell.size
    assert faces[0] == 1.0
