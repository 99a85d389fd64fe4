"""How to add a model: tracers, which follow the fluid without inertia.

    dr/dt = u(r)      dtheta/dt = 0

Two steps:

* a class with the members of `ellipsoid_coupling.models.Model`. It declares its properties in `kinds`, is
  built from a `Setup` (scene, terms, scheme, flow, seed, realisations), and is stepped by the one time loop
  of `simulate`, which also writes its checkpoints, checks its health and makes its result;
* its registration. An equation on cells is shorter: see `test_closure.py`.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.cli import main
from ellipsoid_coupling.models import (
    Arrays,
    Counts,
    FailureSite,
    Health,
    LineStyle,
    ModelKind,
    Setup,
    model_names,
    registry,
)
from ellipsoid_coupling.models.particle_model import random_points

Floats = NDArray[np.float64]


class Tracers:
    """`Model` of points that move with the fluid, by the classical fourth-order Runge-Kutta rule."""

    kinds: ClassVar[tuple[ModelKind, ...]] = (
        ModelKind(
            "tracers",
            label="tracers",
            layout="particles",
            style=LineStyle("#882255", "-", "d"),
            independent_realisations=True,
        ),
    )

    def __init__(self, name: str, setup: Setup) -> None:
        assert setup.flow is not None  # `require_fit` has refused scenes without a flow
        self.name = name
        self._flow, self._scene = setup.flow, setup.scene
        # Realisation k starts where that of any other model of particles starts: (R, 2, N).
        self._position = random_points(setup.scene, setup.seed, setup.realisations)
        self._clock = np.zeros(2)  # the time and the number of steps

    @staticmethod
    def require_fit(setup: Setup) -> None:
        """Refuse, in one line, a scene that the model has no equations for."""
        if setup.scene.flow is None:
            raise ec.InputError(
                f"scene {setup.scene.name}, model tracers",
                "a [flow] for the tracers to follow",
                "none",
                "Add [flow] or choose another model.",
            )

    @property
    def time(self) -> float:
        """The time reached."""
        return float(self._clock[0])

    def _velocity(self, position: Floats, t: float) -> Floats:
        # A flow may change in time; `advance` is never asked to go beyond a time at which it is given.
        sample = self._flow.at(t).evaluate(position[:, 0], position[:, 1])
        return np.stack([sample.velocity_x, sample.velocity_y], axis=1)

    def advance(self, until: float) -> None:
        """One step; the last one before `until` is shorter, so that it ends there."""
        step = self._scene.numerics.time_step
        last = self.time + step >= until
        dt = until - self.time if last else step
        start, t = self._position, self.time
        k1 = self._velocity(start, t)
        k2 = self._velocity(start + 0.5 * dt * k1, t + 0.5 * dt)
        k3 = self._velocity(start + 0.5 * dt * k2, t + 0.5 * dt)
        k4 = self._velocity(start + dt * k3, t + dt)
        self._position = start + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        # The loop waits for `until` exactly; a sum of steps would miss it by rounding.
        self._clock = np.array([until if last else self.time + dt, self._clock[1] + 1.0])

    def snapshot(self) -> Arrays:
        """x, y, angle and the three velocities, each (R, N), as of every model of particles."""
        velocity = self._velocity(self._position, self.time)
        still = np.zeros_like(velocity[:, 0])
        return {
            "x": self._position[:, 0].copy(),
            "y": self._position[:, 1].copy(),
            "angle": still + self._scene.start.angle,
            "velocity_x": velocity[:, 0],
            "velocity_y": velocity[:, 1],
            "angular_velocity": still,
        }

    def state(self) -> Arrays:
        """Positions and clock: a run that is restored from these goes on to the bit."""
        return {"position": self._position, "clock": self._clock}

    def restore(self, state: Arrays) -> None:
        """Continue from a `state`."""
        self._position = np.array(state.get("position", self._position), np.float64)
        self._clock = np.array(state.get("clock", self._clock), np.float64)

    def failure_site(self) -> FailureSite:
        """The fastest tracer."""
        speed = np.hypot(*np.moveaxis(self._velocity(self._position, self.time), 1, 0))
        k, i = np.unravel_index(int(np.argmax(speed)), speed.shape)
        x, y = (float(value) for value in self._position[k, :, i])
        return FailureSite((x, y), {"the fluid": float(speed[k, i])})

    def health(self) -> Health:
        """Mass and speed; no bound of the forces, because there are none."""
        speed = float(
            np.sqrt(np.square(self._velocity(self._position, self.time)).sum(axis=1).mean())
        )
        return Health(1.0, 0.0, (speed, 0.0), (math.inf, math.inf))

    def counts(self) -> Counts:
        """The steps and the balance of mass, which the monitors check."""
        balance = {"mass_start": 1.0, "mass_end": 1.0, "mass_left": 0.0}
        return {"steps": float(self._clock[1]), **balance}

    def coordinates(self) -> dict[str, Floats]:
        """None: realisations and particles are plain counts."""
        return {}


# That is the whole model. From here on it is registered and run like any other.

SETTINGS = {"times": [0.5, 1.0], "numerics.time_step": 1 / 16}


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """`ec.register_model(Tracers)`, undone after each test so that others do not see it."""
    monkeypatch.setattr(registry, "registered", {})
    ec.register_model(Tracers)


def rotated(x: Floats, y: Floats, time: float) -> tuple[Floats, Floats]:
    """The exact solution in u = (y, -x): a rotation by -t."""
    cosine, sine = math.cos(time), math.sin(time)
    return cosine * x + sine * y, cosine * y - sine * x


def status_of(*tokens: str) -> int | str | None:
    """The exit status of the command `ellipsoid`, here in this process."""
    with pytest.raises(SystemExit) as ended:
        main(tokens)
    return ended.value.code


def test_tracers_follow_the_rotation() -> None:
    """The Runge-Kutta rule errs by r dt^5/120 a step: 1.3e-7 r in all after 16 steps."""
    scene = ec.load_scene("rotation", SETTINGS)
    result = ec.simulate(scene, "tracers", seed=3, realisations=2)
    start = random_points(scene, 3, 2)
    for index, time in enumerate(result.times):
        x, y = rotated(start[:, 0], start[:, 1], float(time))
        np.testing.assert_allclose(result.variables["x"][index], x, rtol=0, atol=2e-7)
        np.testing.assert_allclose(result.variables["y"][index], y, rtol=0, atol=2e-7)
    assert result.attributes["steps"] == 16.0


def test_its_result_is_one_among_others() -> None:
    """The same bins as any other model: an unstirred density of 2 x 1000 tracers, normalised."""
    scene = ec.load_scene("rotation", SETTINGS)
    result = ec.simulate(scene, "tracers", realisations=2)
    density = result.density(cells=20)
    assert density.shape[0] == len(scene.times)
    assert result.attributes["resolution"].endswith("particles, tolerance = 0.0001")


def test_it_runs_on_the_command_line_and_stands_in_its_messages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Registered in the same process; the run folder then loads like any other."""
    small = ("--set", "times=[0.1]", "particles.number=50")
    folder = tmp_path / "run"
    assert status_of("run", "rotation", "--model", "tracers", "--out", str(folder), *small) == 0
    assert ec.Result.load(folder).model == "tracers"
    assert status_of("plan", "rotation", "--model", "tracers") == 0
    assert "which this model does not have" in " ".join(capsys.readouterr().out.split())
    assert status_of("run", "rotation", "--model", "nonsense") == 2
    assert "tracers" in capsys.readouterr().err


def test_an_interrupted_run_continues_to_the_bit(tmp_path: Path) -> None:
    """A checkpoint after every step, and an end after the first: then on to the same result."""
    scene = ec.load_scene("rotation", SETTINGS)
    whole = ec.simulate(scene, "tracers", seed=1)
    folder = ec.RunFolder(tmp_path / "run", checkpoint_seconds=0.0, stop_after=1e-9)
    with pytest.raises(ec.Interrupted):
        ec.simulate(scene, "tracers", seed=1, folder=folder)
    resumed = ec.simulate(
        scene, "tracers", seed=1, folder=ec.RunFolder(tmp_path / "run", resume=True)
    )
    np.testing.assert_array_equal(resumed.variables["x"], whole.variables["x"])


def test_what_is_no_model_is_refused() -> None:
    class Nothing:
        kinds = ()

    with pytest.raises(TypeError, match=r"Nothing is no Model: it has no advance, coordinates"):
        ec.register_model(Nothing)  # type: ignore[arg-type]

    class Other(Tracers):
        pass

    with pytest.raises(ValueError, match="tracers belongs to another model"):
        ec.register_model(Other)
    ec.register_model(Tracers)
    assert model_names().count("tracers") == 1


def test_a_scene_without_a_flow_is_refused_before_anything_is_computed() -> None:
    with pytest.raises(ec.InputError, match=r"a \[flow\] for the tracers to follow"):
        ec.simulate(ec.load_scene("stationary"), "tracers")
