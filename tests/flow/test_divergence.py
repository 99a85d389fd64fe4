"""Flows with sources: u = rot psi + grad chi, against flows whose velocity is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ellipsoid_coupling as ec
from ellipsoid_coupling.compiled.jit import kernel
from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow import (
    FlowField,
    FlowSeries,
    When,
    flow_at,
    load_flow,
    open_window,
)
from ellipsoid_coupling.flow.interval import Interval, Sample, sample_at
from ellipsoid_coupling.flow.openfoam.case_series import read_times
from ellipsoid_coupling.flow.openfoam.reader import read_case
from ellipsoid_coupling.flow.when import Divergence
from ellipsoid_coupling.models import plan_flow
from ellipsoid_coupling.output.new_scene import scene_of_case
from ellipsoid_coupling.output.scene_choices import Wishes
from tests.flow.exact_cases import Exact, Written, annulus, lattice, plane_source, write_case

Array = NDArray[np.float64]
DATA = Path(__file__).parents[1] / "data"


@kernel
def _moving_sample(flow: Interval, t: float, x: float, y: float) -> Sample:
    return sample_at(flow, t, x, y)


# Of the source in the ring: u = r / r^2.
STRENGTH = 2.0 * np.pi


def linear_flow(
    gradient: Array, walls: Callable[[Array], NDArray[np.bool_]] | None = None
) -> Exact:
    """Of u = G r, of any trace; fluid slips along the edges whose middles are in `walls`."""

    def velocity(x: Array, y: Array) -> tuple[Array, Array]:
        return gradient[0, 0] * x + gradient[0, 1] * y, gradient[1, 0] * x + gradient[1, 1] * y

    def jump(start: Array, stop: Array) -> Array:
        way = stop - start
        u_x, u_y = velocity(*(0.5 * (start + stop)).T)
        return u_x * way[:, 1] - u_y * way[:, 0]

    def patch(at: Array) -> NDArray[np.str_]:
        return np.where(np.zeros(len(at), bool) if walls is None else walls(at), "wall", "open")

    types = {"open": "patch"} if walls is None else {"open": "patch", "wall": "wall"}
    return Exact(lambda x, y: 0.0 * (x + y), velocity, patch, types, None, jump)


def ring(folder: Path, rings: int) -> Path:
    """A source in the ring from 1 to 3."""
    grid = annulus(np.linspace(1.0, 3.0, rings + 1), 6 * rings)
    return write_case(folder, grid, plane_source(STRENGTH, 2.0))


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ring(tmp_path_factory.mktemp("source") / "source", 16)


@pytest.fixture(scope="module")
def field(source: Path) -> FlowField:
    return flow_at(source, divergence=True)


def error(field: FlowField, radii: tuple[float, float]) -> float:
    """The largest error of the source's velocity between two radii."""
    r, angle = np.meshgrid(np.linspace(*radii, 20), 0.1 + np.linspace(0.0, 2.0 * np.pi, 40))
    x, y = r * np.cos(angle), r * np.sin(angle)
    found = field.evaluate(x, y)
    assert found.inside.all()
    exact = np.stack((x, y)) / r**2
    return float(np.hypot(found.velocity_x - exact[0], found.velocity_y - exact[1]).max())


def test_a_source_in_a_ring_is_met_to_second_order(tmp_path: Path, field: FlowField) -> None:
    """Half the width of the cells, a quarter of the error; a cell from the rims, where chords are."""
    fine = flow_at(ring(tmp_path / "fine", 32), divergence=True)
    coarse, finer = error(field, (1.15, 2.85)), error(fine, (1.15, 2.85))
    assert coarse < 1e-2
    assert finer < coarse / 3.0


def test_particles_of_fluid_go_outwards_as_they_should(field: FlowField) -> None:
    """r^2 = r_0^2 + q t / pi, to the 1e-3 that u is off, by Runge and Kutta's fourth order."""
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    at = 1.2 * np.stack((np.cos(angle), np.sin(angle)))

    def u(place: Array) -> Array:
        sample = field.evaluate(*place)
        return np.stack((sample.velocity_x, sample.velocity_y))

    step, steps = 0.05, 60
    for _ in range(steps):
        k1 = u(at)
        k2 = u(at + 0.5 * step * k1)
        k3 = u(at + 0.5 * step * k2)
        at = at + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + u(at + step * k3))
    expected = 1.2**2 + STRENGTH * steps * step / np.pi
    np.testing.assert_allclose(np.sum(at**2, axis=0), expected, rtol=2e-3)


def test_without_the_key_it_is_refused_and_the_message_names_it(source: Path) -> None:
    with pytest.raises(InputError, match=r"does not close by .*flow\.divergence = true"):
        flow_at(source)
    assert not flow_at(source, allow_misfit=True).has_sources


def test_origin_tells_the_sources(field: FlowField) -> None:
    """All of this flow is grad chi; psi is 0 but for what chords miss."""
    assert field.has_sources
    assert "psi and chi from phi, of whose sources grad chi is 100 % of U" in field.origin
    assert field.misfit is not None
    assert field.misfit.cells < 0.01


def test_what_chi_adds_is_the_gradient_of_the_whole(field: FlowField) -> None:
    """Differences of the velocity; div u from chi alone is that of the whole."""
    x, y, h = np.array([1.3, -0.4, 2.1]), np.array([0.9, 1.7, -0.6]), 1e-5
    sample = field.evaluate(x, y)
    for found, axis, name in (
        (sample.dux_dx, 0, "velocity_x"), (sample.dux_dy, 1, "velocity_x"),
        (sample.duy_dx, 0, "velocity_y"), (sample.duy_dy, 1, "velocity_y"),
    ):  # fmt: skip
        ends = [field.evaluate(x + s * (axis == 0), y + s * (axis == 1)) for s in (h, -h)]
        slope = (getattr(ends[0], name) - getattr(ends[1], name)) / (2.0 * h)
        np.testing.assert_allclose(found, slope, atol=1e-7)
    np.testing.assert_allclose(sample.stretch, 0.5 * (sample.dux_dx - sample.duy_dy))


def test_fluid_that_swells_evenly_beside_walls_is_exact(tmp_path: Path) -> None:
    """The flow (x, 0) from a closed end to an open one: chi = x^2/2, which a spline holds to rounding."""
    grid = lattice(np.linspace(0.0, 2.0, 13), np.linspace(0.5, 1.5, 9))
    flow = linear_flow(np.array([[1.0, 0.0], [0.0, 0.0]]), lambda at: at[:, 0] < 2.0 - 1e-9)
    field = flow_at(write_case(tmp_path / "swelling", grid, flow), divergence=True)
    x, y = np.meshgrid(np.linspace(0.0, 2.0, 9), np.linspace(0.5, 1.5, 7))
    found = field.evaluate(x, y)
    np.testing.assert_allclose(found.velocity_x, x, atol=1e-8)
    np.testing.assert_allclose(found.velocity_y, 0.0, atol=1e-8)
    np.testing.assert_allclose(found.dux_dx + found.duy_dy, 1.0, atol=1e-6)
    assert field.outline is not None
    assert field.outline.outflow.sum() == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.5])
def test_a_box_beside_the_middle_of_swelling_and_turning_fluid(
    tmp_path: Path, angle: float
) -> None:
    """Linear in space, all sides open, also turned: chi itself is not quadratic, u is met to 1 %."""
    gradient = np.array([[0.7, 0.4], [-0.9, 0.3]])
    grid = lattice(np.linspace(1.0, 2.0, 17), np.linspace(0.5, 1.5, 17)).moved(angle)
    field = flow_at(write_case(tmp_path / "box", grid, linear_flow(gradient)), divergence=True)
    points = lattice(np.linspace(1.05, 1.95, 9), np.linspace(0.55, 1.45, 9)).moved(angle).points
    found = field.evaluate(*points.T)
    exact = gradient @ points.T
    off = np.hypot(found.velocity_x - exact[0], found.velocity_y - exact[1])
    assert off.max() < 0.01 * np.hypot(*exact).max()


@pytest.mark.parametrize("name", ["channel_8", "baffle", "elbow"])
def test_a_flow_without_sources_is_the_same_to_the_bit(name: str) -> None:
    """Where phi closes there is no chi, and kernels are compiled without."""
    field = read_case(DATA / name, divergence=Divergence.WHERE_OPEN)
    assert not field.has_sources
    assert field.digest == read_case(DATA / name).digest


def test_where_phi_closes_chi_is_flat() -> None:
    """A flow of several times may have sources at some only: then chi is 0 to the solver's digits."""
    field = read_case(DATA / "channel_8", divergence=Divergence.ALWAYS)
    assert field.has_sources
    alone = read_case(DATA / "channel_8")
    x_low, x_high, y_low, y_high = alone.bounds
    x, y = np.meshgrid(np.linspace(x_low, x_high, 30), np.linspace(y_low, y_high, 20))
    one, other = field.evaluate(x, y), alone.evaluate(x, y)
    assert np.abs(one.dux_dx + one.duy_dy).max() < 1e-4
    assert np.abs(one.velocity_x - other.velocity_x).max() < 0.02 * alone.largest_speed


def test_a_case_without_fluxes_is_refused_with_the_remedy(tmp_path: Path) -> None:
    grid = annulus(np.linspace(1.0, 3.0, 9), 24)
    case = write_case(tmp_path / "bare", grid, plane_source(STRENGTH, 2.0), Written(phi=False))
    with pytest.raises(
        InputError, match=r"fluxes phi in m3/s .* found none .*\. Let the solver write"
    ):
        flow_at(case, divergence=True)


def test_a_saved_flow_keeps_chi(tmp_path: Path, field: FlowField) -> None:
    field.save(tmp_path / "flow.npz")
    again = load_flow(tmp_path / "flow.npz")
    assert again.has_sources
    assert again.digest == field.digest
    assert again.origin == field.origin
    assert again.misfit == field.misfit
    still = FlowField(field.arrays._replace(coefficients=0.5 * field.arrays.coefficients), "half")
    assert still.digest != field.digest


def test_sources_that_grow_in_time(tmp_path: Path) -> None:
    """At rest, then the source, then twice as much: u is linear in between."""
    grid, case = annulus(np.linspace(1.0, 3.0, 9), 32), tmp_path / "growing"
    for time, strength in ((3, 2.0), (2, 1.0), (1, 1e-9)):
        write_case(case, grid, plane_source(strength * STRENGTH, 2.0))
        if time > 1:
            (case / "1").rename(case / str(time))
    flow = read_times(case, When("all", until=2.0, divergence=True))
    assert isinstance(flow, FlowSeries)
    assert flow.has_sources
    x, y = np.array([1.5, 0.0]), np.array([0.0, -2.0])
    found = flow.at(1.5).evaluate(x, y)
    np.testing.assert_allclose(found.velocity_x, 1.5 * x / (x**2 + y**2), atol=0.02)
    np.testing.assert_allclose(found.velocity_y, 1.5 * y / (x**2 + y**2), atol=0.02)
    flow.save(tmp_path / "flow.npz")
    assert load_flow(tmp_path / "flow.npz").digest == flow.digest
    with open_window(flow) as window:
        assert window.field is not None
        interval = window.field.in_time
        assert isinstance(interval, Interval)
        ux, _, stretch, _, _, inside = _moving_sample(interval, 0.3, 1.5, 0.2)
    there = flow.at(0.3).evaluate(1.5, 0.2)
    np.testing.assert_allclose((ux, stretch), (there.velocity_x, there.stretch), atol=1e-12)
    assert inside


def test_plan_and_new_tell_it(tmp_path: Path, source: Path, field: FlowField) -> None:
    """The largest div u, here 0 but for the mesh's error; and a scene that keeps it."""
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    scene = ec.load_scene(tmp_path / "scene.toml")
    (fact,) = (fact for fact in plan_flow(scene, field, None) if fact.name == "divergence")
    assert abs(float(fact.value)) < 0.2
    text = scene_of_case(source, Wishes(), divergence=True)
    assert "\ndivergence = true  # its sources are kept\n" in text


SCENE = """
name = "source"
times = [1.5]
[domain]
x = [-3.0, 3.0]
y = [-3.0, 3.0]
boundary = "open"
[particles]
length = 0.05
width = 0.025
number = 40
[start]
x = [1.3, 1.5]
y = [-0.1, 0.1]
[flow]
case = "unused"
divergence = true
drag = 40.0
angular_drag = 40.0
[numerics]
cell = 0.1
time_step = 0.005
"""


@pytest.mark.parametrize(
    ("model", "scheme"),
    [("microscopic", "paper"), ("rho_mono_kinetic", "accurate"), ("diffusive", "accurate")],
)
def test_models_carry_it(model: str, scheme: Any, tmp_path: Path, field: FlowField) -> None:
    """Particles with little inertia follow r^2 = r_0^2 + q t / pi but for their lag, 1/drag: 2 %."""
    (tmp_path / "scene.toml").write_text(SCENE, encoding="utf-8")
    result = ec.simulate(ec.load_scene(tmp_path / "scene.toml"), model, scheme, flow=field)
    density = result.density(cells=60)[-1]
    at = -3.0 + 0.1 * (np.arange(60) + 0.5)
    r2 = float((density * (at[:, None] ** 2 + at**2)).sum() / density.sum())
    # From rest, the fluid takes the time 1/drag to bring them along.
    expected = 1.4**2 + 0.2**2 / 6.0 + STRENGTH * (1.5 - 1.0 / 40.0) / np.pi
    assert r2 == pytest.approx(expected, rel=0.02)
