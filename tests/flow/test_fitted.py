"""Fields fitted to exact flows in written cases: order, walls, turned, far away; ascii, binary, packed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ellipsoid_coupling.flow import FlowField
from ellipsoid_coupling.flow.openfoam.reader import read_case
from tests.flow.exact_cases import (
    Array,
    Exact,
    Grid,
    Written,
    annulus,
    couette,
    lattice,
    past_cylinder,
    poiseuille,
    wavy_channel,
    write_case,
)

ANGLE = np.pi / 6.0
TURN = 2.0 * np.pi * np.arange(2000) / 2000


def _ring(cells: int) -> Grid:
    return annulus(np.linspace(1.0, 2.0, cells + 1), 4 * cells)


def _channel(cells: int) -> Grid:
    return lattice(np.linspace(0.0, 3.0, 3 * cells + 1), np.linspace(0.0, 1.0, cells + 1))


def _off(field: FlowField, flow: Exact, x: Array, y: Array) -> Array:
    """How far a field is off a flow, speeds at points."""
    sample, exact = field.evaluate(x, y), flow.velocity(x, y)
    return np.asarray(np.hypot(sample.velocity_x - exact[0], sample.velocity_y - exact[1]))


def _rod(field: FlowField, radius: float) -> Array:
    """The rate of rotation of a thin rod along a circle, n . (t . grad) u and t . (n . grad) u."""
    n = np.stack((np.cos(TURN), np.sin(TURN)))
    t = np.stack((-n[1], n[0]))
    sample = field.evaluate(*(radius * n))
    gradient = np.array([
        [sample.dux_dx, sample.dux_dy],
        [sample.duy_dx, -sample.dux_dx],
    ])  # fmt: skip
    along = np.einsum("ik,ijk,jk->k", n, gradient, t)
    return np.stack((along, np.einsum("ik,ijk,jk->k", t, gradient, n)))


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> FlowField:
    """Couette flow on 40 x 160 cells."""
    return read_case(write_case(tmp_path_factory.mktemp("ring"), _ring(40), couette()))


def test_the_ring_keeps_to_its_arcs(ring: FlowField) -> None:
    """40 x 160 cells: slip below 0.5 % of Umax, rates of rotation on the walls within 3 %.

    The cylinder's velocity is given in the middle of chords, 2e-4 slower than on the arc: that, over a
    cell, is the rate's error at the inner wall. Psi is constant on each wall within 1e-6.
    """
    a, b = -1.0 / 3.0, 4.0 / 3.0
    for radius, spin in ((1.0, 1.0), (2.0, 0.0)):
        circle = radius * np.cos(TURN), radius * np.sin(TURN)
        assert _off(ring, couette(), *circle).max() < 5e-4
        sample = ring.evaluate(*circle)
        through = (sample.velocity_x * circle[0] + sample.velocity_y * circle[1]) / radius
        assert np.abs(through).max() < 1e-5
        along, across = _rod(ring, radius)
        assert np.abs(along + spin).max() < 2e-3
        assert np.abs(across - (a - b / radius**2)).max() < 0.03 * abs(a - b / radius**2)


def test_tracers_stay_on_their_circles(ring: FlowField) -> None:
    """Ten turns in steps shorter than a cell, of fourth order: radius within 1e-5, none leaves."""
    radius = np.linspace(1.0005, 1.95, 24)
    step = 2.0 * np.pi / (4.0 / 3.0 / radius**2 - 1.0 / 3.0) / 600

    def velocity(at: Array) -> Array:
        sample = ring.evaluate(*at)
        assert sample.inside.all()
        return np.stack((sample.velocity_x, sample.velocity_y))

    at = np.stack((radius, 0.0 * radius))
    for _ in range(6000):
        first = velocity(at)
        second = velocity(at + 0.5 * step * first)
        third = velocity(at + 0.5 * step * second)
        last = velocity(at + step * third)
        at = at + step / 6.0 * (first + 2.0 * second + 2.0 * third + last)
    assert np.abs(np.hypot(*at) - radius).max() < 1e-5


@pytest.mark.parametrize(
    ("flow", "grids"),
    [
        (couette(), [_ring(cells) for cells in (10, 20)]),
        (poiseuille(ANGLE), [_channel(cells).moved(ANGLE) for cells in (8, 16)]),
    ],
    ids=["ring", "turned channel"],
)
def test_order_in_the_mesh_width(flow: Exact, grids: list[Grid], tmp_path: Path) -> None:
    """Order 2 at least, on round walls and on walls that are not along the grid's lines."""
    errors = []
    for number, grid in enumerate(grids):
        field = read_case(write_case(tmp_path / str(number), grid, flow))
        centres = grid.points[grid.cells].mean(axis=1)
        at = 0.5 * (centres + grid.points[grid.cells[:, 0]])
        assert field.evaluate(*at.T).inside.all()
        errors.append(float(np.sqrt(np.mean(_off(field, flow, *at.T) ** 2))))
    assert 1.9 < np.log2(errors[0] / errors[1]) < 4.5, errors


def test_potential_flow_past_a_cylinder(tmp_path: Path) -> None:
    """The stagnation point and the shoulder, 48 x 96 cells: 2 % of U there, nothing through the wall.

    Fluid slips along the cylinder: nothing but psi is given on it.
    """
    flow = past_cylinder(6.0)
    grid = annulus(np.exp(np.linspace(0.0, np.log(6.0), 49)), 96)
    field = read_case(write_case(tmp_path, grid, flow))
    circle = np.cos(TURN), np.sin(TURN)
    assert _off(field, flow, *circle).max() < 0.02
    sample = field.evaluate(*circle)
    through = sample.velocity_x * circle[0] + sample.velocity_y * circle[1]
    assert np.abs(through).max() < 5e-4
    assert field.outline is not None
    on_cylinder = field.outline.patch == field.outline.names.index("cylinder")
    assert not field.outline.outflow[on_cylinder].any()
    assert field.outline.outflow.sum() == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("at", [(0.0, 0.0), (5e5, -1e6)])
def test_far_from_the_origin(at: tuple[float, float], tmp_path: Path) -> None:
    """A channel moved by 1e6 of its heights: the same field to 1e-9; coordinates there end at 1e-10."""
    grid, flow = _channel(8).moved(ANGLE), poiseuille(ANGLE)
    here = read_case(write_case(tmp_path / "here", grid, flow))
    there = read_case(write_case(tmp_path / "there", grid, flow, at=np.array(at)))
    points = grid.points[grid.cells].mean(axis=1)
    one, other = here.evaluate(*points.T), there.evaluate(*(points + at).T)
    assert other.inside.all()
    np.testing.assert_allclose(other.velocity_x, one.velocity_x, atol=1e-9)
    np.testing.assert_allclose(other.velocity_y, one.velocity_y, atol=1e-9)
    assert here.outline is not None
    assert there.outline is not None
    np.testing.assert_allclose(there.outline.ends - at, here.outline.ends, atol=1e-9)


@pytest.mark.parametrize(
    "written", [Written(False), Written(True, packed=True)], ids=["ascii", "gzip"]
)
def test_all_formats_give_the_same_bits(written: Written, tmp_path: Path) -> None:
    grid, flow = _ring(8), couette()
    one = read_case(write_case(tmp_path / "case", grid, flow))
    other = read_case(write_case(tmp_path / "other" / "case", grid, flow, written))
    assert one.digest == other.digest
    assert one.origin.endswith("; psi from phi")


@pytest.mark.parametrize("axes", [(0, 2, 1), (2, 0, 1)], ids=["x, z", "y, z"])
def test_the_plane_may_be_any(axes: tuple[int, int, int], tmp_path: Path) -> None:
    """The signs of fluxes do not depend on which way the plane is looked at."""
    grid, flow = _ring(8), couette()
    one = read_case(write_case(tmp_path / "case", grid, flow))
    other = read_case(write_case(tmp_path / "other" / "case", grid, flow, Written(axes=axes)))
    assert one.digest == other.digest
    assert other.origin.endswith("; psi from phi")


def test_without_phi_psi_comes_from_u(tmp_path: Path) -> None:
    """And says so; on a smooth flow it is as good: 0.5 % of Umax on 20 x 80 cells."""
    case = write_case(tmp_path, _ring(20), couette(), Written(phi=False))
    field = read_case(case)
    assert field.origin.endswith("; psi from U as there is no phi")
    assert _off(field, couette(), 1.5 * np.cos(TURN), 1.5 * np.sin(TURN)).max() < 0.005


def test_cyclic_sides_are_periodic(tmp_path: Path) -> None:
    """A wavy channel, 24 x 24 cells: value and gradient are those of the other side to 1e-5 of the largest.

    The flow itself is met within 0.5 % of its top speed there; without the tie 1.3 %, gradients 20 %.
    """
    grid, flow = wavy_channel(24)
    field = read_case(write_case(tmp_path, grid, flow))
    y = np.linspace(0.0, 1.0, 201)
    left, right = field.evaluate(np.zeros(201), y), field.evaluate(np.ones(201), y)
    top = field.largest_speed
    for one, other in zip(left[:5], right[:5], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5 * max(top, np.abs(one).max()))
    assert _off(field, flow, np.zeros(201), y).max() < 0.005 * top


def test_a_broken_u_is_replaced_by_that_of_phi(tmp_path: Path) -> None:
    """As potentialFoam's is on oblique cells: here a third too large; psi and walls come from phi alone.

    The velocity that the fluxes give is first order in cells, 1 % of Umax off in the field at 20 x 80.
    """
    true = couette()

    def wrong(x: Array, y: Array) -> tuple[Array, Array]:
        u_x, u_y = true.velocity(x, y)
        return 4.0 / 3.0 * u_x, 4.0 / 3.0 * u_y

    field = read_case(write_case(tmp_path, _ring(20), true._replace(velocity=wrong)))
    assert field.origin.endswith("; psi and U from phi, as the case's U is 33 % off it")
    assert _off(field, true, 1.5 * np.cos(TURN), 1.5 * np.sin(TURN)).max() < 0.01


def test_corners_stay_corners(tmp_path: Path) -> None:
    """A square solid in a linear flow: no curve cuts its corners, the spline there is exact.

    The flow (-x, y) is 0 at the solid's sides nowhere, so these are no walls but patches; psi = -x y is
    bicubic, and only the solution's rounding is left.
    """

    def patch(at: Array) -> np.ndarray:
        return np.where(np.abs(at).max(axis=1) < 0.6, "square", "rim")

    flow = Exact(
        lambda x, y: -x * y, lambda x, y: (-x, y), patch, {"square": "patch", "rim": "patch"}, None
    )
    nodes = np.linspace(-1.0, 1.0, 17)
    grid = lattice(nodes, nodes, without=lambda x, y: np.maximum(np.abs(x), np.abs(y)) < 0.5)
    field = read_case(write_case(tmp_path, grid, flow))
    x, y = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 4000))
    solid = np.maximum(np.abs(x), np.abs(y)) < 0.5
    sample = field.evaluate(x, y)
    assert sample.inside[~solid].all()
    assert not sample.inside[np.maximum(np.abs(x), np.abs(y)) < 0.45].any()
    assert _off(field, flow, x[~solid], y[~solid]).max() < 1e-10
