"""Thin plates: no cell of the mesh shows them, and nothing may pass through them."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.plates import plates, without_plates
from ellipsoid_coupling.flow.polygons import Edges
from ellipsoid_coupling.flow.stream_function import Patch

DATA = Path(__file__).parents[1] / "data"
STILL = np.zeros((1, 2))


@pytest.fixture(scope="module")
def plated() -> FlowField:
    """A channel with a plate at x = 0.5 from the bottom to y = 0.5, made by createBaffles."""
    return read_case(DATA / "thin_plate")


def test_the_cells_at_a_plate_are_out_of_the_flow(plated: FlowField) -> None:
    """Exactly those beside it: the plate lies on a line of the grid, 20 cells wide and high."""
    expected = np.ones((20, 20), np.uint8)
    expected[:10, 9:11] = 0
    assert np.array_equal(plated.arrays.mask, expected)


# Two cells side by side, [0, 1] x [0, 1] and [1, 2] x [0, 1], and what is between them.
POINTS = np.array([[0.0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [1, 0], [1, 1]])
SHARED = Edges(np.array([[1, 4], [0, 1]]), np.array([[0, 1], [0, -1]]))
SPLIT = Edges(np.array([[1, 4], [6, 7], [0, 1]]), np.array([[0, -1], [1, -1], [0, -1]]))


@pytest.mark.parametrize(("edges", "count"), [(SHARED, 1), (SPLIT, 2)], ids=["shared", "split"])
def test_a_plate_is_found_whether_its_points_are_shared_or_not(edges: Edges, count: int) -> None:
    wall = Patch(np.array([[0.5, 0.0]]), STILL)
    assert plates(POINTS, edges, {"bottom": wall}).shape == (0, 2, 2)
    found = plates(POINTS, edges, {"bottom": wall, "plate": Patch(np.array([[1.0, 0.5]]), STILL)})
    assert np.array_equal(found, [[[1.0, 0.0], [1.0, 1.0]]] * count)


def test_a_slanting_plate_has_no_holes() -> None:
    """Every way across it passes a cell that is taken out: neighbours share a side."""
    nodes = np.linspace(0.0, 1.0, 11)
    plate = np.array([[[0.05, 0.13], [0.93, 0.71]]])
    kept = without_plates(np.ones((10, 10), np.bool_), nodes, nodes, plate)
    rows = [np.flatnonzero(~kept[:, column]) for column in range(10)]
    assert all(row.size for row in rows)
    assert all(np.intersect1d(*pair).size for pair in pairwise(rows))


@pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])
def test_nothing_passes_through_a_plate(plated: FlowField, model: str) -> None:
    """Particles below the plate's end are stopped at it, those above go by."""
    settings = {
        "domain.boundary": "open", "start.x": [0.1, 0.2], "start.y": [0.05, 0.3],
        "particles.number": 49, "particles.realisations": 1, "times": [0.6], "flow.drag": 1.0,
        "particles.length": 0.05, "particles.width": 0.025, "numerics.cell": 0.1,
    }  # fmt: skip
    scene = ec.load_scene("cavity_free", settings)
    result = ec.simulate(scene, model, "paper", flow=plated)
    x, y = result.variables["x"][-1, 0], result.variables["y"][-1, 0]
    stopped = (x >= 0.45) & (x <= 0.55) & (y < 0.5)
    assert np.all(result.variables["frozen"][-1, 0][stopped] == 1.0)
    assert not np.any((x > 0.55) & (y < 0.5))


def test_grids_do_not_run_through_a_plate(plated: FlowField) -> None:
    scene = ec.load_scene("cavity_free", {"domain.boundary": "open", "numerics.cell": 0.05})
    with pytest.raises(InputError, match="20 cells outside it, the first at"):
        ec.simulate(scene, "rho_mono_kinetic", flow=plated)
