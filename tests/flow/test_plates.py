"""Thin plates: no cell of the mesh shows them; their edges are there once for each side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.plates import with_patches
from ellipsoid_coupling.flow.polygons import Edges
from ellipsoid_coupling.flow.stream_function import Patch

DATA = Path(__file__).parents[1] / "data"
STILL = np.zeros((1, 2))

# Two cells side by side, [0, 1] x [0, 1] and [1, 2] x [0, 1], and what is between them.
POINTS = np.array([[0.0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [1, 0], [1, 1]])
SHARED = Edges(np.array([[1, 4], [0, 1]]), np.array([[0, 1], [0, -1]]))
SPLIT = Edges(np.array([[1, 4], [6, 7], [0, 1]]), np.array([[0, -1], [1, -1], [0, -1]]))
BOTTOM = Patch(np.array([[0.5, 0.0]]), STILL)
BETWEEN = np.array([[1.0, 0.5]])


@pytest.mark.parametrize("edges", [SHARED, SPLIT], ids=["shared", "split"])
@pytest.mark.parametrize("patches", [1, 2])
def test_both_sides_of_a_plate_are_edges(edges: Edges, patches: int) -> None:
    """Whether its points are shared or not, and whether its two faces are in one patch or in two."""
    plates = (
        {"plate": Patch(np.repeat(BETWEEN, 2, axis=0), np.zeros((2, 2)))}
        if patches == 1
        else {"front": Patch(BETWEEN, STILL), "back": Patch(BETWEEN, STILL)}
    )
    found, rim = with_patches(POINTS, edges, {"bottom": BOTTOM, **plates})
    plate = rim.edge[rim.patch > 0]
    ends = POINTS[found.points[plate]]
    assert np.array_equal(ends, [[[1.0, 0.0], [1.0, 1.0]]] * 2)
    assert sorted(found.cells[plate].tolist()) == [[0, -1], [1, -1]]
    assert sorted(zip(rim.patch.tolist(), rim.face.tolist(), strict=True)) == (
        [(0, 0), (1, 0), (1, 1)] if patches == 1 else [(0, 0), (1, 0), (2, 0)]
    )


def test_an_inner_edge_without_a_face_stays_one() -> None:
    found, rim = with_patches(POINTS, SHARED, {"bottom": BOTTOM})
    assert np.array_equal(found.points, SHARED.points)
    assert np.array_equal(found.cells, SHARED.cells)
    assert rim.edge.tolist() == [1]


def test_a_plate_in_a_case_has_two_sides() -> None:
    """A channel with a plate at x = 0.5 from the bottom to y = 0.5, made by createBaffles: 20 cells high.

    Its ten edges are there twice, the normals opposite; all of the rectangle is fluid, and the fluid
    rests at the plate within 2 % of the top speed on this mesh.
    """
    field = read_case(DATA / "thin_plate")
    assert field.outline is not None
    outline = field.outline
    plate = outline.patch == outline.names.index("plate")
    assert np.count_nonzero(plate) == 20
    np.testing.assert_allclose(outline.ends[plate][..., 0], 0.5, atol=1e-12)
    assert sorted(np.round(outline.normals()[plate][:, 0]).tolist()) == [-1.0] * 10 + [1.0] * 10
    assert not outline.outflow[plate].any()
    assert field.arrays.mask.all()
    y = np.linspace(0.05, 0.45, 41)
    at_plate = field.evaluate(np.full(41, 0.5), y)
    speed = np.hypot(at_plate.velocity_x, at_plate.velocity_y)
    assert speed.max() < 0.02 * field.largest_speed
