"""The samples' interaction against pair sums, and the nonlinear process against the microscopic one."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.flow import FlowField, analytic_flow
from ellipsoid_coupling.interaction.pairs.cells import Sources, cell_grid, sort_by_cell
from ellipsoid_coupling.interaction.pairs.ghost_forces import add_ghost_forces
from ellipsoid_coupling.interaction.pairs.pair_sum import Pairs, add_pair_forces
from ellipsoid_coupling.interaction.particle_mesh.forces import SampleInteraction
from ellipsoid_coupling.interaction.particle_mesh.region import Region
from ellipsoid_coupling.models import Model, SchemeName, Setup, build_model, model_terms
from ellipsoid_coupling.models.mckean_vlasov import McKeanVlasov
from ellipsoid_coupling.physics.potential import potential_shape
from ellipsoid_coupling.scenes import Scene, load_scene

Floats = NDArray[np.float64]

UNIT = (0.0, 1.0)
LENGTH, WIDTH = 0.05, 0.025
SHAPE = potential_shape(LENGTH, WIDTH)
# Beside noise and a fluid, for kernels that other tests need as well.
TRAP = {"stiffness": 0.5}


@pytest.fixture
def one_thread() -> Iterator[None]:
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(before)


@functools.cache
def interaction() -> SampleInteraction:
    return SampleInteraction(Region(UNIT, UNIT), SHAPE, WIDTH, 1.0, 2e-2)


def forces(place: Floats) -> Floats:
    """Forces on (K, 3, B) samples of unit mass and inertia."""
    force = np.zeros_like(place)
    interaction().add_forces(place, (1.0, 1.0), force)
    return force


def pair_sums(place: Floats) -> Floats:
    """The exact forces on one block of samples, (3, B)."""
    count = place.shape[1]
    pairs = Pairs(cell_grid(UNIT, UNIT, SHAPE.reach), SHAPE, 1.0 / count, 1.0 / count, None, 0.0)
    force = np.zeros_like(place)
    axis = np.array([np.cos(2.0 * place[2]), np.sin(2.0 * place[2])])
    add_pair_forces(place, axis, pairs, force)
    return force


def random_cloud() -> Floats:
    rng = np.random.default_rng(1)
    return np.array([*rng.uniform(0.3, 0.7, (2, 4000)), rng.uniform(0.0, 7.0, 4000)])


def even_cloud() -> Floats:
    """A sheared square with a smooth field of angles: what runs without noise look like."""
    part = (np.arange(128) + 0.5) / 128
    x, y = (a.ravel() for a in np.meshgrid(0.3 + 0.4 * part, 0.3 + 0.4 * part))
    return np.array([x + 0.2 * (y - 0.5), y, np.sin(8.0 * x)])


def relative_error(place: Floats) -> Floats:
    """Root mean square error of force and torque over their root mean squares."""
    exact = pair_sums(place)
    miss = forces(place[None])[0] - exact
    square = np.array([[np.sum(a[:2] ** 2), np.sum(a[2] ** 2)] for a in (miss, exact)])
    return np.asarray(np.sqrt(square[0] / square[1]))


def test_force_of_scattered_samples_is_the_pair_sum() -> None:
    # Independent points, whose force is all in the kernel's finest scales, at a tolerance of 2e-2: the
    # spline's error with 6.9 nodes to a width D and the series', 9e-4 and 2.7e-3.
    assert np.all(relative_error(random_cloud()) < [1.5e-3, 4e-3])


def test_force_of_an_even_density_is_the_pair_sum() -> None:
    # A smooth density has no fine scales: 4e-4 and 1e-3 of a force that is small itself.
    assert np.all(relative_error(even_cloud()) < [6e-4, 1.5e-3])


def test_total_force_vanishes() -> None:
    # For a smooth density to single precision's rounding. The slopes of independent points are off by
    # the spline's error each (9e-4, see above), at random: their sum by as much of a random walk.
    smooth, scattered = (forces(cloud[None])[0, :2] for cloud in (even_cloud(), random_cloud()))
    assert np.all(np.abs(smooth.sum(axis=1)) < 1e-6 * np.abs(smooth).sum())
    assert np.all(np.abs(scattered.sum(axis=1)) < 3e-3 * np.sqrt(np.sum(scattered**2)))


@pytest.mark.parametrize("plane", [(0, 1), (0, 2), (1, 2)])
def test_forces_are_slopes_of_one_energy(plane: tuple[int, int]) -> None:
    """Leading a sample round a closed way, in space or in place and angle, takes no work.

    To rounding of the potential in single precision, whose differences the forces are, 3e-7; splines
    of the forces themselves would take 1e-4 to 7e-4.
    """
    place, turns = random_cloud()[:, :200], 2.0 * np.pi * np.arange(100) / 100
    start, sizes = place[:, 0].copy(), (0.02, 0.4)
    way = np.tile(start[:, None], turns.size)
    speed = np.zeros_like(way)
    for axis, wave, slope in zip(
        plane, (np.cos(turns), np.sin(turns)), (-np.sin(turns), np.cos(turns)), strict=True
    ):
        way[axis] += sizes[axis // 2] * wave
        speed[axis] = sizes[axis // 2] * slope
    felt = np.empty_like(way)
    for k in range(turns.size):
        place[:, 0] = way[:, k]
        felt[:, k] = forces(place[None])[0, :, 0]
    power = felt * speed
    assert abs(power.sum()) < 1e-5 * np.abs(power).sum()
    assert np.abs(power[plane[0]]).sum() > 0.1 * np.abs(power).sum()


def test_samples_beyond_the_nodes_neither_act_nor_feel() -> None:
    place = random_cloud()
    alone = forces(place[None])
    place_out = np.concatenate([place, place + np.array([[5.0], [0.0], [0.0]])], axis=1)
    both = forces(place_out[None])
    assert np.all(both[0, :, 4000:] == 0.0)
    # Each sample weighs half as much.
    assert both[0, :, :4000] == pytest.approx(0.5 * alone[0], rel=1e-5, abs=1e-5)
    assert np.all(forces(np.full((2, 3, 4), 9.0)) == 0.0)


def test_samples_on_nodes_read_nothing_that_is_not_there() -> None:
    """The last of four spline weights is 0 there: nodes that only it touches belong to the stencil.

    A rectangle of samples, once on the nodes and once 1e-9 beside them: the same forces. Freed memory
    is filled with NaN before, so that reading beyond an array shows.
    """
    step = WIDTH / 4.0
    x, y = (a.ravel() for a in np.meshgrid(0.25 + step * np.arange(9), 0.25 + step * np.arange(5)))
    place = np.array([x, y, np.sin(8.0 * x)])[None]
    beside = forces(place + np.array([[1e-9], [1e-9], [0.0]]))
    for _ in range(20):
        junk = [np.full(n, np.nan) for n in (64, 256, 1024, 4096, 16384)]
        del junk
        assert forces(place) == pytest.approx(beside, rel=1e-4, abs=1e-5 * np.abs(beside).max())


@pytest.mark.usefixtures("one_thread")
def test_bits_for_any_number_of_threads_and_split_into_blocks() -> None:
    place = random_cloud()[None]
    single = forces(place)
    numba.set_num_threads(2)
    assert np.array_equal(single, forces(place))
    blocks = np.ascontiguousarray(place.reshape(3, 20, 200).transpose(1, 0, 2))
    assert np.array_equal(single[0], forces(blocks).transpose(1, 0, 2).reshape(3, 4000))


def test_ghosts_alone_are_the_pair_sum_of_particles_with_ghosts() -> None:
    # The microscopic sum with ghosts, less the one without: rounding.
    rng = np.random.default_rng(2)
    place = np.array([*rng.uniform(0.0, 1.0, (2, 200)), rng.uniform(0.0, 7.0, 200)])
    axis = np.array([np.cos(2.0 * place[2]), np.sin(2.0 * place[2])])
    grid = cell_grid(UNIT, UNIT, SHAPE.reach)
    along = np.linspace(0.0, 1.0, 21)
    zeros, ones = np.zeros(21), np.ones(21)
    ghosts: Sources = sort_by_cell(along, zeros, ones, zeros, grid)[0]
    pairs = Pairs(grid, SHAPE, 0.2, 0.3, ghosts, 10.0)
    both, own, found = np.zeros((3, *place.shape))
    add_pair_forces(place, axis, pairs, both)
    add_pair_forces(place, axis, pairs._replace(ghosts=None), own)
    add_ghost_forces(place, ghosts, pairs, found)
    assert np.abs(found - (both - own)).max() < 1e-12 * np.abs(both).max()
    assert np.abs(found).max() > 0.0


def scene_with(name: str = "top_bottom", **parts: Any) -> Scene:
    """The scene with parts replaced; None leaves one out."""
    table = load_scene(name).model_dump(exclude_none=True) | parts
    return Scene.model_validate({k: v for k, v in table.items() if v is not None})


def model_of(
    model: str, scene: Scene, scheme: SchemeName = "accurate", realisations: int = 1
) -> Model:
    flow: FlowField | None = analytic_flow(scene.flow.name) if scene.flow else None
    return build_model(
        model,
        Setup(scene, model_terms(scene, model), scheme, flow, seed=3, realisations=realisations),
    )


def snapshot_of(model: Model) -> dict[str, Floats]:
    return {name: np.asarray(a, np.float64) for name, a in model.snapshot().items()}


def run(model: Model, until: float) -> dict[str, Floats]:
    while model.time < until:
        model.advance(until)
    return snapshot_of(model)


def particles(number: int, **others: float) -> dict[str, float]:
    return load_scene("top_bottom").particles.model_dump() | {"number": number} | others


@pytest.mark.parametrize("scheme", ["paper", "accurate"])
def test_one_block_without_interaction_is_the_microscopic_trajectory(scheme: SchemeName) -> None:
    # Same start, same noise, same kernels, same steps: the same bits, for all signs at once.
    noise = {"noise": 0.5, "angular_noise": 0.7}
    scene = scene_with(interaction=None, particles=particles(50), noise=noise, outer_potential=TRAP)
    found, exact = (run(model_of(m, scene, scheme), 0.5) for m in ("mckean_vlasov", "microscopic"))
    for name, values in exact.items():
        assert np.array_equal(found[name], values), name


def test_paper_scheme_is_coupled_path_by_path() -> None:
    # Fixed steps: sample (k, i) draws what particle i of realisation k draws, with V1 and V2.
    scene = scene_with("stationary", interaction=None)
    found = run(model_of("mckean_vlasov", scene, "paper", 3), 0.5)
    exact = run(model_of("microscopic", scene, "paper", 3), 0.5)
    for name, values in exact.items():
        assert np.array_equal(found[name], values.reshape(1, -1)), name


@pytest.mark.parametrize(("scheme", "order"), [("paper", 1), ("accurate", 2)])
def test_order_with_interaction(scheme: SchemeName, order: int) -> None:
    # Against a run with far smaller steps, fixed by a tolerance that never shortens them. The
    # reference's own error adds 0.1 to the first order, higher terms 0.14 to the second.
    scene = scene_with(
        particles=particles(100, inertia=0.1),
        start={"x": (-0.3, 0.3), "y": (-0.3, 0.3), "angle": 0.5},
        interaction={"strength": 5.0},
    )

    def end(step: float) -> Floats:
        numerics = scene.numerics.model_copy(update={"time_step": step, "tolerance": 1.0})
        model = model_of("mckean_vlasov", scene.model_copy(update={"numerics": numerics}), scheme)
        for target in np.arange(1, round(0.2 / step) + 1) * step:
            found = run(model, float(target))
        return np.concatenate([found[name] for name in ("x", "y", "angle")])

    coarse, fine, finest = (end(0.2 / steps) for steps in (8, 16, 128))
    errors = [np.sqrt(np.mean((run_end - finest) ** 2)) for run_end in (coarse, fine)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


def test_restart_bit_for_bit_and_threads() -> None:
    noise = {"noise": 0.5, "angular_noise": 0.5}
    scene = scene_with(particles=particles(200), noise=noise, outer_potential=TRAP)
    first, second = (model_of("mckean_vlasov", scene, realisations=3) for _ in range(2))
    first.advance(1.0)
    second.restore({name: array.copy() for name, array in first.state().items()})
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    second.advance(1.0)
    numba.set_num_threads(threads)
    first.advance(1.0)
    for name, values in first.snapshot().items():
        assert np.array_equal(values, second.snapshot()[name]), name


@pytest.mark.parametrize(
    ("scheme", "interaction"), [("paper", False), ("paper", True), ("accurate", True)]
)
def test_shared_blocks_have_the_bits_of_blocks_one_by_one(
    monkeypatch: pytest.MonkeyPatch, scheme: SchemeName, interaction: bool
) -> None:
    """With noise, over a call of `advance`; many samples in many blocks are always shared."""
    noise = {"noise": 0.5, "angular_noise": 0.5}
    settings: dict[str, Any] = {} if interaction else {"interaction": None}
    settings |= {"particles": particles(50), "outer_potential": TRAP}
    scene = scene_with(noise=noise, **settings)
    found = []
    for least in (0, 10**6):
        monkeypatch.setattr("ellipsoid_coupling.particles.shared_clock.FEW_SAMPLES", least)
        model = model_of("mckean_vlasov", scene, scheme, realisations=5)
        model.advance(1.0)
        found.append(model.state())
    for name, values in found[0].items():
        assert np.array_equal(values, found[1][name]), name


def test_walls_and_even_points_in_the_cavity(rotation_flow: FlowField) -> None:
    # 2 x 450 samples become 30 x 30, symmetric about the box's centre; walls keep all inside.
    scene = scene_with(
        "cavity", particles=load_scene("cavity").particles.model_dump() | {"number": 450}
    )
    setup = Setup(scene, model_terms(scene, "mckean_vlasov"), "accurate", rotation_flow, 0, 2)
    model = McKeanVlasov("mckean_vlasov", setup)
    start = snapshot_of(model)
    assert start["x"].shape == (1, 900)
    assert np.mean(start["x"]) == pytest.approx(0.5, abs=1e-14)
    found = run(model, 0.3)
    for name in ("x", "y"):
        assert 0.0 <= found[name].min() <= found[name].max() <= 1.0
    assert model.counts()["samples"] == 900.0


def angular_spread(model: str, number: int, realisations: int) -> float:
    scene = scene_with(particles=particles(number))
    angle = run(model_of(model, scene, "accurate", realisations), 0.75)["angle"]
    return float(np.sqrt(np.mean(angle**2)))


def test_microscopic_spread_is_a_finite_number_effect() -> None:
    # top_bottom at t = 0.75: the microscopic rms angle falls like N^(-1/2) (0.32 at N = 1000,
    # model.md), so by 2 from N = 1000 to 4000 (band: two realisations scatter by some 10 %), while
    # the limit keeps the angle near 0.
    few, many = (angular_spread("microscopic", n, 2) for n in (1000, 4000))
    assert 1.4 < few / many < 2.6
    limit = angular_spread("mckean_vlasov", 10_000, 1)
    assert limit < 0.05


@pytest.mark.heavy
def test_microscopic_approaches_the_limit_like_the_root_of_its_number() -> None:
    # The slope over N = 250 .. 16000; 64 000 samples stand for the limit.
    numbers = (250, 1000, 4000, 16000)
    limit = angular_spread("mckean_vlasov", 64_000, 1)
    spread = np.array([angular_spread("microscopic", n, 4) for n in numbers])
    slope = np.polyfit(np.log(numbers), np.log(spread - limit), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.1)


@pytest.mark.heavy
def test_a_million_samples_agree_with_a_tenth_of_them() -> None:
    # top_bottom to t = 0.75. Even points: means converge like 1/S, so the two agree to 1e-4 of what
    # the tolerance allows a step; memory: 0.1 GB a million.
    found = []
    for number in (100_000, 1_000_000):
        scene = scene_with(particles=particles(number))
        values = run(model_of("mckean_vlasov", scene), 0.75)
        found.append(
            [np.mean(values["x"] ** 2), np.mean(values["y"] ** 2), np.std(values["angle"])]
        )
    assert found[0] == pytest.approx(found[1], rel=1e-3)
