"""Stored yardsticks: whole, of their scene alone, and taken instead of a reference that takes minutes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare import reference_solution, run_frontier, yardsticks
from ellipsoid_coupling.compare.distances import Errors
from ellipsoid_coupling.compare.error_budget import Bins
from ellipsoid_coupling.compare.timing import Bench
from ellipsoid_coupling.compare.yardsticks import (
    Yardstick,
    find_yardstick,
    fluid_velocity,
    load_yardstick,
    save_yardstick,
    scene_digest,
    yardstick_path,
)
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import FlowField, analytic_flow
from ellipsoid_coupling.output.frontier_report import frontier_text
from ellipsoid_coupling.scenes import Scene

SHORT: dict[str, Any] = {"times": [0.2, 0.4]}


def made_up(scene: Scene, groups: int = 3) -> Yardstick:
    """Random masses at the scene's times."""
    generator, count = np.random.default_rng(0), len(scene.times)
    density, angle = (generator.dirichlet(np.ones(n), size=(groups, count)) for n in (400, 60))
    error = Errors(np.full(count, 1e-3), np.full(count, 2e-3))
    bins = Bins(density, angle, 500)
    fluid = fluid_velocity(scene, analytic_flow("rotation"))
    return Yardstick("mckean_vlasov", np.array(scene.times), bins, error, fluid, "made up, 0.1")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(yardsticks, "FOLDER", tmp_path)
    return tmp_path


def test_what_is_saved_is_loaded(tmp_path: Path) -> None:
    """Masses to single precision, all else to the bit."""
    made = made_up(ec.load_scene("rotation", SHORT))
    save_yardstick(tmp_path / "one.npz", made)
    found = load_yardstick(tmp_path / "one.npz")
    assert (found.model, found.origin) == (made.model, made.origin)
    assert found.bins.samples == 500
    assert np.array_equal(found.times, made.times)
    assert np.array_equal(found.error, made.error)
    for name in ("density", "angle"):
        assert getattr(found.bins, name) == pytest.approx(getattr(made.bins, name), rel=1e-7)


@pytest.mark.parametrize(
    ("name", "values", "same"),
    [
        ("rotation", {"numerics.cell": 0.3, "numerics.tolerance": 0.1, "title": "Other"}, True),
        ("rotation", {"particles.realisations": 3, "particles.number": 7, "name": "a"}, True),
        ("rotation", {"interaction.strength": 1.01}, False),
        ("rotation", {"flow.drag": 1.01}, False),
        ("rotation", {"times": [1.5, 2.5]}, False),
        ("rotation", {"start.angle": 0.0}, False),
        ("cavity", {"particles.number": 7}, False),
        ("cavity", {"particles.realisations": 7}, True),
        ("cavity", {"walls.ghost_density": "paper"}, False),
    ],
)
def test_a_digest_is_of_all_that_the_limit_depends_on(
    name: str, values: dict[str, Any], same: bool
) -> None:
    digests = [scene_digest(ec.load_scene(name, v)) for v in ({}, values)]
    assert (digests[0] == digests[1]) is same


@pytest.mark.usefixtures("folder")
def test_it_serves_for_the_same_fluid_alone(rotation_flow: FlowField) -> None:
    """Two solutions of one case differ by some 1e-11; another flow, or none, is not meant."""
    scene = ec.load_scene("rotation", SHORT)
    save_yardstick(yardstick_path(scene), made_up(scene))
    arrays = rotation_flow.arrays
    for factor, found in ((1.0 + 1e-9, True), (1.0 + 1e-4, False)):
        other = FlowField(arrays._replace(coefficients=factor * arrays.coefficients), "other")
        assert other.digest != rotation_flow.digest
        assert (find_yardstick(scene, other) is not None) is found
    assert find_yardstick(scene, analytic_flow("top_bottom")) is None
    assert find_yardstick(scene, None) is None


def test_only_the_same_scene_finds_it(folder: Path, rotation_flow: FlowField) -> None:
    scene = ec.load_scene("rotation", SHORT)
    assert find_yardstick(scene, rotation_flow) is None
    save_yardstick(yardstick_path(scene), made_up(scene))
    assert len(list(folder.iterdir())) == 1
    other = ec.load_scene("rotation", SHORT | {"numerics.cell": 0.3, "name": "elsewhere"})
    found = find_yardstick(other, rotation_flow)
    assert found is not None
    assert found.origin == "made up, 0.1"
    assert find_yardstick(ec.load_scene("rotation"), rotation_flow) is None


@pytest.mark.usefixtures("folder")
def test_it_is_the_reference_without_a_run(rotation_flow: FlowField) -> None:
    """No model of particles is compared, so nothing is left to be run."""
    scene = ec.load_scene("rotation", SHORT)
    save_yardstick(yardstick_path(scene), made_up(scene))
    bench = Bench(rotation_flow, 0, 0.0)
    reference = reference_solution.make_reference(scene, ("rho_mono_kinetic",), bench)
    assert (reference.name, reference.exact) == ("mckean_vlasov", False)
    assert reference.spread is not None
    assert np.array_equal(reference.spread.angle, [2e-3, 2e-3])
    assert reference.bins.density.shape == (3, 2, 400)
    assert reference.result.attributes["origin"] == "made up, 0.1"


@pytest.mark.usefixtures("folder")
def test_a_frontier_tells_its_origin_and_error(rotation_flow: FlowField) -> None:
    values = SHORT | {"particles.number": 20, "particles.realisations": 4}
    scene = ec.load_scene("rotation", values | {"numerics.interaction": "direct"})
    save_yardstick(yardstick_path(scene), made_up(scene))
    frontier = run_frontier(scene, rotation_flow, models=("mckean_vlasov",), longest=1e-3)
    text = frontier_text(frontier)
    assert "Stored yardstick: made up, 0.1" in text
    assert "it may be off by: 0.0010" in text
    assert all(max(row.angle_errors) > 0.5 for row in frontier.rows if row.status == "completed")


def arrays_of(scene: Scene, path: Path) -> dict[str, Any]:
    save_yardstick(path, made_up(scene))
    with np.load(path) as file:
        return dict(file)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"density": None}, "the arrays density, angle"),
        ({"density": np.zeros((3, 2, 399))}, "density of shape"),
        ({"angle": np.full((3, 2, 60), np.nan)}, "finite numbers in angle"),
        ({"angle": np.full((3, 2, 60), 1.0)}, "1 in all at most"),
        ({"density": np.full((3, 2, 400), -1e-9)}, "0 or more"),
        ({"times": np.array(["a", "b"])}, "finite numbers in times"),
        ({"origin": np.array(["a", "b"])}, "a text in origin"),
        ({"density_error": np.array([-1.0, 0.0])}, "from 0 on"),
        ({"density_error": np.zeros(3)}, "density_error of shape"),
        ({"fluid": np.zeros((2, 5, 5))}, "fluid of shape"),
    ],
)
def test_nothing_else_is_taken_for_one(tmp_path: Path, changed: dict[str, Any], told: str) -> None:
    path = tmp_path / "one.npz"
    arrays = arrays_of(ec.load_scene("rotation", SHORT), path) | changed
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=told):
        load_yardstick(path)
