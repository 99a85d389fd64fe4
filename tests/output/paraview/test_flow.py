"""One flow in all places: equal to the field itself there, the lid's velocity on and beyond it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.analytic import analytic_flow
from ellipsoid_coupling.flow.outline import polygon_outline
from ellipsoid_coupling.output.paraview import export_flow
from ellipsoid_coupling.output.paraview.fields import HIDDEN_CELL
from ellipsoid_coupling.output.paraview.flow import start_lattice, stream_function
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene, load_scene


def read(path: Path) -> pyvista.DataSet:
    mesh = pyvista.read(path)
    assert isinstance(mesh, pyvista.DataSet)
    return mesh


def lid(
    x: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.asarray(np.sin(np.pi * np.clip(x, 0.0, 1.0)) ** 2)


def test_every_place_shows_the_field(lid_flow: FlowField, scene: Scene, tmp_path: Path) -> None:
    paths = export_flow(lid_flow, scene, tmp_path / "flow")
    assert [path.name for path in paths] == [
        "flow.vti",
        "flow_particles.vtp",
        "flow_cells.vti",
        "flow_ghost_particles.vtp",
        "flow_ghost_cells.vtp",
    ]
    for path in paths[:3]:
        mesh = read(path)
        at_cells = path.name == "flow_cells.vti"
        data = mesh.cell_data if at_cells else mesh.point_data
        places = mesh.cell_centers().points if at_cells else mesh.points
        sample = lid_flow.evaluate(places[:, 0], places[:, 1])
        # The same points up to rounding of the image's axes, and a velocity gradient of order 10.
        np.testing.assert_allclose(data["velocity"][:, 0], sample.velocity_x, atol=1e-13)
        np.testing.assert_allclose(data["velocity"][:, 1], sample.velocity_y, atol=1e-13)
        assert np.all(data["inside"] == 1)


def test_ghosts_see_the_walls_velocity(lid_flow: FlowField, scene: Scene, tmp_path: Path) -> None:
    paths = export_flow(lid_flow, scene, tmp_path)
    ghosts, cells = read(paths[3]), read(paths[4])
    assert isinstance(cells, pyvista.PolyData)
    for places, velocity in (
        (ghosts.points, ghosts.point_data["velocity"]),
        (cells.cell_centers().points, cells.cell_data["velocity"]),
    ):
        above = places[:, 1] > 0.75 - 1e-9
        assert above.any()
        # 16 cells: between its nodes, the spline keeps to the walls' velocities to 1e-3.
        np.testing.assert_allclose(velocity[above, 0], lid(places[above, 0]), atol=1e-3)
        np.testing.assert_allclose(velocity[~above], 0.0, atol=1e-3)
    areas = cells.compute_cell_sizes(length=False, volume=False).cell_data["Area"]
    np.testing.assert_allclose(areas, 0.125**2, rtol=1e-12)
    assert np.all(cells.cell_data["density"] > 0.0)


def test_particles_of_a_result_replace_the_start_box(
    lid_flow: FlowField, scene: Scene, particle_result: Result, tmp_path: Path
) -> None:
    lattice = read(export_flow(lid_flow, scene, tmp_path)[1])
    assert lattice.bounds[0] >= scene.start.x[0]
    mesh = read(export_flow(lid_flow, scene, tmp_path, particle_result)[1])
    np.testing.assert_array_equal(mesh.points[:, 0], particle_result.variables["x"][0, 0])


def test_start_lattice_is_even_and_about_as_many() -> None:
    scene = load_scene("rotation")
    x, y = start_lattice(scene)
    assert abs(x.size - scene.particles.number) <= 0.05 * scene.particles.number
    assert np.isclose(x.mean(), 0.45, rtol=1e-12)
    assert np.isclose(y.mean(), 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["top_bottom", "rotation"])
def test_unbounded_flow_is_shown_on_the_scenes_cells(name: str, tmp_path: Path) -> None:
    scene = load_scene(name, {"numerics.cell": 0.25})
    paths = export_flow(analytic_flow(name), scene, tmp_path)
    assert [path.name for path in paths] == ["flow.vti", "flow_particles.vtp", "flow_cells.vti"]
    mesh = read(paths[0])
    assert mesh.n_points == 13 * 13
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    psi = -x * y if name == "top_bottom" else 0.5 * (x**2 + y**2)
    # A quadratic is exact but for rounding at the size of the spline's one cell, 16.
    np.testing.assert_allclose(mesh.point_data["stream_function"], psi, atol=1e-12)


def test_cells_in_solids_are_hidden(lid_flow: FlowField, scene: Scene, tmp_path: Path) -> None:
    """Those of a square in the box, whose own walls hide none; without a solid nothing is marked."""
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.75], [0.0, 0.75]])
    square = np.array([[0.25, 0.25], [0.25, 0.5], [0.5, 0.5], [0.5, 0.25]])
    walls = ("walls", "wall", box, True)
    outline = polygon_outline([walls, ("solid", "wall", square, True)])
    mesh = read(export_flow(replace(lid_flow, outline=outline), scene, tmp_path)[0])
    expected = np.zeros((12, 16))
    expected[4:8, 4:8] = HIDDEN_CELL
    np.testing.assert_array_equal(mesh.cell_data["vtkGhostType"], expected.ravel())
    empty = replace(lid_flow, outline=polygon_outline([walls]))
    assert "vtkGhostType" not in read(export_flow(empty, scene, tmp_path)[0]).cell_data


def test_velocity_is_the_stream_functions_derivative(lid_flow: FlowField) -> None:
    # Central differences of step 1e-5 on third derivatives of order 100: good to 1e-8.
    x, y = np.array([0.3, 0.61]), np.array([0.2, 0.7])
    step = 1e-5
    along = stream_function(lid_flow, x + step, y) - stream_function(lid_flow, x - step, y)
    up = stream_function(lid_flow, x, y + step) - stream_function(lid_flow, x, y - step)
    sample = lid_flow.evaluate(*np.meshgrid(x, y))
    np.testing.assert_allclose(sample.velocity_x, up / (2 * step), atol=1e-7)
    np.testing.assert_allclose(sample.velocity_y, -along / (2 * step), atol=1e-7)
