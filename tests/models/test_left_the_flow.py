"""Particles beyond the flow's mesh are frozen, counted, and left out of everything else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ellipsoid_coupling as ec
from ellipsoid_coupling.compare.distances import errors_against
from ellipsoid_coupling.compare.error_budget import bin_result
from ellipsoid_coupling.compare.exact_solution import exact_reference
from ellipsoid_coupling.compiled.tuning import LARGE_CLOUD
from ellipsoid_coupling.errors import RunError
from ellipsoid_coupling.result import Result
from ellipsoid_coupling.scenes import Scene
from tests.known_flows import channel, growing_channel

DRAG = 10.0
BOTH = pytest.mark.parametrize("scheme", ["paper", "accurate"])
# Each model and each scheme once, where what is tested is common to both.
PAIRED = pytest.mark.parametrize(
    ("model", "scheme"), [("microscopic", "accurate"), ("mckean_vlasov", "paper")]
)
# The other way round, which compiles faster.
PAIRS = [("microscopic", "paper"), ("mckean_vlasov", "accurate")]
CROSSED = pytest.mark.parametrize(("model", "scheme"), PAIRS)
EACH = pytest.mark.parametrize("model", ["microscopic", "mckean_vlasov"])


def scene(**changes: Any) -> Scene:
    settings = {
        "domain.x": [0.0, 4.0], "domain.y": [0.0, 1.0], "domain.boundary": "open",
        "start.x": [3.0, 3.6], "start.y": [0.2, 0.8], "particles.number": 100,
        "particles.length": 0.05, "particles.width": 0.025, "particles.inertia": 0.001,
        "particles.realisations": 2, "times": [0.3, 0.7, 2.0], "numerics.cell": 0.125,
        "flow.drag": DRAG, "flow.angular_drag": DRAG, "numerics.time_step": 0.01,
    }  # fmt: skip
    if "start.points" in changes:
        changes |= {"start.x": [0.0, 4.0], "start.y": [0.0, 1.0]}
    return ec.load_scene("cavity_free", settings | changes)


def travelled(time: float) -> float:
    """How far a particle at rest comes in a fluid of speed 1: t - (1 - exp(-gamma t))/gamma."""
    return time - (1.0 - float(np.exp(-DRAG * time))) / DRAG


@CROSSED
def test_who_leaves_is_frozen_and_counted(model: str, scheme: Any) -> None:
    """Against the closed form: frozen within a step and half a cell behind the outlet, for ever.

    `paper` is first order, off by dt = 0.01; particles nearer to the outlet than that may differ.
    """
    result = ec.simulate(scene(), model, scheme, flow=channel())
    x, frozen = result.variables["x"], result.variables["frozen"]
    started = x[0] - travelled(0.3)
    assert np.all(frozen[0] == 0.0)
    for k, time in enumerate((0.3, 0.7, 2.0)):
        reached = started + travelled(time)
        clear = np.abs(reached - 4.0) > 0.011
        assert np.array_equal(frozen[k][clear] == 1.0, reached[clear] > 4.0)
        moving = frozen[k] == 0.0
        assert np.abs(x[k] - reached)[moving].max(initial=0.0) < 0.011
    gone = frozen[-1] == 1.0
    assert gone.all()
    assert np.all((x[-1] > 4.0) & (x[-1] < 4.0 + 1.0 / 32.0))
    for name in ("velocity_x", "velocity_y", "angular_velocity"):
        assert np.all(result.variables[name][frozen == 1.0] == 0.0)
    early = frozen[1] == 1.0
    assert early.any()
    assert not early.all()
    for name in ("x", "y", "angle"):
        assert np.array_equal(result.variables[name][1][early], result.variables[name][2][early])
    assert result.attributes["mass_end"] == 0.0
    assert result.attributes["mass_left"] == 1.0
    assert result.attributes["particles_outside_flow"] == x[0].size


@pytest.mark.parametrize(
    ("model", "scheme", "noise"),
    [(*one, noise) for one in PAIRS for noise in (0.0, 0.3)],
)
def test_a_flow_that_grows_beyond_its_mesh_stops_nobody(
    model: str, scheme: Any, noise: float
) -> None:
    """The last cell's cubic, continued, reaches 1e20; those that stay must not feel any of it.

    Those in the slow layer at the bottom stay, and end where they do without the others: to 1e-3 of
    a length by `accurate` steps, whose error is one of all; exactly by `paper`.
    """
    slow = [[0.2, 0.02], [0.3, 0.03], [0.2, 0.04]]
    fast = [[3.0 + 0.02 * k, 0.5] for k in range(40)]
    given = {"particles.realisations": 1, "times": [0.5, 1.5], "flow.drag": 5.0}
    if noise:
        given |= {"noise.noise": noise, "noise.angular_noise": noise}
    both, alone = (
        ec.simulate(
            scene(**given, **{"particles.number": len(points), "start.points": points}),
            model, scheme, flow=growing_channel(),
        )
        for points in (slow + fast, slow)
    )  # fmt: skip
    assert both.status == "completed"
    assert both.variables["frozen"][-1, 0, 3:].all()
    assert np.all(np.abs(both.variables["x"]) < 5.0)
    if not noise:
        assert not both.variables["frozen"][-1, 0, :3].any()
        near = 0.0 if scheme == "paper" else 5e-5
        apart = both.variables["x"][-1, 0, :3] - alone.variables["x"][-1, 0]
        assert np.abs(apart).max() <= near


def test_frozen_particles_neither_push_nor_are_pushed() -> None:
    """Pairs of which one has left: the other moves as if alone; the weight stays 1/N."""
    points = [[3.95, 0.5], [3.3, 0.5], [1.0, 0.5]]
    given = {
        "particles.realisations": 1, "particles.number": 3, "start.points": points,
        "particles.length": 0.2, "particles.width": 0.1, "interaction.strength": 0.5,
        "times": [0.35, 0.78],
    }  # fmt: skip
    result = ec.simulate(scene(**given), "microscopic", "paper", flow=channel())
    assert result.variables["frozen"][:, 0].tolist() == [[1.0, 0.0, 0.0]] * 2
    x = result.variables["x"][:, 0]
    # At last within reach of the frozen one; like the third, which has no neighbour.
    assert x[-1, 1] > 4.0 - 0.2
    assert np.abs((x[-1] - x[0])[1] - (x[-1] - x[0])[2]) < 1e-3
    assert result.variables["y"][-1, 0] == pytest.approx([0.5] * 3, abs=1e-12)


@PAIRED
def test_pairs_of_the_others_go_on(model: str, scheme: Any) -> None:
    """A second swarm far upstream moves as it does where the first is not yet gone: to rounding.

    By harmonics and splines to 1e-6, as nodes are summed in another order; steps are the same.
    """
    rng = np.random.default_rng(1)
    ahead = np.column_stack((rng.uniform(3.7, 3.9, 30), rng.uniform(0.3, 0.7, 30)))
    behind = np.column_stack((rng.uniform(1.0, 1.2, 30), rng.uniform(0.4, 0.6, 30)))
    given = {
        "particles.realisations": 1, "interaction.strength": 0.01, "times": [1.5],
        "numerics.tolerance": 1e-8 if scheme == "accurate" else 1e-4,
    }  # fmt: skip
    found = []
    for shift in (0.0, -2.0):
        points = np.concatenate((ahead + np.array([shift, 0.0]), behind)).tolist()
        settings = given | {"particles.number": 60, "start.points": points}
        found.append(ec.simulate(scene(**settings), model, scheme, flow=channel()))
    assert found[0].variables["frozen"][-1, 0].tolist() == [1.0] * 30 + [0.0] * 30
    assert not found[1].variables["frozen"].any()
    for name in ("x", "y", "angle"):
        here, there = (result.variables[name][-1, 0, 30:] for result in found)
        assert np.abs(here - there).max() < 1e-6, name


def test_large_clouds_freeze_likewise() -> None:
    """All threads on one realisation: as many frozen as by the closed form, the others as they were."""
    given = {
        "particles.realisations": 1, "particles.number": LARGE_CLOUD, "times": [0.5],
        "interaction.strength": 1e-6, "numerics.time_step": 0.05,
    }  # fmt: skip
    result = ec.simulate(scene(**given), "microscopic", "paper", flow=channel())
    gone = result.variables["frozen"][-1, 0] == 1.0
    part = (travelled(0.5) - 0.4) / 0.6
    # The start is at random: three standard deviations, and a step of 0.05.
    assert gone.mean() == pytest.approx(max(part, 0.0), abs=0.1)
    assert 0.0 < gone.mean() < 1.0
    assert np.all(result.variables["x"][-1, 0][~gone] <= 4.0)


@CROSSED
def test_nothing_passes_through_a_solid(model: str, scheme: Any) -> None:
    """Nor over one that a step could jump: thinner than a step of `paper` here."""
    thin = channel(solid=(2.0, 2.0626))
    given = {"start.x": [1.0, 1.5], "start.y": [0.3, 0.7], "times": [3.0]}
    result = ec.simulate(scene(**given, **{"numerics.time_step": 0.15}), model, scheme, flow=thin)
    assert np.all(result.variables["frozen"] == 1.0)
    x = result.variables["x"]
    assert np.all((x >= 2.0) & (x <= 2.0626))


@CROSSED
def test_where_the_scene_reflects_the_run_stops_at_the_place(model: str, scheme: Any) -> None:
    """The particle that left is named, not the one that is pulled hardest, with the mesh's rectangle."""
    x, y = np.linspace(0.0, 4.0, 65), np.linspace(0.0, 1.0, 17)
    psi = np.outer(np.sin(np.pi * y) ** 2, np.sin(0.25 * np.pi * x) ** 2)
    inside = np.ones((16, 64), np.bool_)
    inside[4:12, 51:58] = False
    flow = ec.FlowField.from_stream_function(psi, x, y, "a roll with a solid", inside=inside)
    points = [[2.5, 0.15], [2.2, 0.4]]
    given = {
        "domain.boundary": "reflecting", "particles.number": 2, "start.points": points,
        "times": [5.0], "particles.realisations": 1,
    }  # fmt: skip
    with pytest.raises(RunError, match=r"has left the flow at \(3\.[1-6]\d*, 0\.[2-7]") as stopped:
        ec.simulate(scene(**given), model, scheme, flow=flow)
    assert "[0, 4] x [0, 1]" in str(stopped.value)


@EACH
def test_frozen_particles_stay_frozen_after_a_kill(model: str, tmp_path: Path) -> None:
    """Resumed between the leaving of some and of others, with noise: the same bits."""

    class Stop(BaseException):
        pass

    def stop(_stage: str, part: float) -> None:
        if part > 0.3:
            raise Stop

    given = {"noise.noise": 0.2, "noise.angular_noise": 0.2, "times": [0.2, 2.0]}
    own = scene(**given)
    whole = ec.simulate(own, model, "paper", flow=channel())
    place = ec.RunFolder(tmp_path, checkpoint_seconds=0.0)
    with pytest.raises(Stop):
        ec.simulate(own, model, "paper", flow=channel(), folder=place, report=stop)
    place = ec.RunFolder(tmp_path, resume=True)
    resumed = ec.simulate(own, model, "paper", folder=place)
    for name, values in whole.variables.items():
        assert np.array_equal(values, resumed.variables[name]), name
    assert 0.0 < whole.variables["frozen"].mean() < 1.0
    assert whole.attributes["mass_left"] == resumed.attributes["mass_left"]


@pytest.fixture(scope="module")
def half_gone() -> Result:
    return ec.simulate(scene(times=[0.3, 0.75]), "microscopic", "paper", flow=channel())


def test_bins_leave_frozen_particles_out(half_gone: Result) -> None:
    """The density's integral is the mass that is left; angles are those of the particles left."""
    domain = scene().domain
    left = half_gone.variables["frozen"].mean(axis=(1, 2))
    assert 0.2 < left[-1] < 0.9
    area = domain.width * domain.height / 30**2
    assert half_gone.density(30).sum(axis=(1, 2)) * area == pytest.approx(1.0 - left, abs=1e-12)
    turned = half_gone.angle_distribution(60).sum(axis=1) * 2.0 * np.pi / 60
    assert turned == pytest.approx([1.0, 1.0])
    bins = bin_result(half_gone, 100)
    assert bins.density.mean(axis=0).sum(axis=1) == pytest.approx(1.0 - left, abs=1e-12)


def test_the_exact_solution_freezes_as_well(half_gone: Result) -> None:
    """Errors are those of what is left: as small after particles have gone as before.

    200 particles at random on 400 bins: 0.9 of chance.
    """
    exact = exact_reference(scene(times=[0.3, 0.75]), channel(), 64)
    left = exact.variables["frozen"].mean(axis=(1, 2))
    assert left[0] == 0.0
    assert left[1] == pytest.approx((travelled(0.75) - 0.4) / 0.6, abs=0.03)
    errors = errors_against(half_gone, exact)
    assert np.all(errors.density < 1.2)


def test_results_with_frozen_particles_survive_their_file(
    half_gone: Result, tmp_path: Path
) -> None:
    half_gone.save(tmp_path / "result.nc")
    loaded = Result.load(tmp_path)
    assert np.array_equal(loaded.variables["frozen"], half_gone.variables["frozen"])
    assert loaded.attributes["mass_left"] == half_gone.attributes["mass_left"]
    assert half_gone.to_dataset()["particle_frozen"].attrs["units"] == "1"


def test_without_a_mesh_nothing_is_marked() -> None:
    """A formula holds everywhere; what cannot be left costs nothing."""
    result = ec.simulate(
        ec.load_scene("rotation", {"particles.number": 5, "times": [0.1], "interaction": None}),
        "microscopic",
    )
    assert "frozen" not in result.variables
    assert result.attributes["mass_left"] == 0.0


@BOTH
def test_bits_are_those_of_a_flow_that_cannot_be_left(scheme: Any) -> None:
    """While nothing leaves: the watch looks, and changes no bit."""
    own = scene(**{"start.x": [1.0, 2.0], "times": [0.5], "interaction.strength": 0.01})
    bounded, arrays = channel(), channel().arrays
    far = ec.FlowField(
        arrays._replace(x_low=-np.inf, x_high=np.inf, y_low=-np.inf, y_high=np.inf), "a formula"
    )
    found = [ec.simulate(own, "microscopic", scheme, flow=flow) for flow in (bounded, far)]
    for name in ("x", "y", "angle", "velocity_x", "velocity_y", "angular_velocity"):
        here, there = (result.variables[name] for result in found)
        assert np.array_equal(here, there), name
