"""The table of ghost cells: against what a mirror and a ring are, cell by cell."""

from __future__ import annotations

import numpy as np
import pytest

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.geometry.boundaries import (
    Boundaries,
    Periodic,
    Place,
    Reflect,
    Remove,
    at_side,
    box_of_sides,
    everywhere,
    ghost,
    register_boundary,
    scene_boundaries,
)
from ellipsoid_coupling.geometry.boundaries.contract import make_kind
from ellipsoid_coupling.geometry.ghost_table import (
    EDGE,
    GHOST,
    IMAGE,
    NEXT_GHOST,
    NEXT_IMAGE,
    NORMAL,
    STRIDE,
    WIDTH,
    ghost_table,
)
from ellipsoid_coupling.scenes import load_scene
from ellipsoid_coupling.scenes.sides import SIDES, keys_of, known_kinds

SHAPE, LAYERS = (3, 6), 2


@pytest.mark.parametrize("kind", [Reflect(), Remove(), Periodic()])
def test_every_ghost_has_its_image(kind: object) -> None:
    """Numbers of cells, padded by numpy as a mirror or a ring, are what the table leads to."""
    padded = np.arange((SHAPE[0] + 4) * (SHAPE[1] + 4)).reshape(SHAPE[0] + 4, SHAPE[1] + 4)
    inner = padded[2:-2, 2:-2]
    expected = np.pad(inner, 2, mode="wrap" if isinstance(kind, Periodic) else "symmetric")
    edges = np.pad(inner, 2, mode="edge")
    found, edge = padded.copy(), padded.copy()
    for row in ghost_table(everywhere(kind), SHAPE, LAYERS).cells:
        for layer in range(LAYERS):
            for i in range(row[WIDTH]):
                at = row[GHOST] + layer * row[NEXT_GHOST] + i * row[STRIDE]
                found.flat[at] = row[IMAGE] + layer * row[NEXT_IMAGE] + i * row[STRIDE]
                edge.flat[at] = row[EDGE] + i * row[STRIDE]
    for own, wanted in ((found, expected), (edge, edges)):
        for ghosts in (np.s_[2:-2, :2], np.s_[2:-2, -2:], np.s_[:2, 2:-2], np.s_[-2:, 2:-2]):
            np.testing.assert_array_equal(own[ghosts], wanted[ghosts])


def test_normals_and_places() -> None:
    """Inner normals; faces in the middle of each cell's edge, exact."""
    table = ghost_table(everywhere(Remove()), SHAPE, LAYERS, (-1.0, 2.0), 0.5)
    assert list(table.cells[:, NORMAL]) == [1, -1, 1, -1]
    first = [(-1.0, 2.25), (2.0, 2.25), (-0.75, 2.0), (-0.75, 3.5)]
    np.testing.assert_array_equal(table.places[:, :2], first)
    np.testing.assert_array_equal(table.places[:, 2:], [(0.0, 0.5)] * 2 + [(0.5, 0.0)] * 2)


def test_what_a_ghost_holds() -> None:
    """The formulas, by hand; an open edge is a wall to what would come in."""
    edge, image, place = (1.0, 0.5, 0.2, 7.0), (2.0, 0.6, 0.3, 8.0), Place(0.0, 0.0, 0.0)
    turned = (2.0, -0.6, 0.3, 8.0)
    assert ghost(Reflect(), edge, image, 1.0, 0.0, place) == turned
    assert ghost(Periodic(), edge, image, 1.0, 0.0, place) == image
    assert ghost(Remove(), edge, image, 1.0, 0.0, place) == turned
    assert ghost(Remove(), edge, image, -1.0, 0.0, place) == edge


def test_scene_files_and_formulas_know_the_same_kinds() -> None:
    for name in ("periodic", "reflect", "remove", "stick"):
        assert name in known_kinds()
        assert at_side(make_kind(name, {})) == keys_of(name).particles


def test_a_name_is_taken_once() -> None:
    with pytest.raises(ValueError, match="another kind of boundary named 'remove'"):
        register_boundary("remove", Place, lambda *cells: cells[1], particles="leave")


def test_each_side_of_a_scene_has_its_kind() -> None:
    """domain.boundary is the short form for the sides that [boundaries] does not name."""
    scene = load_scene("rotation", {"boundaries.left.kind": "reflect"})
    assert scene_boundaries(scene) == Boundaries(Reflect(), Remove(), Remove(), Remove())
    np.testing.assert_array_equal(
        box_of_sides(scene, "reflect"), [[-1.5, np.inf], [-np.inf, np.inf]]
    )
    assert box_of_sides(load_scene("rotation"), "reflect") is None
    assert tuple(scene.sides) == SIDES


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"boundaries.left.kind": "periodic"}, r"opposite .* left alone \(right: remove\)"),
        (
            {"boundaries.top.kind": "closed"},
            r"boundaries\.top\.kind: expected one of .*periodic, reflect",
        ),
        (
            {"boundaries.top.kind": "remove", "boundaries.top.speed": 1.0},
            r"keys of remove \(none\)",
        ),
        ({"boundaries.top.speed": 1.0}, r"boundaries\.top\.kind: expected a value"),
        ({"walls.sides": ["left"]}, "not remove on the left"),
    ],
)
def test_sides_that_are_wrong_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_scene("rotation", changes)
