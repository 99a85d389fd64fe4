"""What the monitors stop, in words that name the place and the term; what they let pass."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.finite_volume.grid import interior
from ellipsoid_coupling.models import Model, Setup, build_model, model_terms
from ellipsoid_coupling.monitors import Monitors, Pace
from ellipsoid_coupling.simulation import scene_flow

Floats = NDArray[np.float64]

SMALL: dict[str, Any] = {
    "particles.number": 20,
    "numerics.cell": 0.1,
    "numerics.angle_cells": 6,
    "times": [0.2],
}
GRIDS = ["rho_mono_kinetic", "q_mono_kinetic", "q_maxwellian", "diffusive"]
MODELS = ["microscopic", "mckean_vlasov", *GRIDS]


def started(name: str, scheme: Any = "accurate", **changes: Any) -> tuple[Monitors, Model]:
    """A model two calls after its start, and the watch over it."""
    scene = ec.load_scene("rotation", SMALL | changes)
    flow = scene_flow(scene)
    setup = Setup(scene, model_terms(scene, name), scheme, flow, 0, 2)
    model = build_model(name, setup)
    monitors = Monitors(name, setup, model)
    for _ in range(2):
        model.advance(0.2)
        monitors.look(model)
    return monitors, model


def stores(model: Any) -> Any:
    """The conserved fields of a grid model, without the ghost planes of the angle."""
    return model.fields if hasattr(model, "fields") else model.cells.fields[:, 2:-2]


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@pytest.mark.parametrize("name", MODELS)
def test_sound_runs_pass_and_know_their_strongest_term(name: str, scheme: Any) -> None:
    _, model = started(name, scheme)
    site = model.failure_site()
    assert all(np.isfinite(value) for value in (*site.position, *site.strengths.values()))
    assert "The strongest term is" in str(site)
    health = model.health()
    assert health.mass == pytest.approx(model.counts()["mass_end"], rel=1e-12)
    assert health.least_density >= 0.0


@pytest.mark.parametrize("name", GRIDS)
def test_nan_negative_density_and_mass_are_seen(name: str) -> None:
    """Each put into one cell by hand."""
    for value, told in ((np.nan, "no longer finite"), (-1e-3, "a density of"), (1e3, "mass has")):
        monitors, model = started(name)
        cell = interior(stores(model))[0]
        cell[np.unravel_index(int(cell.argmax()), cell.shape)] = value
        with pytest.raises(RunError, match=told) as caught:
            monitors.look(model)
        assert "rotation, " in str(caught.value)


@pytest.mark.parametrize("name", ["microscopic", "mckean_vlasov"])
def test_energy_that_no_force_gave_is_seen(name: str) -> None:
    """Speeds a hundred times what the fluid drives; a third more than it gave pass."""
    monitors, model = started(name)
    velocity: Floats = np.asarray(model.state()["velocity"], np.float64)
    velocity *= 1.3
    monitors.look(model)
    velocity += 100.0
    with pytest.raises(RunError, match=r"beyond what forces of .* The strongest term is .* at"):
        monitors.look(model)


def test_an_unstable_leapfrog_is_stopped_early() -> None:
    """Dt Gamma = 4 doubles the speed in two steps: stopped long before it overflows."""
    scene = ec.load_scene("rotation", SMALL | {"flow.drag": 400.0, "times": [100.0]})
    with pytest.raises(RunError, match=r"t = 0\.\d+: a root mean square speed"):
        ec.simulate(scene, "microscopic", "paper")


@pytest.mark.parametrize("step", [0.0471, 0.05, 0.0531, 2.0 * np.pi / 64.0])
def test_forces_count_wherever_a_run_is_looked_at(step: float) -> None:
    """An undamped oscillation of all in step: wherever looks fall in a period, it is sound."""
    part = {"interaction": None, "noise": None, "numerics.time_step": step, "times": [20.0]}
    scene = ec.load_scene("stationary", part | {"particles.number": 20})
    ec.simulate(scene, "microscopic", "paper", realisations=2)


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@pytest.mark.parametrize("name", ["microscopic", "mckean_vlasov"])
def test_what_pushed_within_a_call_has_been_seen(name: str, scheme: Any) -> None:
    """Two small ellipses that overlap at the start have flown apart before the first look."""
    small = {
        "particles.length": 0.02,
        "particles.width": 0.01,
        "particles.number": 2,
        "particles.realisations": 1,
        "start.points": [[0.0, 0.0], [0.005, 0.002]],
        "domain.x": [-1.0, 1.0],
        "domain.y": [-1.0, 1.0],
        "start.x": [-0.5, 0.5],
        "start.y": [-0.5, 0.5],
        "outer_potential": None,
        "angular_potential": None,
        "noise": None,
        "numerics.time_step": 1e-3,
        "times": [0.5],
    }
    result = ec.simulate(ec.load_scene("stationary", small), name, scheme)
    speed = np.hypot(result.variables["velocity_x"], result.variables["velocity_y"])
    assert speed[-1].min() > 0.3  # U/(2 m) of each has become speed


def test_strong_noise_is_no_alarm() -> None:
    """Equilibrium speeds have variance 1 whatever A is; ten standard deviations are allowed."""
    noise = {"noise.noise": 30.0, "noise.angular_noise": 30.0, "interaction": None}
    changes = SMALL | noise | {"numerics.time_step": 1e-4}
    ec.simulate(ec.load_scene("rotation", changes), "microscopic", "paper")
    ec.simulate(ec.load_scene("rotation", changes), "microscopic", "accurate")


def test_the_fluids_pull_is_named() -> None:
    """Without interaction nothing but the fluid pulls: gamma |u| at the outermost particle.

    The force is that of the step's prediction, a tolerance (1e-4) beside the place.
    """
    _, model = started("microscopic", interaction=None)
    site = model.failure_site()
    assert site.strengths["interaction and walls"] == pytest.approx(0.0, abs=1e-3)
    drag = ec.load_scene("rotation").flow
    assert drag is not None
    assert site.strengths["the fluid"] == pytest.approx(
        drag.drag * np.hypot(site.position[0], site.position[1]), rel=1e-3
    )


@pytest.mark.parametrize("value", [0.5000001, -2.0, np.nan])
@pytest.mark.parametrize("name", ["microscopic", "mckean_vlasov"])
def test_a_particle_beyond_a_wall_is_seen(name: str, value: float) -> None:
    """In an open domain it is not."""
    box = {"domain.x": [-0.8, 0.5], "start.x": [0.1, 0.2], "domain.boundary": "reflecting"}
    for changes, told in ((box, "1 coordinates of particles are outside the walls"), ({}, "")):
        monitors, model = started(name, **changes)
        model.state()["place"][0, 0, 3] = value
        if told:
            with pytest.raises(RunError, match=told):
                monitors.look(model)
        else:
            monitors.look(model)


class Clock:
    """A model of which only its time is looked at."""

    def __init__(self) -> None:
        self.time = 0.0

    def counts(self) -> dict[str, str]:
        return {"step_limits": "rotation 100 %"}

    def failure_site(self) -> str:
        return "The torque."


def first_told(hours: float, seconds_a_call: float) -> int | None:
    """The call at which a run of 1000 at 1 in 60 s, 16.7 hours, is told to be too long."""
    now = [0.0]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ellipsoid_coupling.monitors.time.perf_counter", lambda: now[0])
        model: Any = Clock()
        pace = Pace(1000.0, hours * 3600.0)
        for call in range(1, 2001):
            now[0] += seconds_a_call
            model.time += seconds_a_call / 60.0
            told = pace.look(model, lambda: now[0])
            if told is not None:
                assert re.match(r"it would take 16\.\d hours more .*: rotation 100 %\. The", told)
                return call
    return None


@pytest.mark.parametrize(
    ("seconds_a_call", "call"),
    [
        # Ten short calls, and a second that says the same.
        (1.0 / 1024.0, 1024),
        (1.0 / 16.0, 16),
        # The first call is where it is counted from, the next may mislead.
        (1.0, 4),
        (30.0, 3),
        # A look over a minute needs no second one.
        (60.0, 2),
    ],
)
def test_a_pace_that_never_ends_is_told_soon(seconds_a_call: float, call: int) -> None:
    assert first_told(20.0, seconds_a_call) is None
    assert first_told(10.0, seconds_a_call) == call


def test_a_start_that_is_slow_for_a_moment_is_not_taken_for_the_whole(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Steps that grow threefold a call from 1e-12 of the run: the first look sees a week."""
    now = [0.0]
    monkeypatch.setattr("ellipsoid_coupling.monitors.time.perf_counter", lambda: now[0])
    model: Any = Clock()
    pace = Pace(1.0, 3600.0)
    for call in range(2000):
        now[0] += 0.01
        model.time += 10.0 ** min(0.5 * call - 12.0, -4.0)
        assert pace.look(model, lambda: now[0]) is None


def test_a_pace_counts_what_is_behind_and_not_what_stands_still(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Iterations to a stationary state move no time; hours that earlier parts took are hours."""
    now = [0.0]
    monkeypatch.setattr("ellipsoid_coupling.monitors.time.perf_counter", lambda: now[0])
    model: Any = Clock()
    pace = Pace(1.0, 3600.0)
    for _ in range(20):
        now[0] += 60.0
        assert pace.look(model, lambda: now[0]) is None
    model.time = 0.9
    now[0] += 60.0
    assert pace.look(model, lambda: 3000.0 + now[0]) is not None


SLOW = SMALL | {"interaction": None}


def beyond_bounds(scene: ec.Scene, **numerics: float) -> ec.Scene:
    """`scene` with numerics that a scene file may not have."""
    return scene.model_copy(update={"numerics": scene.numerics.model_copy(update=numerics)})


def test_a_run_that_would_take_too_long_stops_with_a_checkpoint(tmp_path: Path) -> None:
    scene = beyond_bounds(ec.load_scene("rotation", SLOW), cfl=1e-10)
    folder = ec.RunFolder(tmp_path, longest=1.0)
    told = (
        r"would take .* (?:hours|days|years) more .* (?:CFL number|force) (?:9\d(?:\.\d+)?|100) %"
        r".* strongest term .* --longest\. .* --resume"
    )
    with pytest.raises(ec.Interrupted, match=told) as caught:
        ec.simulate(scene, "rho_mono_kinetic", folder=folder)
    assert caught.value.exit_status == 1
    with pytest.raises(ec.Interrupted, match="--longest"):
        ec.simulate(scene, "rho_mono_kinetic", folder=replace(folder, resume=True))


def test_without_a_folder_it_stops_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ellipsoid_coupling.simulation.LONGEST_RUN", 1.0)
    with pytest.raises(RunError, match=r"(?:hours|days|years) more"):
        ec.simulate(beyond_bounds(ec.load_scene("rotation", SLOW), cfl=1e-10), "rho_mono_kinetic")


VIOLENT = {"interaction.strength": 1e60}
NOISY = {"noise.noise": 1.0, "noise.angular_noise": 1.0}
# What no scene file may have: see `limits`.
EXACT, SHORT = {"tolerance": 1e-90}, {"cfl": 1e-13}


@pytest.mark.parametrize(
    ("name", "changes", "numerics"),
    [
        ("microscopic", VIOLENT, {}),
        ("mckean_vlasov", VIOLENT, {}),
        # With noise no step is ever repeated, it only shrinks.
        ("microscopic", NOISY, EXACT),
        ("mckean_vlasov", NOISY, EXACT),
        ("rho_mono_kinetic", VIOLENT, {}),
        ("diffusive", VIOLENT, {}),
        ("q_mono_kinetic", VIOLENT, {}),
        ("q_maxwellian", {}, SHORT),
    ],
)
def test_a_step_that_vanishes_stops_with_term_place_and_remedy(
    name: str, changes: dict[str, float], numerics: dict[str, float]
) -> None:
    scene = ec.load_scene("rotation", SMALL | changes | {"particles.realisations": 2})
    scene = beyond_bounds(scene, **numerics)
    told = (
        r"t = .*step size fell below 1e-12.*\. The strongest term is .* at \(.*\)\. Relax the tol"
    )
    with pytest.raises(RunError, match=told):
        ec.simulate(scene, name)
