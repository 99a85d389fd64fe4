"""The package's cases with patches: their solutions against what is known of each flow, in the cells."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.flow.cases import BUILT_IN
from ellipsoid_coupling.flow.openfoam.case import Mesh, read_cells, read_solution
from ellipsoid_coupling.flow.openfoam.times import choose_time, solved_times
from ellipsoid_coupling.flow.openfoam.viscosity import read_viscosity
from ellipsoid_coupling.scenes import builtin_scenes, load_scene
from tests.flow.openfoam.installed import needs_openfoam

DATA = Path(__file__).parents[2] / "data"
Floats = NDArray[np.float64]
SMALL = {
    "channel": "channel_8", "step": "step_6", "cylinder": "cylinder_8", "ring": "ring_8",
    "elbow": "elbow", "vortex_street": "vortex_street_8",
}  # fmt: skip


def centres(mesh: Mesh) -> Floats:
    """(C, 2), the mean of each cell's corners, each counted once per face: enough for hexahedra."""
    faces = np.diff(mesh.begins)
    middle = np.add.reduceat(mesh.points[mesh.corners], mesh.begins[:-1]) / faces[:, None]
    total, count = np.zeros((mesh.cells, 3)), np.zeros(mesh.cells)
    for cells, these in ((mesh.owner, middle), (mesh.neighbour, middle[: mesh.neighbour.size])):
        np.add.at(total, cells, these)
        np.add.at(count, cells, 1.0)
    return (total / count[:, None])[:, :2]


def solution(name: str) -> tuple[Floats, Floats, Mesh]:
    """Centres (C, 2), U in the cells (C, 2) and the mesh."""
    found = read_solution(choose_time(DATA / SMALL[name], None).places)
    return centres(found.mesh), found.velocity.values[:, :2], found.mesh


def test_the_channel_is_poiseuilles() -> None:
    """4 y (1 - y) in the cells: 0.0148 off on 8 cells, 0.0041 on 16 (order 2), most at the inlet."""
    at, u, _ = solution("channel")
    np.testing.assert_allclose(u[:, 0], 4.0 * at[:, 1] * (1.0 - at[:, 1]), atol=0.016)
    np.testing.assert_allclose(u[:, 1], 0.0, atol=0.005)


def test_the_ring_is_couettes() -> None:
    """The flow is a r + b/r between r = 1/2, speed 1, and r = 1 at rest: 0.019 off on 8 cells.

    0.0049 on 16, 0.0008 on 40: order 2; walls are chords of arcs.
    """
    at, u, _ = solution("ring")
    r = np.hypot(at[:, 0], at[:, 1])
    turning = (at[:, 0] * u[:, 1] - at[:, 1] * u[:, 0]) / r
    b = 2.0 / 3.0
    np.testing.assert_allclose(turning, b / r - b * r, atol=0.02)
    np.testing.assert_allclose((at * u).sum(axis=1) / r, 0.0, atol=0.012)


def test_the_step_has_an_eddy() -> None:
    """Behind the step the fluid runs back near the floor, over 1 to 5 heights at this Reynolds number."""
    at, u, _ = solution("step")
    floor = at[:, 1] == at[:, 1].min()
    back = at[floor & (u[:, 0] < 0.0), 0]
    assert back.min() < 0.5
    assert 1.0 < back.max() < 5.0


def test_the_cylinder_at_20_has_two_eddies_and_is_symmetric() -> None:
    """Its wake is 0.9 diameters long (Coutanceau and Bouard); here 0.48 on 8 cells, 0.78 on 16."""
    at, u, _ = solution("cylinder")
    behind = (at[:, 0] > 0.5) & (np.abs(at[:, 1]) < 0.16)
    back = at[behind & (u[:, 0] < 0.0), 0]
    assert 0.4 < back.max() - 0.5 < 0.9
    mirrored = {(round(x, 6), round(y, 6)): v for (x, y), v in zip(at, u, strict=True)}
    for (x, y), (ux, uy) in list(mirrored.items())[::7]:
        other = mirrored[x, -y if y else y]
        assert abs(ux - other[0]) + abs(uy + other[1]) < 1e-3


def test_the_street_is_unsteady() -> None:
    """On this coarse mesh its period is 15 % longer and not settled; half of it changes U by 10 % rms."""
    case = DATA / SMALL["vortex_street"]
    _, last, mesh = solution("vortex_street")
    times = solved_times(case)
    assert np.diff([float(time) for time in times]) == pytest.approx(0.5 * 5.885, rel=1e-6)
    half = read_cells(case / times[1] / "U", mesh)[:, :2]
    assert np.sqrt(np.mean((last - half) ** 2)) > 0.1


def test_the_elbow_keeps_its_flux() -> None:
    """2/3 through each section, as at the inlet, by the cells in it: 2 % on a mesh of ten a width."""
    at, u, _ = solution("elbow")
    upright = at[:, 1] > 2.5
    assert u[upright, 1].mean() == pytest.approx(2.0 / 3.0, rel=0.02)
    level = at[:, 0] < 1.5
    assert u[level, 0].mean() == pytest.approx(2.0 / 3.0, rel=0.02)


@pytest.mark.parametrize("name", SMALL)
def test_data_are_small(name: str) -> None:
    files = [path for path in (DATA / SMALL[name]).rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 200_000
    assert read_viscosity(DATA / SMALL[name]) == read_viscosity(BUILT_IN / name)


@pytest.mark.parametrize("name", SMALL)
def test_scenes_name_their_cases_patches(name: str) -> None:
    """Every patch but the empty one; the domain holds the mesh, and cells divide it."""
    assert name in builtin_scenes()
    scene = load_scene(name)
    mesh = read_solution(choose_time(DATA / SMALL[name], None).places).mesh
    patches = {patch.name for patch in mesh.patches if patch.kind != "empty"}
    assert set(scene.boundaries or {}) == patches
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    np.testing.assert_allclose(
        [scene.domain.x, scene.domain.y], np.stack((low, high)).T[:2], atol=1e-9
    )
    assert scene.flow is not None
    assert scene.flow.field == name


@pytest.mark.openfoam
@needs_openfoam
@pytest.mark.heavy
@pytest.mark.parametrize("name", SMALL)
def test_allrun_solves_the_case(name: str, tmp_path: Path) -> None:
    """As it stands, by OpenFOAM alone."""
    case = Path(shutil.copytree(BUILT_IN / name, tmp_path / name))
    done = subprocess.run([case / "Allrun"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert solved_times(case)
