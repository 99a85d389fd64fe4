"""Starts with the fluid's velocity, and from the last state of an earlier run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.result import Result

TABLE: dict[str, Any] = {
    "name": "go_on", "times": [0.3], "domain": {"x": [-1, 1], "y": [-1, 1], "boundary": "open"},
    "particles": {"length": 0.2, "width": 0.1, "inertia": 0.01, "number": 20, "realisations": 3},
    "start": {"x": [-0.3, 0.4], "y": [-0.4, 0.3], "angle": 0.4},
    "flow": {"source": "closed_form", "field": "rotation", "drag": 2.0, "angular_drag": 3.0},
    "numerics": {"cell": 0.1, "angle_cells": 12, "time_step": 0.01},
}  # fmt: skip
LAMBDA = 0.6


def scene(**changes: Any) -> ec.Scene:
    return ec.load_scene(TABLE, {key.replace("__", "."): value for key, value in changes.items()})


def going_on(folder: Path, **changes: Any) -> ec.Scene:
    """From the result in a folder; without a box."""
    table = TABLE | {"start": {"file": str(folder / "result.nc")}}
    return ec.load_scene(table, {key.replace("__", "."): value for key, value in changes.items()})


@pytest.mark.parametrize(
    ("model", "scheme"),
    [("microscopic", "paper"), ("microscopic", "accurate"), ("mckean_vlasov", "accurate"),
     ("rho_mono_kinetic", "accurate"), ("q_mono_kinetic", "accurate"), ("q_maxwellian", "accurate")],
)  # fmt: skip
def test_a_start_with_the_fluid_has_its_velocity(model: str, scheme: Any) -> None:
    """After a millionth of a time unit: u and Jeffery's rate, here -1, at each place to 1e-5."""
    result = ec.simulate(scene(start__velocity="fluid", times=[1e-6]), model, scheme)
    values = {name: value[-1] for name, value in result.variables.items()}
    if result.layout == "particles":
        x, y, held = values["x"], values["y"], np.ones(values["x"].shape, bool)
    else:
        x, y = np.meshgrid(result.coordinates["x"], result.coordinates["y"])
        # What a first-order step spreads to the next cells has the velocity of where it was.
        held = values["density"] > 0.5 * values["density"].max()
    for name, exact in (("velocity_x", y), ("velocity_y", -x), ("angular_velocity", -1.0)):
        assert np.abs(values[name] - exact)[held].max() < 1e-5, name


def test_tracers_that_start_with_the_fluid_turn_rigidly() -> None:
    """In u = (y, -x) with the fluid's spin: angle - t at all times, whatever the drag; at rest it lags."""
    points = {"start.points": [[0.3, 0.0, 0.4], [0.0, -0.2, 0.1]], "particles.number": 2}
    angles = []
    for velocity in ("fluid", "rest"):
        own = ec.load_scene(
            TABLE, points | {"start.velocity": velocity, "numerics.tolerance": 1e-8}
        )
        angles.append(ec.simulate(own, "microscopic").variables["angle"][-1, 0])
    assert angles[0] == pytest.approx([0.1, -0.2], abs=1e-9)
    assert (np.abs(angles[1] - angles[0]) > 0.05).all()


@pytest.mark.parametrize(
    ("model", "scheme"),
    [("microscopic", "paper"), ("mckean_vlasov", "accurate"), ("rho_mono_kinetic", "accurate"),
     ("q_maxwellian", "accurate"), ("diffusive", "accurate")],
)  # fmt: skip
def test_a_state_goes_on_as_it_was(model: str, scheme: Any, tmp_path: Path) -> None:
    """After 1e-9 time units all is as it was saved, to 1e-7; mass, which left through the sides, too."""
    wide = {"start__x": [-1.0, 1.0], "start__y": [-1.0, 1.0], "particles__number": 25}
    if model == "mckean_vlasov":
        wide |= {"particles__number": 27, "noise": {"noise": 0.1, "angular_noise": 0.1}}
    if "kinetic" in model or model in ("q_maxwellian", "diffusive"):
        wide |= {"gravity": {"x": 2.0}}
    before = ec.simulate(scene(**wide), model, scheme, folder=tmp_path)
    same = {key: value for key, value in wide.items() if not key.startswith("start")}
    own = going_on(tmp_path, **{**same, "times": [1e-9], "noise": None})
    after = ec.simulate(own, model, scheme)
    for name, values in before.variables.items():
        size = max(np.abs(values[-1]).max(), 1.0)
        held = np.ones(values[-1].shape, bool)
        if before.layout != "particles" and name != "density":
            held = before.variables["density"][-1] > 1e-3 * before.variables["density"][-1].max()
        assert np.abs(after.variables[name][-1] - values[-1])[held].max() < 1e-7 * size, name
    if before.layout != "particles":
        assert before.attributes["mass_left"] > 0.01
        assert after.attributes["mass_start"] == pytest.approx(
            before.attributes["mass_end"], rel=1e-14
        )


def test_two_halves_are_a_whole(tmp_path: Path) -> None:
    """Particles without noise, at equal steps: to rounding the run that never stopped."""
    whole = ec.simulate(scene(times=[0.3, 0.6]), "microscopic", "paper", folder=tmp_path / "whole")
    ec.simulate(scene(), "microscopic", "paper", folder=tmp_path / "half")
    second = ec.simulate(going_on(tmp_path / "half"), "microscopic", "paper")
    for name in ("x", "y", "angle", "velocity_x", "velocity_y", "angular_velocity"):
        off = np.abs(second.variables[name][-1] - whole.variables[name][-1])
        assert off.max() < 1e-13, name


@pytest.mark.parametrize("model", ["rho_mono_kinetic", "q_mono_kinetic"])
def test_particles_are_counted_in_cells(model: str, tmp_path: Path) -> None:
    """Mass, mean place to half a cell, mean velocities and angle to rounding."""
    earlier = ec.simulate(scene(), "microscopic", folder=tmp_path)
    result = ec.simulate(going_on(tmp_path, times=[1e-9]), model)
    density = result.variables["density"][-1]
    assert result.attributes["mass_start"] == pytest.approx(1.0, rel=1e-14)
    volume = density / density.sum()
    for name in ("velocity_x", "velocity_y", "angular_velocity"):
        mean = float((volume * result.variables[name][-1]).sum())
        assert mean == pytest.approx(earlier.variables[name][-1].mean(), abs=1e-6), name
    angle = (
        result.variables["mean_angle"][-1]
        if result.layout == "rho"
        else np.mod(result.coordinates["angle"] + 1.0, 2.0 * np.pi)[:, None, None] - 1.0
    )
    assert float((volume * angle).sum()) == pytest.approx(
        earlier.variables["angle"][-1].mean(), abs=1e-6
    )
    binned = result.density(20)[-1]
    np.testing.assert_allclose(binned, earlier.density(20)[-1], atol=1e-6 * binned.max())


def test_the_file_is_found_beside_the_scene(tmp_path: Path) -> None:
    """By a path relative to the scene's file."""
    ec.simulate(scene(), "microscopic", folder=tmp_path / "first")
    text = (
        'name = "next"\ntimes = [0.1, 0.2]\nstart = { file = "first/result.nc" }\n'
        'domain = { x = [-1.0, 1.0], y = [-1.0, 1.0], boundary = "open" }\n'
        "particles = { length = 0.2, width = 0.1, number = 20, realisations = 2 }\n"
        "numerics = { cell = 0.1 }\n"
    )
    (tmp_path / "next.toml").write_text(text)
    own = ec.load_scene(tmp_path / "next.toml")
    assert own.start.file == str(tmp_path / "first" / "result.nc")
    assert own.start.x == own.domain.x
    whole = ec.simulate(own, "microscopic")
    # Without a fluid all fly on straight, and turn as they did.
    first = Result.load(tmp_path / "first").variables
    flown = first["x"][-1, :2] + 0.2 * first["velocity_x"][-1, :2]
    assert np.abs(whole.variables["x"][-1] - flown).max() < 1e-13
    turned = first["angle"][-1, :2] + 0.2 * first["angular_velocity"][-1, :2]
    assert np.abs(whole.variables["angle"][-1] - turned).max() < 1e-13


def test_a_run_keeps_what_it_started_from(tmp_path: Path) -> None:
    """Resumed and repeated without the file, and in a folder that has been moved; a copy is told apart."""
    ec.simulate(scene(), "microscopic", folder=tmp_path / "first")
    own = going_on(tmp_path / "first", times=[0.1, 0.2])

    class Stop(BaseException):
        pass

    def stop(_stage: str, part: float) -> None:
        if part > 0.4:
            raise Stop

    whole = ec.simulate(own, "microscopic")
    place = ec.RunFolder(tmp_path / "run", checkpoint_seconds=0.0)
    with pytest.raises(Stop):
        ec.simulate(own, "microscopic", folder=place, report=stop)
    (tmp_path / "first" / "result.nc").unlink()
    resumed = ec.simulate(own, "microscopic", folder=ec.RunFolder(tmp_path / "run", resume=True))
    moved = (tmp_path / "run").rename(tmp_path / "moved")
    again = ec.load_scene(moved / "run.toml")
    assert again.start.file == str(moved / "start.nc")
    repeated = ec.simulate(again, "microscopic", folder=ec.RunFolder(moved, force=True))
    for name in ("x", "y", "angle"):
        assert np.array_equal(resumed.variables[name], whole.variables[name])
        assert np.array_equal(repeated.variables[name], whole.variables[name])
    (moved / "result.nc").unlink()
    ec.simulate(scene(times=[0.2]), "microscopic", folder=tmp_path / "other")
    (tmp_path / "other" / "result.nc").rename(moved / "start.nc")
    with pytest.raises(InputError, match=r"\[run\] start_digest"):
        ec.simulate(again, "microscopic", folder=ec.RunFolder(moved, resume=True))
    ec.simulate(scene(), "microscopic", folder=ec.RunFolder(moved, force=True))
    assert not (moved / "start.nc").exists()


SMALL = {"domain__x": [0.0, 1.0], "domain__boundary": "reflecting", "flow": None}


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    ec.simulate(scene(), "microscopic", folder=tmp_path / "p")
    ec.simulate(scene(), "rho_mono_kinetic", folder=tmp_path / "rho")
    for folder, model, changes, message in (
        ("none", "microscopic", {}, "none"),
        ("p", "microscopic", {"particles__number": 7}, "3 or more realisations of 7 particles"),
        ("p", "microscopic", {"particles__realisations": 4}, "3 of 20 in"),
        ("p", "mckean_vlasov", {"particles__number": 7}, r"= 21 particles, found 60"),
        ("p", "rho_mono_kinetic", SMALL, "of 60 beyond the left, the first at"),
        ("rho", "microscopic", {}, "a grid in"),
        ("rho", "rho_mono_kinetic", {"numerics__cell": 0.2}, "20 x 20 cells of layout rho"),
        ("rho", "q_mono_kinetic", {}, "cells of layout q at the same places"),
    ):
        with pytest.raises(InputError, match=message):
            ec.simulate(going_on(tmp_path / folder, **changes), model)
    others: list[tuple[dict[str, Any], str]] = [
        ({"start__points": [[0.0, 0.0]] * 20}, "file alone"),
        ({"start__velocity": "fluid"}, "file alone"),
    ]
    for other, message in others:
        with pytest.raises(InputError, match=message):
            going_on(tmp_path / "p", **other)
    with pytest.raises(InputError, match=r'\[flow\] with start.velocity = "fluid"'):
        scene(flow=None, start__velocity="fluid")
    (tmp_path / "rho" / "result.nc").write_bytes(b"x" * 100)
    with pytest.raises(InputError, match="a result file"):
        ec.simulate(going_on(tmp_path / "rho"), "rho_mono_kinetic")
