"""The microscopic model: invariants, leaving out, threads, statuses."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError, RunError
from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.models import Setup, build_model, from_scene, particle_model
from ellipsoid_coupling.models import microscopic as module
from ellipsoid_coupling.models.microscopic import Microscopic
from ellipsoid_coupling.particles.noise import gaussian_block
from ellipsoid_coupling.scenes import load_scene, terms_of
from tests.small_runs import IDLE

Floats = NDArray[np.float64]

SMALL = {"particles.number": 60, "particles.realisations": 3, "times": [0.4]}
# Fluid and interaction; noise, potentials and interaction: kernels that other tests need as well.
QUIET_AND_NOISY = pytest.mark.parametrize("scene", ["rotation", "stationary"])


def model_of(
    name: str,
    settings: dict[str, Any],
    flow: FlowField | None,
    scheme: Any = "accurate",
    seed: int = 1,
) -> Microscopic:
    scene = load_scene(name, SMALL | settings)
    setup = Setup(scene, terms_of(scene), scheme, flow, seed, scene.particles.realisations)
    return Microscopic("microscopic", setup)


def run(model: Microscopic, until: float) -> Microscopic:
    while model.time < until:
        model.advance(until)
    return model


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@QUIET_AND_NOISY
def test_same_bits_on_one_thread_and_on_two(
    scheme: str, scene: str, rotation_flow: FlowField
) -> None:
    flow = rotation_flow if scene == "rotation" else None
    threads = numba.get_num_threads()
    ends = []
    try:
        for count in (1, min(2, threads)):
            numba.set_num_threads(count)
            ends.append(run(model_of(scene, {}, flow, scheme), 0.4).snapshot())
    finally:
        numba.set_num_threads(threads)
    for name, values in ends[0].items():
        assert np.array_equal(values, ends[1][name]), name


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
@QUIET_AND_NOISY
def test_a_large_realisation_runs_as_a_small_one_does(
    scheme: str, scene: str, rotation_flow: FlowField, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To 1e-9: sums in another order, and what that grows to in some twenty steps."""
    flow = rotation_flow if scene == "rotation" else None
    settings: dict[str, Any] = {"particles.number": 1200, "particles.realisations": 2}
    settings |= {"particles.length": 0.1, "particles.width": 0.05}
    small = run(model_of(scene, settings, flow, scheme), 0.2)
    monkeypatch.setattr(module, "LARGE_CLOUD", 1000)
    large = run(model_of(scene, settings, flow, scheme), 0.2)
    assert large._large is not None
    assert small._large is None
    assert large.counts() == small.counts()
    for name, values in small.snapshot().items():
        assert np.allclose(large.snapshot()[name], values, atol=1e-9), name


def test_interaction_keeps_the_momentum_to_rounding(rotation_flow: FlowField) -> None:
    """Where nothing else acts: the sum of all velocities stays 0 (1e-13 of their size)."""
    alone = IDLE | {"particles.number": 100}
    end = run(model_of("stationary", alone, rotation_flow), 0.4).snapshot()
    for name in ("velocity_x", "velocity_y"):
        assert np.abs(end[name].sum(axis=1)).max() < 1e-13 * np.abs(end[name]).sum()
        assert np.abs(end[name]).max() > 1e-4


def test_realisations_do_not_depend_on_how_many_there_are(rotation_flow: FlowField) -> None:
    few = run(model_of("rotation", {"particles.realisations": 2}, rotation_flow), 0.4).snapshot()
    many = run(model_of("rotation", {"particles.realisations": 4}, rotation_flow), 0.4).snapshot()
    for name, values in few.items():
        assert np.array_equal(values, many[name][:2]), name


def test_without_interaction_nobody_looks_for_neighbours(
    rotation_flow: FlowField, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forbidden(*_: object) -> None:
        raise AssertionError("a part that the scene does not have was built")

    monkeypatch.setattr(from_scene, "cell_grid", forbidden)
    monkeypatch.setattr(from_scene, "scene_walls", forbidden)
    model = model_of("rotation", {"interaction": None}, rotation_flow)
    assert model._drift.pairs is None
    run(model, 0.1)


def test_without_noise_no_random_number_is_drawn(
    rotation_flow: FlowField, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[int] = []

    def counted(seed: int, realisation: int, block: int, components: int, number: int) -> Floats:
        drawn.append(components)
        return gaussian_block(seed, realisation, block, components, number)

    monkeypatch.setattr(particle_model, "gaussian_block", counted)
    run(model_of("rotation", {}, rotation_flow), 0.1)
    assert drawn == []
    only_a = {"noise.noise": 1.0, "noise.angular_noise": 0.0}
    run(model_of("rotation", only_a, rotation_flow, "paper"), 0.02)
    assert set(drawn) == {2}  # two translational components, none for the angle


def test_circles_carry_no_torque_and_still_scenes_no_angle(rotation_flow: FlowField) -> None:
    circles = model_of("rotation", {"particles.width": 0.1}, rotation_flow)
    assert circles._drift.pairs is not None
    assert circles._drift.pairs.torque_weight is None
    still = model_of("rotation", {"particles.width": 0.1, "flow.angular_drag": 0.0}, rotation_flow)
    assert still.state()["place"].shape[1] == 2
    end = run(still, 0.1).snapshot()
    assert np.all(end["angle"] == np.pi / 2)
    assert np.all(end["angular_velocity"] == 0.0)


def test_a_torque_free_rotation_turns_all_particles_alike(rotation_flow: FlowField) -> None:
    """Circles in u = (y, -x): omega' = -1 - omega from rest, theta = pi/2 - (t - 1 + e^-t)."""
    scene = {"interaction": None, "particles.width": 0.1, "numerics.tolerance": 1e-9}
    end = run(model_of("rotation", scene, rotation_flow), 0.4).snapshot()
    assert np.allclose(end["angle"], np.pi / 2 - (0.4 - 1 + np.exp(-0.4)), atol=1e-9)


def test_a_particle_beyond_the_flow_is_reported(stagnation_flow: FlowField) -> None:
    """Reflecting walls far outside the flow's own bounds: the run fails and says where."""
    bounded = stagnation_flow.arrays._replace(x_low=-1.0, x_high=1.0, y_low=-1.0, y_high=1.0)
    flow = FlowField(bounded, "bounded")
    scene = {"domain.boundary": "reflecting", "interaction": None, "times": [3.0]}
    with pytest.raises(RunError, match="a particle has left the flow at"):
        run(model_of("top_bottom", scene, flow), 3.0)
    counted = run(model_of("top_bottom", {"interaction": None, "times": [3.0]}, flow), 3.0)
    assert counted.counts()["particles_outside_flow"] > 0


def test_a_diverging_run_says_so(rotation_flow: FlowField) -> None:
    """Euler-Maruyama with dt gamma = 50 is unstable: a message with time and remedy, no NaN result."""
    stiff = {"flow.drag": 5000.0, "interaction": None, "times": [30.0]}
    model = model_of("rotation", stiff, rotation_flow, "paper")
    with pytest.raises(RunError, match=r"no longer finite.*smaller time step"):
        run(model, 30.0)


def test_unknown_names_list_the_known_ones() -> None:
    scene = load_scene("rotation")
    setup = Setup(scene, terms_of(scene), "paper", None, 0, 1)
    with pytest.raises(InputError, match="microscopic"):
        build_model("nonsense", setup)
