"""Exports lie where the mesh of their case lies: in its plane, at its place, with its own vectors.

A cylinder in a channel, turned into other planes and moved far off the origin.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, FlowSeries, load_flow
from ellipsoid_coupling.flow.case_plane import FLAT, CasePlane
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.output.new_scene import scene_of_case
from ellipsoid_coupling.output.paraview import export
from ellipsoid_coupling.output.paraview.fields import cell_image
from ellipsoid_coupling.output.paraview.placed import placed
from ellipsoid_coupling.output.scene_choices import Wishes
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from tests.flow.openfoam.mutants import Array, Whole, mapped, whole_of, write
from tests.output.paraview.test_open_in_paraview import Recorder, opened

DATA = Path(__file__).parents[2] / "data"
AWAY = (50.0, -30.0, 7.0)
# Which of x, y, z of the first case stands along x, y, z.
PLANES = {"x-y": (0, 1, 2), "x-z": (0, 2, 1), "y-z": (2, 0, 1), "z-y": (2, 1, 0)}


def turned_case(plane: str) -> Whole:
    matrix = np.zeros((3, 3))
    matrix[range(3), PLANES[plane]] = 1.0
    return mapped(whole_of(DATA / "cylinder_8"), matrix, AWAY)


def cell_centres(case: Whole) -> Array:
    """(C, 3), the means of the cells' corners."""
    cells: list[set[int]] = [set() for _ in case.velocity]
    for face, owner, neighbour in zip(case.faces, case.owner, case.neighbour, strict=True):
        cells[owner] |= set(face.tolist())
        if neighbour >= 0:
            cells[neighbour] |= set(face.tolist())
    return np.array([case.points[list(cell)].mean(axis=0) for cell in cells])


def walled_scene(text: str) -> Scene:
    """The scene that `ellipsoid new` writes for a case, with interaction and walls."""
    found = tomllib.loads(text)
    found |= {"times": [1.0], "interaction": {"strength": 1.0}, "walls": {}}
    del found["flow"]["case"]
    return ec.load_scene(found | {"flow": found["flow"] | {"source": "given"}})


def particles_at(centres: Array, scene: Scene, flow: FlowField) -> Result:
    """A result whose particles lie in the middle of the mesh's cells, axes along the first axis."""
    x, y = centres[:, flow.plane.axes[0]], centres[:, flow.plane.axes[1]]
    still = np.zeros((1, 1, x.size))
    names = ("angle", "velocity_x", "velocity_y", "angular_velocity")
    variables = {"x": x[None, None], "y": y[None, None]} | dict.fromkeys(names, still)
    variables["velocity_x"] = still + 1.0
    told = {"status": "completed", "seed": 0, "resolution": "one a cell"}
    return Result(
        scene, "microscopic", "accurate", "particles", np.array([1.0]), variables, {}, told
    )


@pytest.mark.parametrize("plane", PLANES)
def test_an_export_lies_in_its_mesh(
    plane: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Places within the mesh's bounds, U in the cells as the case has it (to the 5 % of every flow)."""
    case = turned_case(plane)
    folder = write(case, tmp_path / "case")
    flow, text = read_case(folder), scene_of_case(folder, Wishes())
    scene = walled_scene(text)
    assert ("# x and y are the case's" in text) == (plane != "x-y")
    assert plane == "x-y" or " and ".join(sorted(plane[::2])) in text
    centres, low, high = cell_centres(case), case.points.min(axis=0), case.points.max(axis=0)
    files = export(particles_at(centres, scene, flow), tmp_path / "paraview", flow)
    normal = flow.plane.normal
    thin = int(np.argmin(high - low))
    assert normal == thin
    meshes = {path.name: pyvista.read(path) for path in files.glob("*.vt[ip]")}
    assert {"flow.vti", "flow_particles.vtp", "flow_cells.vti", "flow_ghost_particles.vtp",
            "walls.vtp", "particles_0000.vtp", "ellipses_0000.vtp",
            "histogram_0000.vti"} == set(meshes)  # fmt: skip
    # Ellipses reach beyond a wall by half a length, the domain beyond the mesh by less than a cell.
    beyond = scene.particles.length + scene.numerics.cell
    for name, mesh in meshes.items():
        assert isinstance(mesh, pyvista.DataSet)
        exact = name in ("flow.vti", "walls.vtp", "particles_0000.vtp", "flow_particles.vtp")
        rim = 1e-9 * np.abs(case.points).max() if exact else beyond
        at = np.asarray(mesh.points)
        assert np.all((at >= low - rim) & (at <= high + rim)), name
        np.testing.assert_allclose(at[:, normal], 0.5 * (low + high)[normal], rtol=1e-12)
        for data in (mesh.point_data, mesh.cell_data):
            for vector in {"velocity", "orientation"} & set(data):
                assert not np.any(data[vector][:, normal]), (name, vector)
    np.testing.assert_allclose(
        np.delete(meshes["particles_0000.vtp"].points, normal, axis=1),
        np.delete(centres, normal, axis=1),
        rtol=1e-14,
    )
    found = meshes["flow_particles.vtp"].point_data["velocity"]
    assert np.linalg.norm(found - case.velocity) < 0.05 * np.linalg.norm(case.velocity)
    along = np.eye(3)[flow.plane.axes[0]]
    for name in ("orientation", "velocity"):
        np.testing.assert_array_equal(
            meshes["particles_0000.vtp"].point_data[name], np.tile(along, (len(centres), 1))
        )
    ghosts_lie_on_walls(meshes["flow_ghost_particles.vtp"], case, flow)
    looks_across(opened(files, monkeypatch), flow.plane)


def ghosts_lie_on_walls(ghosts: pyvista.DataSet, case: Whole, flow: FlowField) -> None:
    """On faces that reflect, of the cylinder and the sides, axes along them."""
    axes, ends = list(flow.plane.axes), []
    for part in case.patches:
        for face in part.faces if part.kind in ("wall", "symmetryPlane") else ():
            flat = case.points[case.faces[face]][:, axes]
            ends.append((flat[0], flat[np.argmax(np.linalg.norm(flat - flat[0], axis=1))]))
    edges = np.array(ends)
    way = edges[:, 1] - edges[:, 0]
    length = np.linalg.norm(way, axis=1)
    at, axis = np.asarray(ghosts.points)[:, axes], ghosts.point_data["orientation"][:, axes]
    assert len(at) > 10
    for place, direction in zip(at, axis, strict=True):
        along = np.clip(np.sum((place - edges[:, 0]) * way, axis=1) / length**2, 0.0, 1.0)
        apart = np.linalg.norm(edges[:, 0] + along[:, None] * way - place, axis=1)
        on = apart < 1e-9
        assert np.abs(way[on] @ direction / length[on]).max() > 1.0 - 1e-9


def looks_across(recorder: Recorder, plane: CasePlane) -> None:
    """ParaView's camera sees the plane's x run to the right and its y up; layers lie before each other."""
    view, shown = recorder.view, recorder.shown
    eye, up = np.array(view.CameraPosition), np.array(view.CameraViewUp)
    right = np.cross(up, eye - np.array(view.CameraFocalPoint))
    np.testing.assert_array_equal(right, np.eye(3)[plane.axes[0]])
    np.testing.assert_array_equal(up, np.eye(3)[plane.axes[1]])
    # All but the text that tells the time.
    layers = np.array([display.Position for _, display in shown if hasattr(display, "Position")])
    assert len(layers) == len(shown) - 1
    assert not np.any(layers[:, list(plane.axes)])
    assert len(np.unique(layers @ eye)) == len(layers)


@pytest.mark.parametrize("normal", [0, 1, 2])
def test_cells_keep_their_values(normal: int) -> None:
    """Each cell of an image where it was, seen in its plane."""
    plane, values = CasePlane(normal, 4.0), np.arange(6.0).reshape(2, 3)
    flat = cell_image((1.0, 7.0), (-1.0, 1.0), (2, 3), {"density": values})
    expected = np.asarray(flat.cell_centers().points).copy()
    expected[:, 2] = 4.0
    image = placed(flat, plane)
    np.testing.assert_allclose(image.cell_centers().points, plane.turned(expected), atol=1e-14)
    np.testing.assert_array_equal(image.cell_data["density"], values.ravel())


def test_the_plane_is_kept_with_the_flow(tmp_path: Path) -> None:
    """In flow.npz, at one time and at several; the flow's digest does not depend on it."""
    field = read_case(DATA / "cavity_16")
    there = replace(field, plane=CasePlane(0, -2.5))
    there.save(tmp_path / "one.npz")
    series = FlowSeries.of_fields((0.0, 1.0), (there, replace(there, origin="later")))
    series.save(tmp_path / "several.npz")
    for name in ("one", "several"):
        assert load_flow(tmp_path / f"{name}.npz").plane == CasePlane(0, -2.5)
    assert series.at(0.5).plane == CasePlane(0, -2.5)
    assert there.digest == field.digest
    shipped = DATA.parents[1] / "ellipsoid_coupling/flow/shipped"
    assert load_flow(shipped / "ring.npz").plane == FLAT


@pytest.mark.parametrize("plane", [[3.0, 0.0], [0.5, 0.0], [1.0, np.inf], [np.nan, 0.0], [1.0]])
def test_a_plane_that_is_none_is_refused(plane: list[float], tmp_path: Path) -> None:
    field = read_case(DATA / "cavity_16")
    field.save(tmp_path / "flow.npz")
    with np.load(tmp_path / "flow.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "flow.npz", **arrays | {"plane": np.array(plane)})
    with pytest.raises(InputError, match="plane: expected an axis, 0, 1 or 2"):
        load_flow(tmp_path / "flow.npz")
