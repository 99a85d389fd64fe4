"""What bounds the fluid of a scene: patches, sides that cut the fluid, periodic sides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.geometry.edge_grid import ENDS, REFLECTS, SHIFTS, edge_ends
from ellipsoid_coupling.geometry.fluid_edges import FluidEdges, fluid_edges
from ellipsoid_coupling.scenes import Scene
from tests.outlined_flows import SQUARE, channel_outline, circle, corners, solid

OUTLINE = channel_outline(solid(SQUARE))


def scene(x: list[float], y: list[float], **changes: Any) -> Scene:
    inside = {"start.x": [x[0], x[0] + 0.1], "start.y": [y[0], y[0] + 0.1]}
    return ec.load_scene("rotation", {"domain.x": x, "domain.y": y, **inside, **changes})


def held(edges: FluidEdges) -> dict[str, Any]:
    """The act and the length of the edges of each boundary that has any."""
    grid = edges.grid
    way = np.diff(edge_ends(grid), axis=1)[:, 0]
    length = np.hypot(way[:, 0], way[:, 1])
    return {
        edges.names[p]: (
            int(grid.acts[grid.patches == p][0]),
            float(length[grid.patches == p].sum()),
        )
        for p in np.unique(grid.patches)
    }


def test_where_the_domain_is_the_case_patches_say_all() -> None:
    """Acts by type or by name; no side of the domain is an edge."""
    found = held(fluid_edges(scene([0.0, 4.0], [0.0, 1.0]), OUTLINE))
    assert found == {
        "floor": (REFLECTS, 4.0), "outlet": (ENDS, 1.0), "ceiling": (REFLECTS, 4.0),
        "inlet": (ENDS, 1.0), "solid": (REFLECTS, pytest.approx(0.8)),
    }  # fmt: skip
    named = scene([0.0, 4.0], [0.0, 1.0], **{"boundaries.solid.kind": "stick"})
    assert held(fluid_edges(named, OUTLINE))["solid"][0] == ENDS


def test_sides_that_cut_the_fluid_are_edges_of_their_own_kind() -> None:
    """A domain smaller than the case, and one that is larger on one side."""
    cut = scene([0.5, 3.0], [0.0, 0.8], **{"boundaries.top.kind": "reflect"})
    found = held(fluid_edges(cut, OUTLINE))
    same = 1e-5 * 2.5
    assert set(found) == {"floor", "solid", "left", "right", "top"}
    assert found["top"] == (REFLECTS, pytest.approx(2.5, abs=9 * same))
    assert found["left"] == (ENDS, pytest.approx(0.8, abs=9 * same))
    wide = held(fluid_edges(scene([-1.0, 4.0], [0.0, 1.0]), OUTLINE))
    assert set(wide) == {"floor", "outlet", "ceiling", "inlet", "solid", "left", "bottom", "top"}
    # Beside the case, where nobody can be.
    assert wide["bottom"] == (ENDS, pytest.approx(1.0, abs=9e-5 * 5.0))


def test_periodic_sides_shift_by_the_period() -> None:
    periodic = {"boundaries.left.kind": "periodic", "boundaries.right.kind": "periodic"}
    edges = fluid_edges(scene([0.0, 4.0], [0.0, 1.0], **periodic), OUTLINE)
    found = held(edges)
    assert set(found) == {"floor", "ceiling", "solid", "left", "right"}
    assert found["left"][0] == found["right"][0] == SHIFTS
    shifts = edges.grid.shifts[edges.grid.acts == SHIFTS]
    assert sorted(map(tuple, shifts)) == [(-4.0, 0.0), (4.0, 0.0)]


def test_a_periodic_patch_elsewhere_is_refused() -> None:
    outline = OUTLINE._replace(types=("cyclic", *OUTLINE.types[1:]))
    with pytest.raises(InputError, match=r"periodic sides .* patch floor is periodic"):
        fluid_edges(scene([0.0, 4.0], [0.0, 1.0]), outline)


def test_every_place_is_where_the_outline_and_the_domain_say() -> None:
    """Cells that are all solid are marked, and hold no place in the fluid."""
    edges = fluid_edges(scene([0.0, 3.0], [0.0, 1.0]), OUTLINE)
    rng = np.random.default_rng(6)
    x, y = rng.uniform(-0.1, 4.1, 5000), rng.uniform(-0.1, 1.1, 5000)
    in_square = (x > 1.0) & (x < 1.2) & (y > 0.4) & (y < 0.6)
    fluid = (x > 0.0) & (x < 3.0) & (y > 0.0) & (y < 1.0) & ~in_square
    assert np.array_equal(edges.inside(x, y), fluid)
    grid = edges.grid
    column = ((x - grid.x_low) * grid.per_length).astype(int)
    row = ((y - grid.y_low) * grid.per_length).astype(int)
    within = (column >= 0) & (column < grid.columns) & (row >= 0) & (row < grid.rows)
    clear = grid.clearance[(row * grid.columns + column)[within]]
    assert not fluid[within][clear < 0.0].any()
    assert (clear < 0.0).any()


def test_walls_are_what_reflects_or_is_named() -> None:
    """All of them; those of a patch; those that lie on a side; none is refused."""
    edges = fluid_edges(scene([0.0, 4.0], [0.0, 1.0]), OUTLINE)
    assert len(edges.walls(None)) == 6
    assert len(edges.walls(("solid",))) == 4
    np.testing.assert_array_equal(edges.walls(("bottom",)), [[[0.0, 0.0], [4.0, 0.0]]])
    with pytest.raises(InputError, match="walls that reflect"):
        edges.walls(("outlet",))


def test_a_curved_wall_within_a_larger_domain() -> None:
    """A disk in a square: its edges are all that a particle meets."""
    outline = polygon_outline([("rim", "wall", circle(1.0, 64), True)])
    edges = fluid_edges(scene([-2.0, 2.0], [-2.0, 2.0]), outline)
    assert held(edges)["rim"][1] == pytest.approx(128.0 * np.sin(np.pi / 64))
    assert edges.ends_any
    closed = scene([-1.0, 1.0], [-1.0, 1.0], **{"domain.boundary": "reflecting"})
    square = polygon_outline([("rim", "wall", corners((-1.0, 1.0), (-1.0, 1.0)), True)])
    assert not fluid_edges(closed, square).ends_any
