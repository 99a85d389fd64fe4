"""Every workflow at a small size, and the set-up scripts' promises."""

from __future__ import annotations

import csv
import importlib.metadata
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import matplotlib.image
import numpy as np
import pytest
import pyvista
from packaging.requirements import Requirement

from ellipsoid_coupling.flow import openfoam_available

TOP = Path(__file__).parents[2]
WORKFLOWS = TOP / "workflows"
NEEDS_OPENFOAM = pytest.mark.skipif(not openfoam_available(), reason="OpenFOAM is not installed")

TINY = ["particles.number=40", "particles.realisations=2", "numerics.cell=0.05", "flow.cells=16"]
TINY += ["particles.length=0.1", "particles.width=0.05", "times=[0.4,0.8,1.2]"]


def workflow(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, WORKFLOWS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_the_main_job_leaves_all_it_promises(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = workflow("cavity").main(["--out", str(tmp_path / "job"), "--set", *TINY])
    out = capsys.readouterr().out
    assert out.strip().splitlines()[-1] == str(folder)
    pictures = {p.name for p in folder.glob("*.png")}
    for scene in ("cavity", "cavity_free"):
        kinds = ("density", "angles", "directors", "order", "ellipses", "error_against_run_time")
        for kind in kinds:
            assert f"{kind}_{scene}.png" in pictures
    assert {"flow.png", "walls.png"} <= pictures
    rows = list(csv.DictReader((folder / "errors.csv").read_text().splitlines()))
    assert len(rows) == 2 * 12 * 3
    assert {row["reference"] for row in rows} == {"exact", "microscopic ensemble"}
    for series in (folder / "paraview").rglob("*.pvd"):
        reader = pyvista.PVDReader(str(series))
        assert reader.time_values == [0.4, 0.8, 1.2]
        assert all(block.n_points for block in reader.read())
    assert len(list((folder / "paraview" / "flow").iterdir())) == 6
    assert len(list((folder / "runs").iterdir())) == 8


def test_the_papers_page_has_every_figure_and_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every run, figure and verdict at tiny sizes: the page is whole, whatever its verdicts."""
    monkeypatch.syspath_prepend(str(WORKFLOWS))
    folder = workflow("paper").main(["--quick", "--out", str(tmp_path)])
    page = (folder / "index.html").read_text()
    named = re.findall(r'<img src="([^"]+)"', page)
    assert len(named) == 1 + 2 + 1 + 4 * 8
    # More than one colour each.
    assert all(matplotlib.image.imread(folder / name)[..., :3].std() > 0.01 for name in named)
    assert len(re.findall(r'<tr class="(?:yes|no)">', page)) == 2 * 17 + 2
    # Every statement but two is judged for both schemes.
    for scheme in ("paper", "accurate"):
        assert page.count(f"</td><td>{scheme}</td><td>") >= 17
    assert "failed:" not in page
    _look_at_it_in_a_browser(folder)


def test_the_frontier_of_a_scene_has_tables_pictures_and_choices(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One scene, tiny ensembles, a tenth of a second a run."""
    arguments = ["--quick", "--scenes", "rotation", "--longest", "0.1", "--out", str(tmp_path)]
    folder = workflow("frontier").main(arguments)
    printed = capsys.readouterr().out
    assert printed.strip().splitlines()[-1] == str(folder)
    # Levels that would take too long are told, without numbers.
    assert "not run: would take" in printed
    assert not re.search(r"\bnan\b", printed)
    names = {path.name for path in folder.iterdir()}
    pictures = {"error_against_run_time_rotation.png", "error_parts_rotation.png"}
    assert names == pictures | {"errors.csv", "errors.txt", "frontier.md"}
    rows = list(csv.DictReader((folder / "errors.csv").read_text().splitlines()))
    models = ("mckean_vlasov", "microscopic", "q_maxwellian", "q_mono_kinetic", "rho_mono_kinetic")
    assert {row["model"] for row in rows} == {*models, "diffusive"}
    assert {row["reference"] for row in rows} == {"mckean_vlasov"}
    assert any(row["status"].startswith("not run: would take about") for row in rows)
    split = [row for row in rows if row["discretisation_density"]]
    assert split
    for row in split:
        parts = ("discretisation", "closure", "finite_n", "sampling")
        total = sum(float(row[f"{part}_density"] or 0.0) for part in parts)
        # The parts of random runs carry noise of their own.
        assert float(row["density_error"]) < 1.05 * total + 0.1
        assert float(row["best_seconds"]) <= float(row["median_seconds"])
    lines = (folder / "frontier.md").read_text().splitlines()
    assert len(lines) == 2 + 6
    assert all(line.count("|") == 9 for line in lines)


def test_the_benchmark_has_a_row_for_everything_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tiny sizes: the numbers mean nothing, but fast and slow ways must agree."""
    monkeypatch.syspath_prepend(str(WORKFLOWS))
    told = json.loads(workflow("benchmark").main(["--quick", "--out", str(tmp_path)]).read_text())
    assert all(value > 0.0 for value in told["limits"].values())
    numbers = [row["numbers"] for row in told["rows"]]
    assert len(numbers) == 13
    assert all(np.isfinite(value) for row in numbers for value in row.values())
    assert max(row["error"] for row in numbers if "error" in row) < 1e-12
    assert max(row["apart"] for row in numbers if "apart" in row) < 1e-12


def _look_at_it_in_a_browser(folder: Path) -> None:
    """Headless Chromium, where installed (test.sh brings it): all pictures load, the page is not blank."""
    browser = shutil.which("chromium")
    if browser is None:
        return
    script = (
        "<script>onload = () => { document.title = [...document.images]"
        ".filter(i => i.naturalWidth == 0).length + ' of ' + document.images.length }</script>"
    )
    page = folder / "looked_at.html"
    page.write_text((folder / "index.html").read_text() + script)
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"]
    options += ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    options += [f"--user-data-dir={folder / 'browser'}", "--window-size=1200,2000"]

    def run(*more: str) -> str:
        command = [browser, *options, *more, page.as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return done.stdout

    pictures = len(re.findall(r"<img ", page.read_text()))
    assert f"<title>0 of {pictures}</title>" in run("--virtual-time-budget=10000", "--dump-dom")
    run(f"--screenshot={folder / 'page.png'}")
    shot = matplotlib.image.imread(folder / "page.png")
    assert shot.shape[:2] == (2000, 1200)
    assert shot[..., :3].std() > 0.05


@pytest.mark.parametrize("script", ["run.sh", "test.sh", "docs.sh", "results.sh", "setup.sh"])
def test_the_shell_scripts_parse(script: str) -> None:
    subprocess.run(["bash", "-n", str(WORKFLOWS / script)], check=True)


def test_ci_calls_the_test_command() -> None:
    assert "workflows/test.sh" in (TOP / ".ci" / "run").read_text()


def test_the_lock_file_pins_everything_that_the_project_needs() -> None:
    """With all that these need in turn, as the installed packages tell it, and a hash for each."""
    text = re.sub(r"(?m)^#.*\n", "", (WORKFLOWS / "requirements.lock").read_text())
    pins = text.replace(" \\\n", "").splitlines()
    pin = r"[A-Za-z0-9_.-]+==[A-Za-z0-9.]+(    --hash=sha256:[0-9a-f]{64})+"
    assert all(re.fullmatch(pin, line) for line in pins)
    names = {_plain_name(line.split("==")[0]) for line in pins}
    project = tomllib.loads((TOP / "pyproject.toml").read_text())
    left = [*project["project"]["dependencies"], *project["build-system"]["requires"]]
    extras = project["project"]["optional-dependencies"]
    left += extras["dev"]
    wanted: set[str] = set()
    while left:
        package = Requirement(text := left.pop())
        if package.name == project["project"]["name"]:
            left += [needed for extra in package.extras for needed in extras[extra]]
        elif text not in wanted:
            wanted.add(text)
            left += _requirements_of(package)
    assert {_plain_name(Requirement(text).name) for text in wanted} == names


def _requirements_of(package: Requirement) -> list[str]:
    """What an installed package needs here, its extras that are asked for included."""
    return [
        text
        for text in importlib.metadata.requires(package.name) or []
        if (marker := Requirement(text).marker) is None
        or any(marker.evaluate({"extra": extra}) for extra in package.extras or {""})
    ]


def _plain_name(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_without_permission_setup_says_how_to_install(tmp_path: Path) -> None:
    """No icoFoam on the path, no root, no sudo: one line, and the job goes on."""
    stand_ins = tmp_path / "bin"
    stand_ins.mkdir()
    for name, text in {"id": "echo 1000", "sudo": "exit 1"}.items():
        (stand_ins / name).write_text(f"#!/bin/sh\n{text}\n")
        (stand_ins / name).chmod(0o755)
    functions = (WORKFLOWS / "setup.sh").read_text().rsplit("\nmake_environment\n", 1)[0]
    script = f'PATH="{stand_ins}:/nowhere"\n{functions}\nbring_openfoam\necho going on\n'
    done = subprocess.run(["/bin/bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("going on")
    assert "apt-get install openfoam" in done.stderr
