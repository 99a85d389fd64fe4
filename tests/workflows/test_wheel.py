"""The wheel alone, in an empty folder: its data are there, with and without OpenFOAM on the path."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from ellipsoid_coupling.flow import openfoam_available
from ellipsoid_coupling.flow.cases import BUILT_IN, built_in_folder
from ellipsoid_coupling.scenes import builtin_scenes

TOP = Path(__file__).parents[2]
NEEDS_OPENFOAM = pytest.mark.skipif(not openfoam_available(), reason="OpenFOAM is not installed")


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the unpacked wheel, built from this checkout without the network."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation"]
    command += ["--no-index", "--disable-pip-version-check", "-w", str(folder), str(TOP)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def in_empty_folder(installed: Path, empty: Path, path: str, *arguments: str) -> str:
    """What Python prints with only the wheel's package, its working folder and cache being empty."""
    changed = {"PATH": path, "PYTHONPATH": str(installed), "ELLIPSOID_CACHE": str(empty / "cache")}
    (empty / "here").mkdir()
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=empty / "here",
        env=os.environ | changed,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not list((empty / "here").iterdir())
    return done.stdout.strip()


SCENES = """
import ellipsoid_coupling as ec
from ellipsoid_coupling.simulation import scene_flow
small = {"times": [0.01], "particles.number": 2, "particles.realisations": 1}
for name in ec.builtin_scenes():
    scene = ec.load_scene(name, small)
    if scene.flow is not None and scene.flow.source == "openfoam" and CELLS:
        scene = scene.with_({"flow.cells": CELLS})
    try:
        flow = scene_flow(scene)
        if RUN:
            ec.simulate(scene, model="microscopic", flow=flow)
        print(name, "has", "none" if flow is None else flow.origin.split(":")[0].split(",")[0])
    except ec.InputError as error:
        print(name, "refused:", error.remedy)
"""

FLOW = """
import ellipsoid_coupling, pathlib
from ellipsoid_coupling.flow import obtain_flow
print(pathlib.Path(ellipsoid_coupling.__file__).parent)
print(obtain_flow("cavity", 8, processes=1).origin)
"""


def test_the_wheel_holds_every_file_of_package_and_cases(installed: Path) -> None:
    package = installed / "ellipsoid_coupling"
    for source, target in (
        (TOP / "ellipsoid_coupling", package),
        (BUILT_IN, package / "foam_cases"),
    ):
        wanted = {
            path.relative_to(source)
            for path in source.rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        }
        assert wanted <= {path.relative_to(target) for path in target.rglob("*")}
    assert (package / "py.typed").is_file()
    assert built_in_folder(package) == package / "foam_cases"


def test_a_checkout_takes_the_cases_at_its_top() -> None:
    assert BUILT_IN == TOP / "foam_cases"


def test_without_openfoam_the_wheel_has_the_shipped_cavity(installed: Path, tmp_path: Path) -> None:
    package, origin = in_empty_folder(installed, tmp_path, "/nowhere", "-c", FLOW).splitlines()
    assert package == str(installed / "ellipsoid_coupling")
    assert origin.startswith("shipped")


@NEEDS_OPENFOAM
@pytest.mark.openfoam
def test_with_openfoam_the_wheel_solves_its_own_case(installed: Path, tmp_path: Path) -> None:
    """The command that `run cavity` gets its flow by, on 8 x 8 cells."""
    command = ("-m", "ellipsoid_coupling", "flow", "cavity", "--cells", "8")
    solved = Path(in_empty_folder(installed, tmp_path, os.environ["PATH"], *command))
    assert solved.parent == tmp_path / "cache" / "flows"
    assert (solved / "system" / "controlDict").is_file()


def scenes_of(installed: Path, empty: Path, path: str, *, run: bool, cells: int) -> dict[str, str]:
    """What each built-in scene has for a flow, from a process that has the wheel alone."""
    code = SCENES.replace("CELLS", str(cells)).replace("RUN", str(run))
    printed = in_empty_folder(installed, empty, path, "-c", code).splitlines()
    return dict(line.split(" ", 1) for line in printed)


@pytest.mark.parametrize("run", [False, pytest.param(True, marks=pytest.mark.heavy)])
def test_without_openfoam_every_scene_has_its_flow(
    installed: Path, tmp_path: Path, run: bool
) -> None:
    """A formula, a shipped field, or none; only a flow of many times says what it needs."""
    found = scenes_of(installed, tmp_path, "/nowhere", run=run, cells=0)
    assert set(found) == set(builtin_scenes())
    refused = {name for name, told in found.items() if told.startswith("refused")}
    assert refused == {"vortex_street"}
    assert 'Set flow.time = "latest", or give a case.' in found["vortex_street"]
    shipped = {name for name, told in found.items() if told == "has shipped"}
    assert {"cavity", "cavity_free", "channel", "cylinder", "elbow", "ring", "step"} == shipped


@NEEDS_OPENFOAM
@pytest.mark.openfoam
@pytest.mark.heavy
def test_with_openfoam_every_scene_runs(installed: Path, tmp_path: Path) -> None:
    """Each solved on a coarse mesh, and two particles in it; the vortex street takes minutes."""
    found = scenes_of(installed, tmp_path, os.environ["PATH"], run=True, cells=8)
    assert set(found) == set(builtin_scenes())
    assert not [told for told in found.values() if told.startswith("refused")]


def test_the_sdist_holds_all_that_a_packager_needs(tmp_path: Path) -> None:
    """Sources, cases, workflows, tests, licence and citation; built without the network."""
    code = f"import hatchling.build as b; print(b.build_sdist({str(tmp_path)!r}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=TOP, check=True, capture_output=True, text=True
    )
    with tarfile.open(tmp_path / done.stdout.split()[-1]) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {"CITATION.cff", "LICENSE", "README.md", "pyproject.toml", "Dockerfile"} <= names
    for folder in ("ellipsoid_coupling", "foam_cases", "tests", "workflows"):
        wanted = {
            path.relative_to(TOP).as_posix()
            for path in (TOP / folder).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        }
        assert wanted <= names


def test_the_command_line_of_the_wheel_plans(installed: Path, tmp_path: Path) -> None:
    printed = in_empty_folder(
        installed, tmp_path, "/nowhere", "-m", "ellipsoid_coupling", "plan", "cavity"
    )
    assert "interaction" in printed
