"""A library of an extra that is missing is told in one line, with the command that installs it."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]

# Hides libraries from a process as if they were not installed.
HIDDEN = "import sys\nsys.modules.update(dict.fromkeys({hidden!r}))\n"


def run(code: str, *hidden: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", HIDDEN.format(hidden=hidden) + code],
        cwd=cwd, capture_output=True, text=True, check=False,
    )  # fmt: skip


COMMAND = "from ellipsoid_coupling.cli import main\nmain({!r})"


@pytest.mark.parametrize(
    ("command", "library", "extra"),
    [(["figures", "RUN"], "matplotlib", "plot"), (["export", "RUN"], "pyvista", "paraview")],
)
def test_a_command_tells_which_extra_it_needs(
    command: list[str], library: str, extra: str, tmp_path: Path
) -> None:
    done = run(COMMAND.format(command), library, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    (line,) = [line for line in done.stderr.splitlines() if line != "loading ..."]
    assert f"the library {library}" in line
    assert f"pip install 'ellipsoid_coupling[{extra}]'" in line


def test_a_solver_only_install_runs_and_reads(tmp_path: Path) -> None:
    """Without matplotlib, pyvista, meshio and Dask: a run, its folder, its densities; no plot."""
    code = """
import ellipsoid_coupling as ec
scene = ec.load_scene("rotation", {"particles.number": 2, "particles.realisations": 1, "times": [0.1]})
result = ec.simulate(scene, model="microscopic", folder="run")
print(ec.Result.load("run").density(3).shape)
try:
    result.plot()
except ec.InputError as error:
    print(error)
"""
    done = run(code, "matplotlib", "pyvista", "vtkmodules", "meshio", "distributed", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    shape, told = done.stdout.splitlines()
    assert shape == "(1, 3, 3)"
    assert told.startswith("the library matplotlib: expected")


def test_the_extras_are_those_that_are_told_and_all_has_them_all() -> None:
    project = tomllib.loads((TOP / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    names = {"paraview", "plot", "cluster", "docs", "dev", "all"}
    assert set(extras) == names
    assert extras["all"] == ["ellipsoid_coupling[paraview,plot,cluster]"]
    assert "ellipsoid_coupling[all]" in extras["dev"]
    for library, extra in (("matplotlib", "plot"), ("pyvista", "paraview"), ("meshio", "paraview")):
        assert any(text.startswith(library) for text in extras[extra])
        assert not any(text.startswith(library) for text in project["dependencies"])
